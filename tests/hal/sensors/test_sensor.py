"""What a robot's description mounts is an output of the robot, in the simulator and on the twin's bus."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.hal.bear.configuration import Hardware, HardwareError
from aloft.hal.sensors.imu import Imu
from aloft.hal.sensors.sensor import SensorError, mounted_sensors
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.twin.twin_robot import TwinRobot
from aloft.robots.description import RobotError
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped
from .mounting import bruce_with, hold, write_bruce_with

FOOT_IMU: dict[str, Any] = {
    "kind": "imu", "link": "right_foot", "position": [0.01, 0.0, 0.0],
    "noise": {"angular_velocity": {"noise": 0.01, "delay": 0.004}, "specific_force": {"bias": 0.2}},
}  # fmt: skip
QUIET = {**FOOT_IMU, "noise": {}}


def bench(kind: type[Any], sensor: Any = FOOT_IMU, **options: Any) -> BlockBench[Any]:
    return BlockBench(kind, {"seed": 3}, robot=bruce_with(foot_imu=sensor), **options)


def test_outputs_follow_from_the_description() -> None:
    robot = bench(MujocoRobot)
    assert list(robot.block.outputs) == [*MujocoRobot.outputs, "foot_imu"]
    assert type(robot.block).__name__ == "MujocoRobot" and isinstance(robot.block, MujocoRobot)
    plain = BlockBench(MujocoRobot, robot="bruce")
    assert type(plain.block) is MujocoRobot and "sensor_memory" not in plain.block.states


def test_a_mounted_imu_reads_what_the_foot_feels() -> None:
    robot = bench(MujocoRobot, QUIET)
    hold(robot)
    robot.step(50)
    np.testing.assert_allclose(robot.get("foot_imu").specific_force, [0, 0, 9.81], atol=0.05)
    np.testing.assert_allclose(robot.get("foot_imu").angular_velocity, 0.0, atol=0.02)


def test_declared_errors_and_the_factor_on_them() -> None:
    robot = bench(MujocoRobot)
    hold(robot)
    found = []
    for _ in range(500):
        robot.step()
        found.append(np.concatenate([view.copy() for _, view in robot.get("foot_imu")]))
    rates, forces = np.array(found)[100:, :3], np.array(found)[100:, 3:]
    np.testing.assert_allclose(rates.std(axis=0), 0.01, rtol=0.15)
    bias = robot.block.plant.sensors.mounted[0].bias("specific_force")
    assert 0.02 < np.abs(bias).max() <= 0.2
    np.testing.assert_allclose(forces.mean(axis=0) - bias, [0, 0, 9.81], atol=0.01)
    ideal = BlockBench(
        MujocoRobot, {"sensors": {"sensor_errors": 0.0}}, robot=bruce_with(foot_imu=FOOT_IMU)
    )
    assert not ideal.block.plant.sensors.mounted[0].bias("specific_force").any()


@pytest.mark.long
@pytest.mark.parametrize("kind", [MujocoRobot, TwinRobot])
def test_machine_code_and_snapshots_give_the_same_bytes(kind: type[Any]) -> None:
    gains = (300.0, 1.5) if kind is MujocoRobot else (3.5, 0.1)
    one, other = bench(kind), bench(kind, plain=True)
    for robot in (one, other):
        hold(robot, *gains)
        robot.step(7)
    assert one.get("foot_imu").angular_velocity.tolist() == (
        other.get("foot_imu").angular_velocity.tolist()
    )
    snapshot = one.snapshot()
    one.step(6)
    expected = [view.tolist() for _, view in one.get("foot_imu")]
    one.restore(snapshot)
    one.step(6)
    assert [view.tolist() for _, view in one.get("foot_imu")] == expected


def test_other_sensors_read_the_same_beside_it() -> None:
    noise = {"gyro_noise": 0.02, "joint_velocity_noise": 0.05, "encoder_offset": 0.003, "seed": 2}
    with_it = BlockBench(MujocoRobot, grouped(noise), robot=bruce_with(foot_imu=FOOT_IMU))
    without = BlockBench(MujocoRobot, grouped(noise), robot="bruce")
    for robot in (with_it, without):
        hold(robot)
        robot.step(20)
    for port in ("imu", "joints", "contacts", "truth"):
        for name, view in without.get(port):
            np.testing.assert_array_equal(getattr(with_it.get(port), name), view)


def test_packets_carry_float32_and_the_twin_reads_them() -> None:
    imu = mounted_sensors(bruce_with(foot_imu=FOOT_IMU))[0]
    values, read = Imu.signal.allocate(), Imu.signal.allocate()
    values.specific_force[:], values.angular_velocity[:] = [1.5, -2.0, 9.81], [0.1, 0.2, -0.3]
    data = imu.to_packet(values)
    assert len(data) == imu.packet_size() == 24
    imu.from_packet(data, read)
    np.testing.assert_allclose(read.specific_force, values.specific_force, rtol=1e-7)
    np.testing.assert_allclose(read.angular_velocity, values.angular_velocity, rtol=1e-7)
    twin = bench(TwinRobot, QUIET)
    hold(twin, 3.5, 0.1)
    twin.step(2)
    reading = twin.get("foot_imu").specific_force
    assert (reading != 0.0).any()
    assert twin.block.driver.board.samples["foot_imu"].angular_velocity.astype(
        np.float32
    ).tolist() == (twin.block.driver.board.samples["foot_imu"].angular_velocity.tolist())


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            {"kind": "imv"},
            "sensor foot_imu: there is no kind of sensor 'imv': .*; did you mean imu?",
        ),
        ({"kind": "math:pi"}, "sensor foot_imu: math:pi is no MountedSensor"),
        ({"link": "right_fot"}, "bruce has no link 'right_fot'; did you mean right_foot?"),
        ({"noise": {"rate": {}}}, "noise of 'rate'; imu has the fields angular_velocity, "),
        (
            {"noise": {"specific_force": {"noise": -1}}},
            "noise.specific_force.noise: expected at least 0",
        ),
        (
            {"nose": {}},
            "sensor foot_imu: nose: is not known; the nearest is noise; imu has kind, link, position, orientation, noise",
        ),
    ],
)
def test_a_wrong_sensor_is_named(change: Any, text: str) -> None:
    with pytest.raises(SensorError, match=text):
        mounted_sensors(bruce_with(foot_imu={**FOOT_IMU, **change}))


def test_a_wrong_sensor_is_in_the_load_report(tmp_path: Path) -> None:
    write_bruce_with(tmp_path, foot_imu={**FOOT_IMU, "link": "tail"})
    graph = tmp_path / "graph.yaml"
    graph.write_text(
        "rate: 500 Hz\nrobot: sensing.yaml\nblocks:\n"
        "  robot: {use: hal.MujocoRobot, in: {command: {value: {mode: 2}}}}\n"
    )
    with pytest.raises(aloft.LoadError, match="robot: sensor foot_imu: bruce has no link 'tail'"):
        aloft.load(graph)


def test_an_output_cannot_have_a_name_that_a_robot_uses() -> None:
    with pytest.raises(aloft.BlockError, match="the output of a robot cannot be called 'read'"):
        BlockBench(MujocoRobot, robot=bruce_with(read=FOOT_IMU))


def test_a_misspelt_key_of_the_sensors_is_a_fault() -> None:
    with pytest.raises(RobotError, match="no key 'imuu'"):
        bruce_with(imuu=True)  # type: ignore[arg-type]


def test_the_file_of_the_hardware_names_what_its_board_carries(tmp_path: Path) -> None:
    robot = bruce_with(foot_imu=FOOT_IMU)
    assert [each.name for each in Hardware.for_twin(robot).board.mounted(robot)] == ["foot_imu"]
    text = (Path(aloft.__file__).parent / "graphs/hardware/bruce.yaml").read_text()
    file = tmp_path / "hardware.yaml"
    file.write_text(text.replace("board:\n", "board:\n  sensors: [foot]\n"))
    with pytest.raises(HardwareError, match="bruce mounts no sensor 'foot': foot_imu"):
        Hardware.read(file, robot)


def test_a_sensor_that_names_no_fields_for_its_packet_sends_all() -> None:
    sole = {"kind": "force_torque", "link": "left_foot", "position": [0.0, 0.0, -0.02]}
    (sensor,) = mounted_sensors(bruce_with(sole=sole))
    data = sensor.to_packet(sensor.signal.allocate())
    assert len(data) == sensor.packet_size() == 24
