"""What a task leaves unsaid suits the robot's size; what it says stays.

What follows from a robot alone is computed once for the same content and arguments.

Toes, knees and the room of the joints, from a robot's description alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.robots.limbed_robots import quadruped

from aloft.planner.task import scaling
from aloft.planner.task.scaling import (
    KEPT,
    knee_limits,
    least_distance_to_limits,
    per_robot,
    scaled_defaults,
    standing_height,
    toe_name_token,
    toe_push,
)
from aloft.planner.task.task import make_task
from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.kinematics import LinkPoses, link_poses

HEAVY = quadruped().changed(
    links=tuple(link.model_copy(update={"mass": 4.0 * link.mass}) for link in quadruped().links)
)


def test_the_robot_of_the_defaults_changes_none() -> None:
    robot, task = find_robot("bruce"), make_task({"recipe": "paper", "name": "a", "rise": 0.1})
    assert standing_height(robot) == pytest.approx(0.3287, abs=1e-4)
    assert scaled_defaults(task, robot) == {}
    assert task.resolved(robot).content() == task.content() | {"profile": "koala"}


def test_a_heavier_robot_pays_less_for_forces() -> None:
    task = make_task({"recipe": "paper", "name": "a", "rise": 0.1})
    light, heavy = (task.resolved(robot) for robot in (quadruped(), HEAVY))
    assert heavy.weights.force == pytest.approx(light.weights.force / 16.0, rel=0.02)
    assert heavy.weights.impulse == pytest.approx(light.weights.impulse / 16.0, rel=0.02)
    assert heavy.weights.orientation == task.weights.orientation
    assert heavy.thrust_time == light.thrust_time
    assert light.resolved(quadruped()) == light


def test_what_is_said_stays() -> None:
    said = {
        "recipe": "paper",
        "name": "a",
        "rise": 0.1,
        "thrust_time": 0.25,
        "weights": {"force": 0.001},
    }
    task = make_task(said).resolved(HEAVY)
    assert (task.thrust_time, task.weights.force) == (0.25, 0.001)
    assert task.weights.impulse < 0.05
    assert task.squat_time != 0.4


def test_a_plans_file_says_all_so_that_it_is_never_scaled_again() -> None:
    task = make_task({"recipe": "paper", "name": "a", "rise": 0.1}).resolved(HEAVY)
    again = make_task(task.model_dump(mode="json"))
    assert again.hash(HEAVY) == task.hash(HEAVY)
    assert again.resolved(HEAVY).content() == task.content()


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


def test_toes_are_the_front_points_of_soles_by_their_common_word() -> None:
    assert toe_name_token(BRUCE) == "toe"
    assert toe_name_token(quadruped()) == "", "feet of one point are no soles"


def test_what_toes_bear_follows_from_the_ankles() -> None:
    ankles = [k for k, joint in enumerate(BRUCE.joints) if joint.name.endswith("ankle")]
    lever = max(contact.position[0] for contact in BRUCE.contacts)
    both = float(BRUCE.motors.peak_torque[ankles].sum())
    assert toe_push(BRUCE) == pytest.approx(both / (lever * BRUCE.weight), rel=0.02)


def test_front_points_that_have_no_word_of_their_own_are_no_toes() -> None:
    renamed = tuple(
        point.model_copy(update={"name": point.name.replace("toe", "heel") + "_" * k})
        for k, point in enumerate(BRUCE.contacts)
    )
    assert toe_name_token(BRUCE.changed(contacts=renamed)) == ""


def test_the_knee_is_what_bends_the_leg_most() -> None:
    assert knee_limits(BRUCE, 0.4) == {"knee": (-2.1, -0.4)}
    standing = BRUCE.standing_position[[joint.name for joint in BRUCE.joints].index("left_knee")]
    nearly = knee_limits(BRUCE, 2.0)["knee"]
    assert nearly[1] == pytest.approx(0.8 * standing, abs=0.01), "no more than where it stands"


def test_knees_are_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = find_robot("bruce").changed(text="nobody asked about it before")
    calls = list[int]()

    def counted(*arguments: Any) -> LinkPoses:
        calls.append(len(arguments[-1]))
        return link_poses(*arguments)

    monkeypatch.setattr(scaling, "link_poses", counted)
    toe_push(robot)
    knee_limits(robot, 0.3)
    # each joint of a leg to both sides, its knee at all angles, and the pose it stands in
    assert sorted(calls) == [1, 10, 10, 181, 181]


def test_the_room_is_that_of_the_standing_joint_nearest_to_a_limit() -> None:
    angles, limits = BRUCE.standing_position, BRUCE.joint_limits
    nearest = np.minimum(angles - limits[:, 0], limits[:, 1] - angles).min()
    assert least_distance_to_limits(BRUCE) == pytest.approx(nearest)
