"""An import is compared with MuJoCo's and Pinocchio's own readings of the file: both numbers are told where they differ."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aloft.robots.comparison.compare import compare_with_file
from aloft.robots.comparison.differences import Differences
from aloft.robots.description import RobotError, read
from aloft.robots.importing.description_data import import_robot

from ..importing.model_files import ARM, CART_POLE, DRONE, ONE_LEG, PLANAR, SPHERICAL_HIP


def imported(folder: Path, content: str) -> Any:
    path = folder / ("robot.urdf" if "<robot" in content else "robot.xml")
    path.write_text(content)
    return import_robot(path, {})


@pytest.mark.parametrize("content", [ARM, CART_POLE, DRONE, ONE_LEG, PLANAR])
def test_both_read_what_is_imported(content: str, tmp_path: Path) -> None:
    found = imported(tmp_path, content).compared()
    assert [each.judge for each in found] == ["MuJoCo", "Pinocchio"][: 1 + ("<robot" in content)]
    for each in found:
        assert each.compared >= 9 and each.largest < 1e-9 and not each.errors and not each.why


def test_what_differs_on_purpose_is_named(tmp_path: Path) -> None:
    (hip,) = imported(tmp_path, SPHERICAL_HIP).compared()
    assert [*hip.named] == [
        "a body with several joints is several links, all but one of a millionth of its mass"
    ]
    assert 1e-9 < hip.largest < 1e-5
    free = ARM.replace('  <link name="world"/>\n', "")
    free = free[: free.index('  <joint name="mount"')] + free[free.index('  <link name="upper"') :]
    mujoco, pinocchio = imported(tmp_path, free).compared()
    assert [*mujoco.named] == ["the base floats, which MuJoCo bolts to the world"]
    assert not pinocchio.named and pinocchio.largest < 1e-9


@pytest.mark.parametrize(("part", "key", "value", "said"), [
    ("links", "mass", 2.5, "mass of link lower"), ("links", "com", [0.0, 0.0, 0.21], "first moment of mass of link lower"),
    ("links", "inertia", [0.01, 0.01, 0.02, 0.0, 0.0, 0.0], "inertia of link lower"),
    ("joints", "axis", [0.0, 1.0, 0.0], "axis of joint elbow"), ("joints", "origin", [0.0, 0.0, 0.41], "anchor of joint elbow"),
    ("joints", "limits", [-2.0, 2.1], "range of joint elbow"),
])  # fmt: skip
def test_a_difference_is_an_error_with_both_numbers(
    part: str, key: str, value: Any, said: str, tmp_path: Path
) -> None:
    made = imported(tmp_path, ARM)
    built = made.unchanged
    changed = [{**each} for each in getattr(built, part)]
    changed[-1][key] = value
    found = compare_with_file(made.model, replace(built, **{part: changed}))
    errors = [error for each in found for error in each.errors]
    assert any(error.message.startswith(f"the {said}") for error in errors)
    assert all(error.expected and error.found and "as in " in error.expected for error in errors)


@pytest.mark.parametrize(("key", "value", "said"), [
    ("effort", 21.0, "effort limit of joint elbow"), ("speed", 6.0, "velocity limit of joint elbow"),
    ("damping", 0.2, "damping of joint elbow"), ("friction", 0.3, "friction loss of joint elbow"),
    ("rotor_inertia", 0.1, "mass matrix at a random state"),
])  # fmt: skip
def test_properties_of_joints_are_compared(
    key: str, value: float, said: str, tmp_path: Path
) -> None:
    made = imported(tmp_path, ARM)
    joints = {**made.unchanged.raw_joints}
    joints["elbow"] = replace(joints["elbow"], **{key: value})
    found = compare_with_file(made.model, replace(made.unchanged, raw_joints=joints))
    assert any(e.message.startswith(f"the {said}") for each in found for e in each.errors)


def test_the_torque_of_actuators_is_found_by_asking_mujoco(tmp_path: Path) -> None:
    made = imported(tmp_path, ONE_LEG)
    joints = {**made.unchanged.raw_joints}
    joints["knee"] = replace(joints["knee"], effort=39.0)
    (found,) = compare_with_file(made.model, replace(made.unchanged, raw_joints=joints))
    (error,) = found.errors
    assert (
        error.message
        == "the torque limit of joint knee is another one than in MuJoCo's reading of the file"
    )
    assert (error.expected, error.found) == ("40 as in MuJoCo", "39")


def test_a_difference_refuses_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from aloft.robots.importing import description_data

    def differ(*_: Any) -> list[Differences]:
        found = Differences("MuJoCo")
        found.compare("mass of link thigh [kg]", 5.4, 2.075)
        return [found]

    monkeypatch.setattr(description_data, "compare_with_file", differ)
    (tmp_path / "robot.urdf").write_text(ARM)
    with pytest.raises(RobotError, match="mass of link thigh") as refused:
        read(tmp_path / "robot.urdf")
    lines = [line.split() for line in str(refused.value).splitlines()]
    assert ["expected", "2.075", "as", "in", "MuJoCo"] in lines and ["found", "5.4"] in lines


def test_what_the_yaml_changes_is_wanted(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(ARM)
    (tmp_path / "robot.yaml").write_text(
        "links: {lower: {mass: 3}}\njoints: {elbow: {limits: [-1, 1]}}\n"
    )
    found = read(tmp_path / "robot.urdf")
    assert found.description.link("lower").mass == 3.0
    assert [each.judge for each in found.compared] == ["MuJoCo", "Pinocchio"]


def test_a_body_that_mujoco_refuses_counts_as_it_is_written(tmp_path: Path) -> None:
    inertia = '<inertia ixx="3e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/>'
    plate = f'<link name="plate"><inertial><mass value="0.01"/>{inertia}</inertial></link>'
    joint = '<joint name="screw" type="fixed"><parent link="lower"/><child link="plate"/></joint></robot>'
    impossible = ARM.replace("</robot>", plate + joint)
    (tmp_path / "robot.urdf").write_text(impossible)
    mujoco = read(tmp_path / "robot.urdf").compared[0]
    assert "MuJoCo refuses a body of the file, whose written numbers count" in mujoco.named
    assert not mujoco.why and mujoco.largest < 1e-9


def test_a_joint_without_a_limit_is_compared_and_nothing_is_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    limit = '<limit lower="-2" upper="2" effort="20" velocity="5"/>'
    assert ARM.count(limit) == 1
    made = imported(tmp_path, ARM.replace(limit, ""))
    mujoco, pinocchio = made.compared()
    assert not pinocchio.why and pinocchio.compared >= 9
    kinds = ["a joint of a URDF without lower and upper limit turns freely"]
    assert [*pinocchio.named] == kinds and not mujoco.named
    assert any("has no lower and upper limit in the URDF" in note for note in made.notes)
    assert capfd.readouterr().err == ""
