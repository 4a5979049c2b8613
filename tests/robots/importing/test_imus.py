"""Where files have inertial measurement units: what `aloft robot import` writes of them, and what the robot measures there."""

from pathlib import Path

import numpy as np
import pytest

from aloft.robots.description import read
from aloft.robots.importing.new_yaml import new_yaml
from aloft.robots.importing.read_model import read_model
from aloft.tests.robots.importing.model_files import ONE_LEG

SITES = ONE_LEG.replace(
    '<body name="foot"',
    '<site name="shank imu" pos="0.01 0 -0.2" euler="0 0 90"/><body name="foot"',
).replace(
    "<actuator>",
    '<sensor><gyro site="shank imu"/><accelerometer site="shank imu"/><touch site="shank imu"/></sensor>'
    "<actuator>",
)
INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial>'
)
GAZEBO = f"""<robot name="torso">
  <link name="base">{INERTIAL}</link>
  <link name="plate"/>
  <joint name="mount" type="fixed">
    <parent link="base"/><child link="plate"/><origin xyz="0.1 0 0.05"/>
  </joint>
  <gazebo reference="plate"><sensor name="imu" type="imu"><pose>0 0.02 0 0 0 0</pose></sensor></gazebo>
  <gazebo reference="base"><sensor name="head" type="camera"/></gazebo>
  <gazebo reference="lost"><sensor name="ghost" type="imu"/></gazebo>
</robot>
"""


def imported(folder: Path, name: str, text: str) -> tuple[str, Path]:
    path = folder / name
    path.write_text(text)
    target = folder / "robot.yaml"
    written, _ = new_yaml(path, target)
    target.write_text(written)
    return written, target


def test_a_site_with_a_gyroscope_is_one_imu(tmp_path: Path) -> None:
    text, target = imported(tmp_path, "leg.xml", SITES)
    assert "  shank_imu: {kind: imu, link: shank, position: [" in text
    assert text.count("kind: imu") == 1 and "# turned in the file" in text
    sensor = read(target).description.sensors.mounted["shank_imu"]
    raw = read_model(tmp_path / "leg.xml")
    body = raw.bodies["shank"]  # links are parallel to the base, bodies of the file are not
    assert sensor.position == pytest.approx(body.rotation @ np.array([0.01, 0.0, -0.2]), abs=1e-9)


def test_what_a_urdf_says_to_gazebo_is_read(tmp_path: Path) -> None:
    text, target = imported(tmp_path, "torso.urdf", GAZEBO)
    sensors = read(target).description.sensors
    assert list(sensors.mounted) == ["imu_sensor"]  # `imu` is the one at the base's origin
    assert sensors.mounted["imu_sensor"].link == "base"
    assert sensors.mounted["imu_sensor"].position == pytest.approx([0.1, 0.02, 0.05])
    assert "turned in the file" not in text
