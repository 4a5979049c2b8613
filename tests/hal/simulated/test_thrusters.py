"""Thrusters obey physics, their limits and their lag, and arrive with the command of their tick."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aloft.blocks.signals import CommandMode
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.robots.description import RobotDescription
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases

from ...simulator_settings import grouped
from .simulated_bruce import lift

MASS, INERTIA = 2.0, 0.02
LAG = 0.05


def drone(lag: float = 0.0, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> RobotDescription:
    """A ball with two thrusters along one axis, 0.1 m from its middle, that turn opposite ways."""
    common = {"link": "body", "axis": axis, "max_thrust": 20.0, "time_constant": lag}
    return RobotDescription.model_validate({
        "name": "drone", "base": "body", "joints": [],
        "links": [{
            "name": "body", "mass": MASS, "com": [0, 0, 0],
            "inertia": [INERTIA, INERTIA, INERTIA, 0, 0, 0],
            "shapes": [{"start": [0, 0, 0], "end": [0, 0, 0], "radius": 0.1}],
        }],
        "transmission": {"motors": [], "joint_to_motor": []},
        "profiles": {"none": {
            "peak_torque": 1.0, "corner_speed": 1.0, "no_load_speed": 2.0,
            "continuous_torque": 1.0, "rotor_inertia": 0.0, "friction": 0.0, "damping": 0.0,
        }},
        "thrusters": {
            "left": {**common, "position": [0, 0.1, 0], "torque_ratio": 0.02},
            "right": {**common, "position": [0, -0.1, 0], "torque_ratio": -0.02},
        },
    })  # fmt: skip


def bench(robot: RobotDescription, **params: Any) -> BlockBench[MujocoRobot]:
    return BlockBench(MujocoRobot, grouped(params), robot=robot, rate=500.0)


def seen(robot: BlockBench[MujocoRobot]) -> Any:
    robot.block.emit()
    return robot.get("truth")


@pytest.mark.parametrize(
    "axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.6, 0.0, 0.8)]
)
def test_force_and_moments_move_a_free_body(axis: tuple[float, float, float]) -> None:
    robot = bench(drone(axis=axis))
    lift(robot)
    robot.set("thrust", thrust=[15.0, 10.0])
    robot.step()
    after = seen(robot)
    force = 25.0 * np.array(axis)
    moment = np.cross([0.0, 0.1, 0.0], 5.0 * np.array(axis)) + 0.02 * 5.0 * np.array(axis)
    velocity = 0.002 * (force / MASS - [0.0, 0.0, 9.81])
    assert after.base_linear_velocity == pytest.approx(velocity, abs=1e-6)
    assert after.base_angular_velocity == pytest.approx(0.002 * moment / INERTIA, abs=1e-4)
    assert robot.get("imu").specific_force == pytest.approx(force / MASS, abs=5e-3)
    assert robot.get("thrusters").thrust == pytest.approx([15.0, 10.0])


def test_thrust_is_never_negative_and_never_more_than_the_most() -> None:
    robot = bench(drone())
    robot.set("thrust", thrust=[-5.0, 50.0])
    robot.step()
    seen(robot)
    assert robot.get("thrusters").thrust.tolist() == [0.0, 20.0]


def test_thrust_follows_as_a_first_order_lag() -> None:
    robot = bench(drone(lag=LAG))
    robot.set("thrust", thrust=[8.0, 8.0])
    robot.step(20)
    seen(robot)
    grown = 8.0 * (1.0 - math.exp(-20 * 0.002 / LAG))
    assert robot.get("thrusters").thrust == pytest.approx([grown, grown], rel=1e-9)


def test_commands_take_as_long_as_those_of_joints() -> None:
    robot = bench(drone(), latency=0.005)
    robot.set("thrust", thrust=[12.0, 12.0])
    found = []
    for _ in range(4):
        robot.step()
        seen(robot)
        found.append(robot.get("thrusters").thrust[0])
    assert found == [0.0, 0.0, 12.0, 12.0]


@pytest.mark.parametrize("mode", [CommandMode.OFF, CommandMode.DAMPING])
def test_nothing_is_asked_of_them_in_other_modes(mode: CommandMode) -> None:
    robot = bench(drone())
    robot.set("thrust", thrust=[12.0, 12.0])
    robot.set("command", mode=mode)
    robot.step()
    seen(robot)
    assert not robot.get("thrusters").thrust.any()


def test_a_stop_cycle_switches_them_off() -> None:
    robot = bench(drone())
    robot.set("thrust", thrust=[12.0, 12.0])
    robot.step()
    robot.block.stop_cycle()
    seen(robot)
    assert not robot.get("thrusters").thrust.any()


def test_the_seed_draws_how_much_each_gives() -> None:
    gears = [
        bench(drone(), thrust_spread=0.1, seed=seed).block.plant.model.actuator_gear[:, [2, 5]]
        for seed in (1, 2)
    ]
    assert (np.abs(gears[0][:, 0] - 1.0) <= 0.1).all() and (gears[0] != gears[1]).all()
    assert gears[0][:, 1] / gears[0][:, 0] == pytest.approx([0.02, -0.02])


def test_a_run_can_be_restored_exactly() -> None:
    robot = bench(drone(lag=LAG), latency=0.004, jitter=0.002, gyro_noise=0.01)
    robot.set("thrust", thrust=[12.0, 11.0])
    robot.step(5)
    kept = robot.snapshot()
    robot.step(20)
    expected = robot.snapshot()
    robot.restore(kept)
    robot.step(20)
    assert robot.snapshot() == expected


def test_ports_are_there_where_the_description_has_thrusters() -> None:
    with_them = MujocoRobot.specialize(MujocoRobot.Params(), None, drone())  # type: ignore[arg-type]
    assert with_them.inputs["command"].optional and "thrusters" in with_them.outputs
    assert "thrust" not in MujocoRobot.inputs and not MujocoRobot.inputs["command"].optional


@pytest.mark.parametrize("case", conformance_cases())
def test_keeps_every_blocks_promises(case: str) -> None:
    noise = {"gyro_noise": 0.02, "latency": 0.002, "jitter": 0.0005, "thrust_spread": 0.05}
    check_block(MujocoRobot, grouped(noise), robot=drone(lag=LAG), cases=[case])
