"""Explanation of a failed run: the chain of deviations that leads to its end, from the first one on.

From the fall the chain goes back in time: a deviation belongs to it if it lasted until a later link of it began, or
ended less than ``MEMORY`` before. Where the robot did not fall there is no such instant, and every deviation
belongs to the chain of a run that failed. Of the deviations with which the chain begins, that one is the cause which comes
first in ``deviations.KINDS``: what disturbs the robot comes before what it measures, estimates, commands and does.
A chain shows what came before what; that one thing led to the next is an engineer's conclusion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ...logs.replay.opened_run import OpenedRun
from ...logs.replay.replay import Replayable
from .contact_errors import ContactError, contact_errors
from .deviations import DAMPED, FORBIDDEN, KINDS, TILT, Deviation, all_deviations
from .robot_run import RobotRun

MEMORY = 0.3
"""A deviation still matters so long [s] after it has ended."""
TOGETHER = 0.02
"""Deviations that begin within this time [s] begin together."""

FALLEN = 45.0
"""A robot that at the end tilts beyond its plan, and did by more than this [deg], has fallen."""


@dataclass(frozen=True)
class Explanation:
    """Explanation of a run's end.

    Attributes:
        success: whether it succeeded.
        reason: what its score says.
        ended: the time [s] from which the chain goes back: the fall or stop, else the end of the run.
        chain: the deviations that lead there, by when they begin.
        passed: deviations that were over long before; of a run that succeeded all.
        contacts: all false and missed contacts, also those of the chain.
    """

    success: bool
    reason: str
    ended: float
    chain: tuple[Deviation, ...]
    passed: tuple[Deviation, ...]
    contacts: tuple[ContactError, ...]

    @property
    def cause(self) -> Deviation | None:
        """The first deviation of the chain; none where nothing deviated."""
        if not self.chain:
            return None
        together = [d for d in self.chain if d.begin <= self.chain[0].begin + TOGETHER]
        return min(together, key=lambda d: (KINDS.index(d.kind), d.begin))

    def to_json(self) -> dict[str, Any]:
        """Return the same as plain data."""
        cause = self.cause

        def plain(deviation: Deviation) -> dict[str, Any]:
            return asdict(deviation) | {"text": deviation.text}

        return {
            "success": self.success,
            "reason": self.reason,
            "ended_s": self.ended,
            "cause": cause and plain(cause),
            "chain": [plain(d) for d in self.chain],
            "passed": [plain(d) for d in self.passed],
            "contacts": [asdict(c) for c in self.contacts],
        }


def explain(run: OpenedRun | Replayable, outcome: Mapping[str, Any] | None = None) -> Explanation:
    """Explain a recorded run, or one in memory with its outcome.

    Args:
        run: the run.
        outcome: what ``RunResult.to_json`` gives; of a recording by default what was recorded.

    Raises:
        AloftError: the run has no truth to compare with.
        LoadError: the graph of the recording cannot be loaded any more.
    """
    if outcome is None:
        outcome = (run.file.outcome or {}) if isinstance(run, OpenedRun) else {}
    robot = RobotRun(run, outcome)
    errors = contact_errors(robot)
    found = [
        *all_deviations(robot),
        *(error.as_deviation(robot) for error in errors if error.matters),
    ]
    found.sort(key=lambda d: (d.begin, KINDS.index(d.kind)))
    ended, fell = end_of(robot, found)
    found = [d for d in found if d.begin <= ended + 1e-9]
    success = bool(outcome.get("success", False))
    chain = [] if success else chain_to(ended, found) if fell else found
    return Explanation(
        success, str(outcome.get("reason", "")), ended, tuple(chain),
        tuple(d for d in found if d not in chain), tuple(errors),
    )  # fmt: skip


def end_of(run: RobotRun, found: list[Deviation]) -> tuple[float, bool]:
    """Return the time [s] at which it was decided, and whether the robot fell or was stopped then: its drives are
    damped, or something but a contact point touches; else the end of the run.
    """
    last = float(run.time[-1])
    ends = [d.begin for d in found if d.name == FORBIDDEN or d.name.startswith(DAMPED)]
    fallen = any(d.name == TILT and d.size > FALLEN and d.end >= last for d in found)
    return min([*ends, last]), fallen or bool(ends)


def chain_to(ended: float, found: list[Deviation]) -> list[Deviation]:
    """Return the deviations that lead to that time, by when they begin."""
    chain: list[Deviation] = []
    first = ended
    for deviation in sorted(found, key=lambda d: d.end, reverse=True):
        if deviation.end >= first - MEMORY:
            chain.append(deviation)
            first = min(first, deviation.begin)
    return sorted(chain, key=lambda d: (d.begin, KINDS.index(d.kind)))
