"""The quantities of a joint that slides are in m and N wherever a unit is said by joint."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.blocks.jumping.guided_motion import check_limits
from aloft.logs.file.format import RecordedField
from aloft.logs.viewing.signal_names import element_names, unit_of_element
from aloft.planner.task.read_task import contradictions
from aloft.planner.task.task import JumpTask
from aloft.robots.validation import find_errors
from aloft.runtime.language.errors import BlockError

from .limbed_robots import slider

ROBOT = slider()
N = len(ROBOT.joints)
LENGTH = [joint.name for joint in ROBOT.joints].index("left_length")
MOTIONS = [("rad", "m"), ("rad/s", "m/s"), ("N m", "N"), ("N m/rad", "N/m"), ("V", "V")]


@pytest.mark.parametrize(("hinge", "slide"), MOTIONS)
def test_joints_and_their_motors_have_the_units_of_their_kind(hinge: str, slide: str) -> None:
    for k, joint in enumerate(ROBOT.joints):
        expected = slide if joint.kind == "slide" else hinge
        assert joint.unit(hinge) == expected and ROBOT.motor_unit(k, hinge) == expected


def test_a_motor_that_moves_joints_of_both_kinds_has_the_units_of_one_that_turns() -> None:
    rows = np.eye(N)
    rows[LENGTH, LENGTH - 1] = 1.0
    motors = {"motors": list(ROBOT.transmission.motors), "joint_to_motor": rows.tolist()}
    mixed = type(ROBOT).model_validate({**ROBOT.model_dump(), "transmission": motors})
    assert mixed.motor_unit(LENGTH, "N m") == "N m" and ROBOT.motor_unit(LENGTH, "N m") == "N"


@pytest.mark.parametrize("port", ["joints.position", "truth.motor_position"])
def test_elements_of_recorded_arrays_say_their_unit(port: str) -> None:
    field = RecordedField(f"robot.{port}", "float64", 0, (N,), ("n_joints",), "rad")
    names = element_names(field, ROBOT)
    assert names[LENGTH] == "left_length [m]"
    assert [name for name in names if "[" in name] == ["left_length [m]", "right_length [m]"]
    assert [unit_of_element(field, ROBOT, k) for k in (0, LENGTH)] == ["rad", "m"]


def test_generalised_velocities_that_slide_are_in_metres() -> None:
    field = RecordedField("x.y.velocity", "float64", 0, (6 + N,), ("n_velocities",))
    found = [unit_of_element(field, ROBOT, k) for k in (0, 2, 3, 6, 6 + LENGTH)]
    assert found == ["m/s", "m/s", "rad/s", "rad/s", "m/s"]


def test_a_task_beyond_a_slides_limits_is_told_in_metres() -> None:
    task = JumpTask.model_validate(
        {"name": "up", "robot": "slider", "rise": 0.1, "initial": {"left_length": 9.0}}
    )
    texts = dict(contradictions(task, ROBOT))
    assert texts["initial.left_length"].startswith("9 m is outside the joint's limits, ")
    assert texts["initial.left_length"].endswith(" m")


def test_a_motion_beyond_a_slides_limits_or_its_motors_is_told_in_metres() -> None:
    place, rate = np.tile(ROBOT.standing_position, (3, 1)), np.zeros((3, N))
    place[1, LENGTH] = ROBOT.joint_limits[LENGTH, 1] + 0.25
    with pytest.raises(BlockError, match=r"takes left_length 0\.250 m past its limit"):
        check_limits(ROBOT, {"joint_position": place, "joint_velocity": rate})
    place[1, LENGTH], rate[2, LENGTH] = ROBOT.standing_position[LENGTH], 99.0
    with pytest.raises(BlockError, match=r"at 99\.0 m/s, but motor reaches 30\.0 m/s"):
        check_limits(ROBOT, {"joint_position": place, "joint_velocity": rate})


def errors(motors: dict[str, Any], **profile: Any) -> list[str]:
    data = ROBOT.model_dump(mode="json", exclude_unset=True)
    data["profiles"]["motor"] |= {"motors": motors, **profile}
    return [fault.expected for fault in find_errors(data)]


def test_ratings_of_motors_that_cannot_be_are_asked_for_in_their_units() -> None:
    wrong = {"peak_torque": -1.0}
    assert errors({"*_length": wrong}) == ["a number of N from 0"]
    assert errors({"left_*": wrong}) == ["a number of N m (N for a slide) from 0"]
    assert errors({ROBOT.joints[0].name: wrong}) == ["a number of N m from 0"]
    assert errors({}, peak_torque=-1.0) == ["a positive number of N m (N for a slide)"]
    assert errors({"*_length": {"corner_speed": 40.0}}) == ["corner_speed below 30 m/s"]
