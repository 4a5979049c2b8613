"""Xacro files: expanded with their includes and packages, and what is said where that fails."""

import sys
from pathlib import Path

import pytest

from aloft.robots.description import RobotError, read

from ...needed import needs

needs("xacro")

MACROS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="mass" value="${2 * 0.75}"/>
  <xacro:macro name="bar" params="name">
    <link name="${name}">
      <inertial>
        <mass value="${mass}"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/>
      </inertial>
    </link>
  </xacro:macro>
</robot>
"""
ARM = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:include filename="$(find bars)/macros.xacro"/>
  <xacro:arg name="reach" default="0.4"/>
  <link name="world"/>
  <xacro:bar name="upper"/>
  <xacro:bar name="lower"/>
  <joint name="shoulder" type="revolute">
    <parent link="world"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="20" velocity="5"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/><origin xyz="0 0 $(arg reach)"/>
    <limit lower="-1" upper="2" effort="10" velocity="6"/>
  </joint>
</robot>
"""


def write(folder: Path, text: str = ARM) -> Path:
    (folder / "bars").mkdir()
    (folder / "bars" / "macros.xacro").write_text(MACROS)
    path = folder / "arm.urdf.xacro"
    path.write_text(text)
    return path


def test_macros_arguments_and_packages_are_expanded(tmp_path: Path) -> None:
    robot = read(write(tmp_path)).description
    assert [joint.name for joint in robot.joints] == ["shoulder", "elbow"]
    assert robot.total_mass == pytest.approx(3.0)
    assert robot.joints[1].origin[2] == pytest.approx(0.4)
    assert robot.motors.peak_torque == pytest.approx([20.0, 10.0])


def report(path: Path) -> str:
    with pytest.raises(RobotError) as error:
        read(path)
    return str(error.value).replace(str(path), path.name)


def test_a_package_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, ARM.replace("$(find bars)", "$(find bards)"))
    assert report(path).splitlines()[:2] == [
        "arm.urdf.xacro: there is no package bards, which the file looks for",
        "    expected   a folder bards above or beside the file, or a Python package that brings it",
    ]


def test_what_xacro_cannot_expand_is_said_in_its_words(tmp_path: Path) -> None:
    said = report(write(tmp_path, ARM.replace("$(arg reach)", "${1 / 0}")))
    assert "arm.urdf.xacro: xacro cannot expand this: " in said and "zero" in said


def test_without_the_library_the_error_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)
    assert report(write(tmp_path)).splitlines()[:3] == [
        "arm.urdf.xacro: xacro files need the library xacro",
        "    expected   a URDF, MJCF or YAML file, or the library",
        "    fix        pip install 'xacro>=2.1'",
    ]
