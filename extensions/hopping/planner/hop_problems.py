"""The problems of hops. What hops of a kind share (knots, rows, bounds, functions) is made once, and each takes a copy of it."""

from __future__ import annotations

from collections.abc import Callable

from ....planner.problem.problem import FullProblem
from ....planner.solving.solve import problems_like
from ....planner.task.sequence import edge_of
from ....planner.task.task import JumpTask
from ....robots.description import RobotDescription

MOST_KINDS = 64
"""Greatest number of kinds that are kept; BRUCE's hops are of about forty."""


class HopProblems:
    """Maker of the problems of one robot's hops."""

    def __init__(self, robot: RobotDescription) -> None:
        self.robot = robot
        self._of_kind: dict[object, Callable[[JumpTask], FullProblem]] = {}

    def problem(self, task: JumpTask, coordinates: str) -> FullProblem:
        """Return the problem of a resolved task with one jump on level ground, or up or down."""
        kind = kind_of(task), coordinates
        if kind not in self._of_kind:
            if len(self._of_kind) >= MOST_KINDS:
                self._of_kind.clear()
            self._of_kind[kind] = problems_like(task, self.robot, coordinates=coordinates)
        return self._of_kind[kind](task)


def kind_of(task: JumpTask) -> object:
    """Return a key that is equal for tasks whose problems differ only in where the jump leads."""
    ahead, up = task.distance_x, task.landing_height
    shared = task.model_copy(
        update={
            "name": "hop", "distance_x": 0.0, "distance_y": 0.0, "twist": 0.0, "landing_height": 0.0,
            "rise": None if task.rise is None else 1.0,
        }
    )  # fmt: skip
    over_edge = edge_of(task.hops()[0], task.places()[0]) is not None
    return shared.model_dump_json(), over_edge, ahead > 0.0, ahead < 0.0, up > 0.0, up < 0.0
