"""What the tests of the simulated robot share: a bench with BRUCE, and ways to hold and lift it."""

from __future__ import annotations

from typing import Any

from aloft.blocks.signals import CommandMode
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped


def bench(rate: float = 500.0, **params: Any) -> BlockBench[MujocoRobot]:
    return BlockBench(MujocoRobot, grouped(params), robot="bruce", rate=rate)


def hold(robot: BlockBench[MujocoRobot]) -> None:
    """Command the robot to hold the pose it is in."""
    robot.block.emit()
    joints = robot.get("joints")
    robot.set(
        "command", mode=CommandMode.ACTIVE, torque=joints.torque.copy(),
        position=joints.position.copy(), velocity=0.0, stiffness=300.0, damping=1.5,
    )  # fmt: skip


def lift(robot: BlockBench[MujocoRobot], height: float = 3.0) -> None:
    """Put the robot high up, legs in their standing pose, at rest and without gravity's pull yet."""
    data: Any = robot.block.plant.data
    data.qpos[2] += height
    data.qvel[:] = 0.0
    robot.block.save_state()
    robot.block.load_state()
