"""The options of the solvers that are not part of a task."""

from __future__ import annotations

from dataclasses import dataclass

from ..task.plan import JumpPlan
from ..task.task import Knots
from .compilation import Progress


@dataclass(frozen=True)
class SolveOptions:
    """What every formulation takes beside the task and the robot.

    Attributes:
        warm_start: a plan of a near task, on any grid; one that goes through other phases is not
            used. A plan of this very task that failed the validity check is solved again on finer
            intervals (see ``refinement``).
        progress: is told when functions are compiled, once for each robot.
        compiled: whether functions are compiled where there is a compiler.
        solver: ``fatrop`` or ``ipopt`` to insist on one of them.
        knots: numbers of intervals to use instead of the task's.
        quick: whether to give up soon: what is not found in a few iterations is not looked for.
    """

    warm_start: JumpPlan | None = None
    progress: Progress | None = None
    compiled: bool = True
    solver: str = ""
    knots: Knots | None = None
    quick: bool = False
