"""What follows from a robot alone is computed once for the same content and arguments."""

from __future__ import annotations

from aloft.planner.task.per_robot import KEPT, per_robot
from aloft.robots.description import RobotDescription, find_robot

BRUCE = find_robot("bruce")


def test_the_same_robot_is_asked_once_and_another_one_again() -> None:
    asked: list[tuple[str, float]] = []

    @per_robot
    def mass(robot: RobotDescription, scale: float) -> float:
        asked.append((robot.name, scale))
        return robot.total_mass * scale

    assert mass(BRUCE, 2.0) == mass(BRUCE.model_copy(), 2.0) == 2.0 * BRUCE.total_mass
    assert len(asked) == 1, "a copy is the same robot"
    mass(BRUCE, 3.0)
    mass(BRUCE.model_copy(update={"name": "other"}), 2.0)
    assert asked == [("bruce", 2.0), ("bruce", 3.0), ("other", 2.0)]


def test_only_the_last_results_are_kept() -> None:
    asked: list[int] = []

    @per_robot
    def number(robot: RobotDescription, which: int) -> int:
        asked.append(which)
        return which

    for which in (*range(KEPT + 1), KEPT, 0):
        assert number(BRUCE, which) == which
    assert asked == [*range(KEPT + 1), 0], "the oldest was forgotten"
