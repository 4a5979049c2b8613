"""The rows that benchmarks return, and the measurement of cases that take turns."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Row:
    """One measured value. ``ratio`` is to ``peer``, ``ratio_p10`` and ``ratio_p90`` its spread over
    the rounds; ``goal`` is the largest good ratio (or value, without one), and ``floor`` the largest
    that is still acceptable, where that is another; ``met`` is none where nothing was promised or
    measured, and ``note`` says why."""

    name: str
    value: float | None
    unit: str
    peer: str = ""
    ratio: float | None = None
    goal: float | None = None
    ratio_p10: float | None = None
    ratio_p90: float | None = None
    note: str = ""
    floor: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached."""
        measured = self.ratio if self.peer else self.value
        return None if self.goal is None or measured is None else measured <= self.goal

    def to_json(self) -> dict[str, Any]:
        """The row as plain data."""
        return {**asdict(self), "met": self.met}


def take_turns(
    cases: Mapping[str, Callable[[int], object]], rounds: int, repetitions: int
) -> dict[str, NDArray[np.float64]]:
    """Microseconds of one repetition, for every case and round.

    A case is called with the number of repetitions it is to do. In each round every case has its
    turn, in an order that shifts from round to round, so that whatever else the machine does hits
    them alike.
    """
    names = list(cases)
    times = {name: np.zeros(rounds) for name in names}
    for case in cases.values():
        case(repetitions)  # warm: imports, caches, specialised bytecode
    for turn in range(rounds):
        shift = turn % len(names)
        for name in (*names[shift:], *names[:shift]):
            start = time.perf_counter_ns()
            cases[name](repetitions)
            times[name][turn] = (time.perf_counter_ns() - start) * 1e-3 / repetitions
    return times


def compare(
    name: str,
    times: Mapping[str, NDArray[np.float64]],
    peer: str,
    *,
    goal: float | None = None,
    floor: float | None = None,
    note: str = "",
) -> Row:
    """The row of a case: median time, and the median ratio to the peer of the same round."""
    ratios = times[name] / times[peer]
    p10, p50, p90 = (float(value) for value in np.percentile(ratios, (10, 50, 90)))
    value = float(np.median(times[name]))
    return Row(name, value, "us/tick", peer, p50, goal, p10, p90, note, floor)
