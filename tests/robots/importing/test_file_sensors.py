"""The sensors of files: what `aloft robot import` writes of them, and what the robot measures there."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from aloft.hal.sensors.imu import Imu
from aloft.hal.sensors.sensor import SensorError
from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.mathematics.rotations import matrices_of_quaternions
from aloft.robots.description import find_robot, read
from aloft.robots.importing.new_yaml import new_yaml
from aloft.robots.importing.read_model import read_model
from aloft.robots.robot_description import SensorMount
from aloft.tests.robots.importing.model_files import ONE_LEG

SITES = ONE_LEG.replace(
    '<body name="foot"',
    '<site name="shank imu" pos="0.01 0 -0.2" euler="0 0 90"/><body name="foot"',
).replace(
    "<actuator>",
    '<sensor><gyro site="shank imu" noise="0.02"/><accelerometer site="shank imu"/><touch site="shank imu"/></sensor>'
    "<actuator>",
)
FORCES = (
    ONE_LEG.replace(
        '<geom type="sphere" size=".035" mass="0.1"/>',
        '<site name="sole" pos="0 0 -0.02"/><geom type="sphere" size=".035" mass="0.1"/>',
    )
    .replace('<body name="shank"', '<site name="wrist" pos="0 0 0"/><body name="shank"')
    .replace(
        "<actuator>",
        '<sensor><force site="sole"/><torque site="sole"/><touch site="sole"/><force site="wrist"/>'
        '<rangefinder name="eye" site="sole"/><subtreecom name="middle" body="torso"/>'
        '<jointpos joint="knee"/></sensor><actuator>',
    )
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
  <gazebo reference="plate"><sensor name="imu" type="imu"><pose>0 0.02 0 3.14159265 0 1.57079633</pose></sensor></gazebo>
  <gazebo reference="base"><sensor name="head" type="camera"/></gazebo>
  <gazebo reference="lost"><sensor name="ghost" type="imu"/></gazebo>
</robot>
"""


def imported(folder: Path, name: str, text: str) -> tuple[str, Path]:
    path = folder / name
    path.write_text(text)
    target = folder / "robot.yaml"
    written = new_yaml(path, target).text
    target.write_text(written)
    return written, target


def test_a_site_with_a_gyroscope_is_one_imu_turned_as_in_the_file(tmp_path: Path) -> None:
    text, target = imported(tmp_path, "leg.xml", SITES)
    assert "  shank_imu: {kind: imu, link: shank, position: [" in text
    assert text.count("kind: imu") == 1
    sensor = read(target).description.sensors.mounted["shank_imu"]
    raw = read_model(tmp_path / "leg.xml")
    body = raw.bodies["shank"]  # links are parallel to the base, bodies of the file are not
    assert sensor.position == pytest.approx(body.rotation @ np.array([0.01, 0.0, -0.2]), abs=1e-9)
    assert sensor.model_extra == {"noise": {"angular_velocity": {"noise": 0.02}}}


def test_an_imu_measures_what_it_does_in_the_file(tmp_path: Path) -> None:
    _, target = imported(tmp_path, "leg.xml", SITES)
    theirs = mujoco.MjModel.from_xml_string(SITES)
    ours = build_mujoco_model(find_robot(str(target)))
    random, readings = np.random.default_rng(0), []
    position, velocity = random.normal(size=2), random.normal(size=8)
    for model in (theirs, ours):
        data = mujoco.MjData(model)
        model.opt.gravity[:] = (0.0, 0.0, -9.81)
        data.qpos[2], data.qpos[-2:], data.qvel[:] = 5.0, position, velocity
        mujoco.mj_forward(model, data)
        kinds = [int(kind) for kind in model.sensor_type]
        adr = model.sensor_adr[kinds.index(int(mujoco.mjtSensor.mjSENS_GYRO))]
        readings.append(data.sensordata[adr : adr + 3].copy())
    assert np.linalg.norm(readings[0]) > 0.5
    np.testing.assert_allclose(readings[1], readings[0], atol=1e-6)


def test_what_a_urdf_says_to_gazebo_is_read(tmp_path: Path) -> None:
    text, target = imported(tmp_path, "torso.urdf", GAZEBO)
    sensors = read(target).description.sensors
    assert list(sensors.mounted) == ["imu_sensor"]  # `imu` is the one at the base's origin
    sensor = sensors.mounted["imu_sensor"]
    assert sensor.link == "base"
    assert sensor.position == pytest.approx([0.1, 0.02, 0.05])
    # yaw of a quarter turn, after roll by half a turn
    turn = matrices_of_quaternions(np.array(sensor.orientation))
    np.testing.assert_allclose(turn, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-4)
    assert "left out: sensors camera (head)" in text


def test_a_force_sensor_under_a_foot_is_one_and_others_are_named(tmp_path: Path) -> None:
    text, target = imported(tmp_path, "leg.xml", FORCES)
    mounted = read(target).description.sensors.mounted
    assert list(mounted) == ["sole"] and mounted["sole"].kind == "force_torque"
    assert mounted["sole"].link == "shank"  # to which the foot is fixed
    assert "  # and this link is no foot's: wrist: {kind: force_torque, link: leg" in text
    assert "left out: sensors rangefinder (eye), subtreecom (middle)" in text


@pytest.mark.parametrize("wrong", [[0.0, 0.0, 0.0, 0.0], [float("inf"), 0.0, 0.0, 1.0]])
def test_an_orientation_that_is_none_is_reported(wrong: list[float]) -> None:
    part = SensorMount.model_validate({"kind": "imu", "link": "base", "orientation": wrong})
    with pytest.raises(SensorError, match="orientation is a quaternion"):
        Imu("head", part)
