"""The robot's description: validation, derived figures, finding one by name, and the places in its file."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from aloft.robots.description import (
    LocatedYaml,
    MotorRating,
    RobotDescription,
    find_robot,
    read_description,
)
from aloft.robots.validation import DescriptionError, RobotError

from .validation.wrong_robots import hopper


def test_derived_figures() -> None:
    robot = RobotDescription.model_validate(hopper())
    assert robot.dimensions == {
        "n_joints": 2,
        "n_velocities": 8,
        "n_contacts": 1,
        "n_feet": 1,
        "n_thrusters": 0,
    }
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
    (tmp_path / "hoppers").mkdir()
    (tmp_path / "hopper.yaml").rename(tmp_path / "hoppers" / "hopper.yaml")
    read = read_description(tmp_path / "hoppers" / "hopper.yaml")
    assert find_robot("package://hoppers/hopper.yaml", tmp_path) == read
    with pytest.raises(LookupError, match=r"no robot description at package://hoppers/other\.yaml"):
        find_robot("package://hoppers/other.yaml", tmp_path)


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
    assert "supply" not in data and "gear_play" not in data["profiles"]["koala"]
    whole = find_robot("bruce").content()
    assert whole["supply"]["rated_voltage"] == 14.8
    assert RobotDescription.model_validate(whole) == find_robot("bruce").changed(looks={})


TEXT = """\
# a robot
name: hopper
links:
  - {name: body, mass: 2.0}
  - name: foot
    mass: 0.5
"""


def read(folder: Path, text: str) -> LocatedYaml:
    (folder / "robot.yaml").write_text(text)
    return LocatedYaml.read(folder / "robot.yaml")


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ((), (2, 1)), (("name",), (2, 7)), (("links",), (4, 3)), (("links", 0), (4, 5)),
        (("links", 0, "mass"), (4, 24)), (("links", 1, "mass"), (6, 11)), (("links", 1), (5, 5)),
        (("links", 2), (4, 3)), (("links", 1, "com"), (5, 5)), (("joints",), (0, 0)),
        (("name", "first"), (2, 7)),
    ],
)  # fmt: skip
def test_the_place_of_a_value_or_of_what_holds_it(
    tmp_path: Path, path: tuple[str | int, ...], place: tuple[int, int]
) -> None:
    placed = read(tmp_path, TEXT)
    assert placed.place(path) == place
    found = placed.placed(DescriptionError(path, "wrong"))
    assert (found.line, found.column) == (place if place[0] else (2, 1))
    said = DescriptionError(path, "wrong", line=9, column=3)
    assert placed.placed(said) is said


def test_what_a_file_holds(tmp_path: Path) -> None:
    placed = read(tmp_path, TEXT)
    assert placed.holds(()) and placed.holds(("links", 1, "mass"))
    for path in (("links", 2), ("joints",), ("name", "x"), ("links", "a")):
        assert not placed.holds(path)
    empty = read(tmp_path, "")
    assert empty.data is None and empty.place(()) == (0, 0)
    fault = empty.placed(DescriptionError((), "nothing"))
    assert (fault.line, fault.column) == (0, 0)


def test_keys_that_stand_twice_are_faults_of_the_second(tmp_path: Path) -> None:
    placed = read(tmp_path, "name: a\nlinks:\n  - {mass: 1, mass: 2}\nname: b\n")
    assert [(fault.line, fault.column) for fault in placed.errors] == [(3, 15), (4, 1)]
    assert read(tmp_path, TEXT).errors == ()


def test_what_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(RobotError) as caught:
        read(tmp_path, "name: [1, 2\nlinks: {\n")
    (fault,) = caught.value.errors
    assert fault.message.startswith("this is no YAML: ") and fault.fix
    assert fault.line >= 2 and fault.column >= 1
    (tmp_path / "bytes.yaml").write_bytes(b"name: \xff\xfe")
    with pytest.raises(RobotError, match="is not UTF-8 text") as caught:
        LocatedYaml.read(tmp_path / "bytes.yaml")
    assert caught.value.errors[0].found.startswith("byte 0xff")
    with pytest.raises(RobotError, match=r"cannot read .*: No such file"):
        LocatedYaml.read(tmp_path / "nowhere.yaml")


def test_held_joints_that_are_freed() -> None:
    robot = find_robot("bruce").changed(held={"left_knee": -0.3, "right_knee": -0.4})
    freed = robot.freed(["left_*", "right_hip_yaw"])
    assert dict(freed.held) == {"right_knee": -0.4}
    assert freed.standing["left_knee"] == -0.3, "it stands as it was held"
    assert (freed.standing_position == robot.changed(
        standing={**robot.standing, "left_knee": -0.3}).standing_position).all()  # fmt: skip
    assert freed.freed(["left_*"]) is freed and robot.freed([]) is robot
    with pytest.raises(LookupError, match="bruce has no joint 'left_elbow'; it holds left_knee, "):
        robot.freed(["left_elbow"])
