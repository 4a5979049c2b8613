"""The twin in a graph: the driver's view of a robot that stands, and what it refuses."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aloft.blocks.signals import CommandMode, DrivePhase
from aloft.hal.twin.twin_robot import TwinRobot
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped

ROBOT = find_robot("bruce")
WEIGHT = ROBOT.total_mass * 9.81


def bench(folder: Path | None = None, **params: Any) -> BlockBench[TwinRobot]:
    return BlockBench(TwinRobot, grouped(params), robot="bruce", folder=folder)


def hold(robot: BlockBench[TwinRobot], stiffness: float = 150.0) -> None:
    """Command the joints to stay in the standing pose; a feedforward lets the gantry go."""
    robot.set(
        "command", mode=CommandMode.ACTIVE, torque=0.01, position=ROBOT.standing_position,
        velocity=0.0, stiffness=stiffness, damping=2.0,
    )  # fmt: skip


def test_it_stands_by_itself_when_it_is_commanded_to() -> None:
    robot = bench()
    hold(robot)
    robot.step(300)
    assert robot.block.twin.released
    joints, truth = robot.get("joints"), robot.get("truth")
    np.testing.assert_allclose(joints.position, truth.joint_position, atol=1e-6)
    np.testing.assert_allclose(joints.position, ROBOT.standing_position, atol=0.05)
    assert truth.contact_force[:, 2].sum() == pytest.approx(WEIGHT, rel=0.05)
    assert robot.get("imu").specific_force[2] == pytest.approx(9.81, abs=0.2)
    assert robot.get("contacts").closed.all()
    health = robot.get("health")
    assert health.state == DrivePhase.DRIVING
    assert set(health.voltage.tolist()) == {float(np.float32(14.8))}
    assert set(health.condition.tolist()) == {0x80}
    assert health.joints_valid and health.imu_valid and health.contacts_valid
    assert not health.age.any() and health.imu_age == 0.0


def test_it_does_not_wait_for_warm_windings_when_it_closes(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = bench(windings={"temperature": 60.0, "ambient": 45.0, "copper": 0.0039})
    hold(robot)
    robot.step(5)
    driver = robot.block.driver
    assert driver is not None and driver.cooling == 5
    assert driver.loop.measured.temperature.max() > driver.hardware.board.cooled
    monkeypatch.setattr(time, "sleep", lambda seconds: pytest.fail("it waited in real time"))
    robot.block.close()
    assert driver.cooling == 0 and robot.block.twin.board.cooling == 0
    assert robot.block.waits_for_others, "where closing takes its time, that is no hang"


@pytest.mark.long
def test_the_measured_torque_is_what_the_motors_give() -> None:
    robot = bench()
    hold(robot)
    robot.step(200)
    # the knees carry the robot: about its weight on each leg times the lever of the knee
    torque = robot.get("joints").torque
    assert torque[3] == pytest.approx(torque[8], rel=0.2) and torque[3] > 0.5


def test_until_the_first_command_the_gantry_holds_it() -> None:
    robot = bench()
    robot.set("command", mode=CommandMode.OFF)
    robot.step(50)
    assert not robot.block.twin.released
    assert robot.get("health").state == DrivePhase.DRIVING
    np.testing.assert_allclose(robot.get("joints").position, ROBOT.standing_position, atol=0.02)


def test_unarmed_the_drives_are_only_watched() -> None:
    robot = bench(armed=False)
    hold(robot)
    robot.step(50)
    twin = robot.block.twin
    assert {actuator.status["torque_enable"] for actuator in twin.actuators} == {0.0}
    assert {actuator.config["mode"] for actuator in twin.actuators} == {0.0}, "nothing was written"
    assert robot.get("health").state == DrivePhase.OFF and not twin.released
    assert robot.get("imu").specific_force[2] > 9.0
    robot.block.stop_cycle()
    assert {actuator.status["torque_enable"] for actuator in twin.actuators} == {0.0}


def test_it_ends_in_damping() -> None:
    robot = bench()
    hold(robot)
    robot.step(20)
    for _ in range(5):
        robot.block.stop_cycle()
    actuators = robot.block.twin.actuators
    assert {actuator.status["torque_enable"] for actuator in actuators} == {3}
    robot.block.stop_cycle()
    assert (robot.block.twin.drives.damped == 1.0).all()
    assert not robot.block.twin.drives.enabled.any()


def test_a_command_to_damp_damps() -> None:
    robot = bench()
    hold(robot)
    robot.step(5)
    robot.set("command", mode=CommandMode.DAMPING)
    robot.step(2)
    assert robot.get("health").state == DrivePhase.DAMPED
    hold(robot)
    robot.step(2)
    assert robot.get("health").state == DrivePhase.DAMPED, "for good"
    assert robot.block.metrics()["drives_at_end"] == "damped"
    assert "success" not in robot.block.metrics()


def write_hardware(folder: Path, board: dict[str, Any] | None = None, **motor: Any) -> str:
    names, whole = ROBOT.transmission.motors, {"offset": 0.0, "low": -25.0, "high": 25.0}
    settings = {
        "robot": "bruce", "bus": {"port": "twin"}, "board": {"port": "twin", **(board or {})},
        "motors": {name: {"id": 30 + k, **whole, **motor} for k, name in enumerate(names)},
        "soft_start": {"duration": 0.3},
    }  # fmt: skip
    (folder / "bench.yaml").write_text(yaml.safe_dump(settings))
    return "bench.yaml"


@pytest.mark.long
def test_addresses_directions_and_offsets_do_not_show(tmp_path: Path) -> None:
    plain, turned = bench(), bench(tmp_path, hardware=write_hardware(tmp_path, sign=-1, offset=0.5))
    for robot in (plain, turned):
        hold(robot)
        robot.step(30)
    raw = [a.status["present_position"] for a in plain.block.twin.actuators]
    other = [a.status["present_position"] for a in turned.block.twin.actuators]
    np.testing.assert_allclose(other, [-(position + 0.5) for position in raw], atol=1e-3)
    for name in ("position", "velocity", "torque"):
        first, second = (getattr(robot.get("joints"), name) for robot in (plain, turned))
        np.testing.assert_allclose(first, second, atol=2e-2)


@pytest.mark.long
def test_a_turned_imu_inverted_switches_and_other_motors_do_not_show(tmp_path: Path) -> None:
    board = {"imu_rotation": [0.3, -1.2, 0.7], "normally_closed": ["left_toe"]}
    file = write_hardware(tmp_path, board, torque_constant=0.5)
    plain, other = bench(), bench(tmp_path, hardware=file)
    for robot in (plain, other):
        hold(robot)
        robot.step(30)
    assert other.block.driver.board.specific_force[2] < 8.0, "the board itself is turned"
    for port, name in (
        ("imu", "specific_force"), ("imu", "angular_velocity"), ("contacts", "closed"), ("joints", "torque")
    ):  # fmt: skip
        first, second = (getattr(robot.get(port), name) for robot in (plain, other))
        np.testing.assert_allclose(np.asarray(first, float), np.asarray(second, float), atol=2e-2)


def test_gains_that_no_drives_can_give_are_refused() -> None:
    with pytest.raises(BlockError) as caught:
        bench(stiffness={"*": 60.0, "*_ankle": 15.0})
    assert str(caught.value) == (
        "TwinRobot: no motor gains give bruce's joints this stiffness, because motors share joints; "
        "with the nearest ones right_knee and right_ankle are coupled by 10 N m/rad, right_ankle "
        "has 10 instead of 15 N m/rad, left_knee and left_ankle are coupled by 10 N m/rad, "
        "left_ankle has 10 instead of 15 N m/rad"
    )
    assert bench(stiffness={"*": 60.0, "*_ankle": 15.0}, gains="nearest").block.driver is not None
    assert bench(stiffness={"*": 60.0, "*_ankle": 0.0}, damping=0.0).block.driver is not None


def test_periods_must_divide() -> None:
    with pytest.raises(BlockError, match=r"timestep 0\.0003 s does not divide 0\.001 s"):
        bench(timestep=0.0003)
    with pytest.raises(BlockError, match=r"the bus's period 0\.001 s does not divide"):
        BlockBench(TwinRobot, {}, robot="bruce", rate=400.0)


@pytest.mark.parametrize(
    ("latency", "arrives", "acts"),
    [(0.0, 1, 1), (0.001, 1, 1), (0.002, 1, 2), (0.003, 2, 2), (0.006, 3, 4)],
)
def test_a_command_acts_after_its_latency(latency: float, arrives: int, acts: int) -> None:
    robot = bench(latency=latency)
    hold(robot)
    robot.step(50)
    actuator, goals = robot.block.twin.actuators[0], robot.block.twin.drives.goals
    robot.set("command", torque=np.eye(10)[0] * 5.0)  # on the yaw joint
    arrived = acted = 0
    for tick in range(1, 8):
        robot.step(1)
        arrived = arrived or tick * (abs(actuator.status["goal_iq"]) > 10.0)
        acted = acted or tick * (abs(goals[0, 0]) > 10.0)
    assert (arrived, acted) == (arrives, acts)
