"""The six-axis force sensors under BRUCE's feet: weight in stance, errors as declared, impulse of a hop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.twin.twin_robot import TwinRobot
from aloft.mathematics.constants import GRAVITY
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped
from .mounting import bruce_with, hold

SOLE = [0.0075, 0.0, -0.024]
NOISE = {
    "force": {"noise": 0.5, "bias": 1.0, "range": 60.0, "resolution": 0.1},
    "torque": {"noise": 0.02, "bias": 0.05, "resolution": 0.001},
}


def sole(side: str, noise: Any = None) -> dict[str, Any]:
    found = {"kind": "force_torque", "link": f"{side}_foot", "position": SOLE}
    return {**found, "noise": noise} if noise else found


def bench(kind: type[Any] = MujocoRobot, noise: Any = None, **params: Any) -> BlockBench[Any]:
    robot = bruce_with(right_sole=sole("right", noise), left_sole=sole("left", noise))
    return BlockBench(kind, grouped(params), robot=robot)


def frames(robot: BlockBench[Any]) -> dict[str, tuple[Any, Any]]:
    """Where both sensors are now [m, world], and the rotation from their axes to the world's."""
    sites = {side: robot.block.plant.data.site(f"sensor/{side}_sole") for side in ("right", "left")}
    return {k: (np.array(s.xpos), np.array(s.xmat).reshape(3, 3)) for k, s in sites.items()}


def vertical(robot: BlockBench[Any]) -> float:
    """The sum of both forces along the soles' normals [N]."""
    return float(sum(robot.get(f"{side}_sole").force[2] for side in ("right", "left")))


def test_the_forces_of_a_standing_robot_are_its_weight() -> None:
    robot = bench()
    hold(robot)
    robot.step(200)
    weight = robot.block.robot.weight
    assert vertical(robot) == pytest.approx(weight, rel=1e-3)
    for side in ("right", "left"):
        wrench = robot.get(f"{side}_sole")
        assert wrench.force[2] == pytest.approx(weight / 2, rel=0.02)
        # the centre of pressure is between heel and toe
        assert -0.0425 < -wrench.torque[1] / wrench.force[2] < 0.0425


def test_wrenches_are_those_of_the_contact_points() -> None:
    robot = bench(friction=0.9, timestep=0.002)  # a tick is one step: means hide no motion
    hold(robot)
    names = [joint.name for joint in robot.block.robot.joints]
    targets = robot.block.robot.standing_position.copy()
    targets[[k for k, name in enumerate(names) if "hip_roll" in name]] += 0.1
    robot.set("command", position=targets)
    shear, poses = 0.0, frames(robot)
    robot.step()
    for _ in range(30):
        before, poses = poses, frames(robot)
        robot.step()
        truth = robot.get("truth")
        for foot, side in enumerate(("right", "left")):
            own = np.array(robot.block.robot.foot_of_contact()) == foot
            origin, turn = before[side]
            force, point = truth.contact_force[own], truth.contact_position[own]
            wrench = robot.get(f"{side}_sole")
            np.testing.assert_allclose(turn @ wrench.force, force.sum(axis=0), atol=1e-6)
            torque = np.cross(point - origin, force).sum(axis=0)
            # contact points are given after the step, and the foot rolls meanwhile
            np.testing.assert_allclose(turn @ wrench.torque, torque, atol=0.05)
            shear = max(shear, float(np.abs(wrench.force[:2]).max()))
    assert shear > 1.0


def test_errors_are_those_that_the_description_declares() -> None:
    robot, ideal = bench(noise=NOISE, seed=5), bench(seed=5)
    found = {field: [] for field in NOISE}
    for each in (robot, ideal):
        hold(each)
        each.step(100)
    for _ in range(600):
        robot.step()
        ideal.step()
        for field, differences in found.items():
            reading = getattr(robot.get("left_sole"), field)
            differences.append(reading - getattr(ideal.get("left_sole"), field))
            step = NOISE[field]["resolution"]
            np.testing.assert_allclose(reading / step, np.rint(reading / step), atol=1e-6)
    sensor = robot.block.plant.sensors.mounted[1]
    for field, noise in NOISE.items():
        errors = np.array(found[field])
        np.testing.assert_allclose(errors.std(axis=0), noise["noise"], rtol=0.12)
        limit = 4 * noise["noise"] / np.sqrt(600)
        np.testing.assert_allclose(errors.mean(axis=0), sensor.bias(field), atol=limit)
        assert 0.0 < np.abs(sensor.bias(field)).max() <= noise["bias"]
    weight = robot.block.robot.weight
    assert vertical(robot) == pytest.approx(weight, abs=2 * (1.0 + 4 * 0.5))


def test_a_force_beyond_the_range_reads_as_the_range() -> None:
    robot = bench(noise={"force": {"range": 10.0}})
    hold(robot)
    robot.step(20)
    assert robot.get("left_sole").force[2] == 10.0


@pytest.mark.parametrize("noise", [None, {"force": {"noise": 0.5, "bias": 1.0}}])
def test_the_impulse_of_a_hop_is_the_change_of_momentum(noise: Any) -> None:
    robot = bench(noise=noise)
    hold(robot)
    robot.step(100)
    mass, period = robot.block.robot.total_mass, robot.block.period
    momentum = mass * robot.get("truth").com_velocity.copy()
    names = [joint.name for joint in robot.block.robot.joints]
    standing = robot.block.robot.standing_position
    extended = np.array([
        0.2 * angle if "hip_pitch" in name or "knee" in name or "ankle" in name else angle
        for name, angle in zip(names, standing, strict=True)
    ])  # fmt: skip
    robot.set("command", position=extended, stiffness=200.0, damping=0.5)
    impulse, flying = np.zeros(3), 0
    poses = frames(robot)
    for _ in range(200):
        before, poses = poses, frames(robot)
        robot.step()
        truth = robot.get("truth")
        for side in ("right", "left"):
            turn = 0.5 * (before[side][1] + poses[side][1])  # in the middle of the tick
            impulse += period * turn @ robot.get(f"{side}_sole").force
        impulse[2] -= period * mass * GRAVITY
        flying = flying + 1 if not truth.contact_touched.any() else 0
        if flying == 5:
            break
    assert flying == 5, "the robot left the ground"
    change = mass * robot.get("truth").com_velocity - momentum
    assert change[2] > 1.0
    tolerance = 0.03 if noise is None else 0.03 + 1.0
    np.testing.assert_allclose(impulse, change, atol=tolerance)


def test_the_twin_reads_the_same_weight_from_its_packets() -> None:
    robot = bench(TwinRobot)
    hold(robot, 3.5, 0.1)
    weight = robot.block.robot.weight
    assert vertical(robot) == pytest.approx(weight, rel=0.02)
    sample = robot.block.driver.board.samples["left_sole"].force
    assert sample.astype(np.float32).tolist() == sample.tolist()
