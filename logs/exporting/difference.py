"""The differences between two recordings: the signals that differ most, with place and size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.errors import AloftError
from ..file.reader import RecordedRun
from ..viewing.contacts import LIFT_OFF, SHORTEST_FLIGHT, Flights
from ..viewing.scene_ports import scene_ports
from ..viewing.signal_names import unit_of_element
from .named_columns import element_labels

Align = Literal["lift-off", "start"]


class ComparisonError(AloftError):
    """Raised if two recordings cannot be compared; the message says why."""


@dataclass(frozen=True)
class SignalDifference:
    """The difference of one signal.

    Attributes:
        signal, element, unit: what it is; the element is the one that differs most.
        largest: the largest difference of an element, in ``unit``.
        at: when, in seconds from where the runs are aligned.
        rms: the root mean square of that element's difference.
        share: ``largest`` as a share of the signal's range in the first run; ``None`` if it is
            constant there.
    """

    signal: str
    element: str
    unit: str
    largest: float
    at: float
    rms: float
    share: float | None


@dataclass(frozen=True)
class RunDifference:
    """The difference of two runs.

    Attributes:
        align: how they are aligned.
        first_tick, second_tick: the tick of each run at which they are aligned.
        ticks: the number of ticks in which both are compared.
        equal: the number of signals without any difference.
        signals: those that differ, the largest share of the range first.
        only_first, only_second: signals that only one has, or that have another shape.
    """

    align: Align
    first_tick: int
    second_tick: int
    ticks: int
    equal: int
    signals: tuple[SignalDifference, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]


def lift_off_tick(run: RecordedRun) -> int | None:
    """Return the tick of a run's first lift-off; ``None`` if there is none or it cannot be told."""
    ports = scene_ports(run.header)
    if ports is None or ports.contact_force is None or not len(run.ticks):
        return None
    least = max(1, round(SHORTEST_FLIGHT * run.header.base_rate))
    loaded = (run[ports.contact_force] != 0.0).any(axis=2)
    events = Flights(least).add(run.ticks, loaded)
    return next((tick for tick, text in events if text == LIFT_OFF), None)


def compare_runs(
    first: RecordedRun, second: RecordedRun, align: Align | None = None
) -> RunDifference:
    """Compare every signal that both runs have, tick by tick.

    Without ``align`` the runs are aligned at their first lift-off if both have one, and else at
    their first tick.

    Raises:
        ComparisonError: the runs have different base rates or no tick in common, or one has no
            lift-off at which it could be aligned.
    """
    if first.header.base_rate != second.header.base_rate:
        raise ComparisonError(
            f"{first.path} has {first.header.base_rate:g} ticks a second and {second.path} "
            f"{second.header.base_rate:g}; only runs of the same base rate can be compared"
        )
    for run in (first, second):
        if not len(run.ticks):
            raise ComparisonError(f"{run.path} has no tick; there is nothing to compare")
    lifts = (lift_off_tick(first), lift_off_tick(second)) if align != "start" else (None, None)
    if lifts[0] is not None and lifts[1] is not None:
        align, start, other = "lift-off", lifts[0], lifts[1]
    elif align == "lift-off":
        which = first if lifts[0] is None else second
        raise ComparisonError(f"{which.path} has no lift-off; compare with --align start")
    else:
        align, start, other = "start", int(first.ticks[0]), int(second.ticks[0])
    relative, of_first, of_second = np.intersect1d(
        first.ticks - start, second.ticks - other, return_indices=True
    )
    if not len(relative):
        raise ComparisonError("the runs have no tick in common where they are aligned")
    theirs = second.signals()
    found, equal = [], 0
    known = [
        field for name, field in first.signals().items()
        if name in theirs and theirs[name].shape == field.shape
    ]  # fmt: skip
    _ = first.rows, second.rows  # read all at once, not the files anew for each signal
    for field in known:
        a = first[field.name][of_first].astype(np.float64).reshape(len(relative), -1)
        b = second[field.name][of_second].astype(np.float64).reshape(len(relative), -1)
        gaps = _gaps(a, b)
        if not gaps.any():
            equal += 1
            continue
        row, column = np.unravel_index(int(gaps.argmax()), gaps.shape)
        largest = float(gaps[row, column])
        width = float(np.ptp(np.where(np.isfinite(a), a, 0.0)[:, column]))
        found.append(
            SignalDifference(
                field.name,
                element_labels(field, first.header.robot)[int(column)],
                unit_of_element(field, first.header.robot, int(column)),
                largest,
                float(relative[row]) / first.header.base_rate,
                float(np.sqrt(np.mean(gaps[:, column] ** 2))),
                largest / width if width > 0.0 else None,
            )
        )
    same = {field.name for field in known}
    return RunDifference(
        align, start, other, len(relative), equal,
        tuple(sorted(found, key=_share, reverse=True)),
        tuple(name for name in first.signals() if name not in same),
        tuple(name for name in theirs if name not in same),
    )  # fmt: skip


def _share(found: SignalDifference) -> float:
    return np.inf if found.share is None else found.share


def _gaps(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the absolute differences; none where both are not finite in the same way, else
    infinite."""
    with np.errstate(invalid="ignore"):
        gaps = np.abs(a - b)
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    found: NDArray[np.float64] = np.where(same, 0.0, np.where(np.isnan(gaps), np.inf, gaps))
    return found
