"""A robot that stands at the end of a run sits down slowly; any other is damped at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.blocks.signals import CommandMode, DrivePhase
from aloft.hal.robot import Robot
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.sitting import sitting_path
from aloft.hal.twin.twin_robot import TwinRobot
from aloft.robots.description import find_robot
from aloft.runtime.language.block import STOP_CYCLES
from aloft.runtime.testing.bench import BlockBench

ROBOT = find_robot("bruce")
TICK = 0.002
FASTEST = 0.2
"""No end from standing sinks faster [m/s]."""


@pytest.mark.parametrize(("name", "deep"), [("bruce", 0.12), ("go2", 0.1), ("solo12", 0.1)])
def test_the_way_down_ends_near_a_limit(name: str, deep: float) -> None:
    robot = find_robot(name)
    path = sitting_path(robot)
    np.testing.assert_array_equal(path.pose[0], robot.standing_position)
    assert path.depth[-1] > deep and (np.diff(path.depth) > 0.0).all()
    assert (path.pose >= robot.joint_limits[:, 0]).all()
    assert (path.pose <= robot.joint_limits[:, 1]).all()
    assert np.abs(np.diff(path.pose, axis=0)).max() < 0.4


def test_a_robot_on_a_fixed_base_stays_where_it_is() -> None:
    robot = ROBOT.model_copy(update={"base_joint": "fixed"})
    assert sitting_path(robot).depth.tolist() == [0.0]


def standing(kind: type[Robot], **params: Any) -> tuple[BlockBench[Any], list[float]]:
    """A robot that was commanded to stand, and room for the torso's heights from the end on."""
    bench: BlockBench[Any] = BlockBench(kind, {"sit_down_speed": 0.15, **params}, robot="bruce")
    bench.set(
        "command", mode=CommandMode.ACTIVE, torque=0.01, position=ROBOT.standing_position,
        velocity=0.0, stiffness=150.0, damping=2.0,
    )  # fmt: skip
    bench.step(100)
    block = bench.block
    plant = block.twin.plant if kind is TwinRobot else block.plant
    heights = [float(plant.data.qpos[2])]
    for name in ("advance", "damp"):
        passing = getattr(block, name)

        def watched(passing: Any = passing) -> None:
            passing()
            heights.append(float(plant.data.qpos[2]))

        setattr(block, name, watched)
    return bench, heights


def end(bench: BlockBench[Any], damped: int = 300) -> None:
    """The stop cycles, and some time in damping."""
    for _ in range(STOP_CYCLES):
        bench.block.stop_cycle()
    for _ in range(damped):
        bench.block.damp()


@pytest.mark.parametrize("kind", [MujocoRobot, pytest.param(TwinRobot, marks=pytest.mark.long)])
def test_a_robot_that_stands_sits_down_slowly(kind: type[Robot]) -> None:
    bench, heights = standing(kind)
    end(bench)
    sinking = (np.array(heights[:-5]) - heights[5:]) / (5 * TICK)
    assert sinking.max() < FASTEST
    assert heights[0] - heights[-1] > 0.1, "it has sat down"
    if kind is TwinRobot:
        states = {actuator.status["torque_enable"] for actuator in bench.block.twin.actuators}
        assert states == {3}


def test_without_a_speed_it_sinks_in_damping() -> None:
    bench, heights = standing(MujocoRobot, sit_down_speed=0.0)
    end(bench)
    sinking = (np.array(heights[:-5]) - heights[5:]) / (5 * TICK)
    assert len(heights) == 1 + STOP_CYCLES + 300 and sinking.max() > 2.0 * FASTEST


def lifted(bench: BlockBench[Any]) -> None:
    bench.block.plant.data.qpos[2] += 0.2
    bench.step(2)


def moving(bench: BlockBench[Any]) -> None:
    bench.block.plant.data.qvel[8] = 5.0


def damping(bench: BlockBench[Any]) -> None:
    bench.set("command", mode=CommandMode.DAMPING)
    bench.step(1)


@pytest.mark.parametrize("change", [lifted, moving, damping])
def test_a_robot_that_does_not_stand_is_damped_at_once(change: Any) -> None:
    bench, heights = standing(MujocoRobot)
    change(bench)
    del heights[:]
    end(bench, damped=0)
    assert len(heights) == STOP_CYCLES


@pytest.mark.long
def test_a_fault_on_the_way_ends_in_damping() -> None:
    fault = {"kind": "dead", "start": 0.3, "target": "left_knee_motor"}
    bench, heights = standing(TwinRobot, faults=[fault])
    end(bench, damped=0)
    loop = bench.block.driver.loop
    assert loop.phase is DrivePhase.DAMPED and "left_knee_motor" in loop.fault
    assert 30 < len(heights) < 150, "the way takes 780 ticks"
