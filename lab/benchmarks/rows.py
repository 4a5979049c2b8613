"""The rows that benchmarks return, the measurement of cases in turns, and processes that take part."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import IO, Any

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
        """True if the goal is reached, ``None`` without a goal."""
        measured = self.ratio if self.peer else self.value
        return None if self.goal is None or measured is None else measured <= self.goal

    def to_json(self) -> dict[str, Any]:
        """Return the row as plain data."""
        return {**asdict(self), "met": self.met}


def take_turns(
    cases: Mapping[str, Callable[[int], object]], rounds: int, repetitions: int
) -> dict[str, NDArray[np.float64]]:
    """Measure the microseconds of one repetition, for every case and round.

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
    """Return the row of a case: median time, and the median ratio to the peer of the same round."""
    ratios = times[name] / times[peer]
    p10, p50, p90 = (float(value) for value in np.percentile(ratios, (10, 50, 90)))
    value = float(np.median(times[name]))
    return Row(name, value, "us/tick", peer, p50, goal, p10, p90, note, floor)


class OtherProcess:
    """The near end of such a process, which reads lines and answers each by one line of JSON."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        assert process.stdin is not None and process.stdout is not None
        self._process = process
        self._said: IO[str] = process.stdin
        self._heard: IO[str] = process.stdout

    def ask(self, line: str) -> Any:
        """Say a line, and wait for what is answered."""
        self._said.write(f"{line}\n")
        self._said.flush()
        return json.loads(self._heard.readline())

    def freeze(self) -> None:
        """Stop the process where it is, as if its machine were gone."""
        self._process.send_signal(signal.SIGSTOP)


@contextmanager
def other_process(code: str) -> Iterator[OtherProcess]:
    """Start a process that runs Python code, and kill it in the end."""
    command = [sys.executable, "-c", code]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield OtherProcess(process)
        finally:
            process.kill()
