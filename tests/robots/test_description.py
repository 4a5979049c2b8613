"""The robot's description: validation, derived figures and finding one by name."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from aloft.robots.description import MotorRating, RobotDescription, find_robot, read_description

from .validation.wrong_robots import hopper


def test_derived_figures() -> None:
    robot = RobotDescription.model_validate(hopper())
    assert robot.dimensions == {"n_joints": 2, "n_velocities": 8, "n_contacts": 1, "n_feet": 1}
    assert robot.total_mass == 3.0
    assert robot.standing_position.tolist() == [0.0, 0.5]
    assert robot.foot_of_contact() == (0,)
    # power is the same on both sides of the transmission
    torque, velocity = np.array([3.0, -2.0]), np.array([0.7, 1.1])
    motor_power = (robot.torque_to_motor @ torque) @ (robot.joint_to_motor @ velocity)
    assert motor_power == pytest.approx(torque @ velocity)


def test_a_robot_of_the_users_own_file(tmp_path: Path) -> None:
    (tmp_path / "hopper.yaml").write_text(yaml.safe_dump(hopper()))
    assert find_robot("hopper.yaml", tmp_path) == read_description(tmp_path / "hopper.yaml")
    assert find_robot("hopper.yaml", str(tmp_path)) == find_robot("hopper.yaml", tmp_path)
    with pytest.raises(LookupError, match=r"no robot description at .*other\.yaml"):
        find_robot("other.yaml", tmp_path)


def test_an_unknown_robot_names_those_there_are() -> None:
    with pytest.raises(LookupError, match=r"no robot called 'brus'; there is .*bruce"):
        find_robot("brus")


def test_another_profile_in_use() -> None:
    robot = find_robot("bruce")
    assert robot.motors.profile == "koala"
    relaxed = robot.with_profile("relaxed")
    assert relaxed.motors.peak_torque.tolist() == [21.0] * 10
    assert robot.motors.peak_torque.tolist() == [10.5] * 10
    assert robot.with_profile("koala") is robot
    with pytest.raises(LookupError, match="bruce has no actuator profile 'zebra'; there is koala,"):
        robot.with_profile("zebra")


def test_motors_that_differ() -> None:
    robot = find_robot("bruce")
    profile = robot.profiles["koala"].model_copy(
        update={"motors": {"*_knee_motor": MotorRating(peak_torque=20.0)}}
    )
    motors = robot.changed(profiles={"koala": profile}).motors
    assert motors.peak_torque.tolist() == [10.5, 10.5, 10.5, 20.0, 10.5] * 2
    assert motors.rotor_inertia.tolist() == [0.00182] * 10


def test_what_came_later_changes_no_content() -> None:
    # plans are kept by the content of their robot
    data = find_robot("bruce").model_dump(mode="json")
    assert not {"base_joint", "profile", "sensors", "held"} & set(data)
    assert "kind" not in data["joints"][0] and "motors" not in data["profiles"]["koala"]
    assert RobotDescription.model_validate(data) == find_robot("bruce")
