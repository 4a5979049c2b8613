"""``blocks.HoldJoints`` takes any robot's joints to a pose, softly, or along a path."""

import numpy as np
import pytest

import aloft
from aloft.blocks.control.hold_joints import HoldJoints
from aloft.blocks.signals import CommandMode
from aloft.runtime.testing import BlockBench

GAINS = {"stiffness": {"*": 40.0, "*_knee": 60.0}, "damping": 1.5}
START = np.linspace(-0.2, 0.3, 10)


def bench(wired: tuple[str, ...] = ("joints",), **params: object) -> BlockBench[HoldJoints]:
    made = BlockBench(
        HoldJoints, {**GAINS, "duration": 0.1, **params}, robot="bruce", rate=100.0, wired=wired
    )
    made.set("joints", position=START)
    return made


def test_it_holds_where_it_began() -> None:
    made = bench()
    for _ in range(15):
        made.step()
        made.set("joints", position=START + 0.1)
    command = made.get("command")
    assert command.position.tolist() == START.tolist() and not command.velocity.any()
    assert int(command.mode) == CommandMode.ACTIVE
    knees = [joint.name.endswith("_knee") for joint in made.block.robot.joints]
    assert command.stiffness.tolist() == [60.0 if knee else 40.0 for knee in knees]
    assert command.damping.tolist() == [1.5] * 10


def test_a_pose_is_reached_softly_and_its_speed_is_its_derivative() -> None:
    made = bench(position=0.5)
    places, speeds = [], []
    for _ in range(15):
        made.step()
        places.append(made.get("command").position.copy())
        speeds.append(made.get("command").velocity.copy())
    assert places[0].tolist() == START.tolist() and places[-1] == pytest.approx(0.5)
    assert not speeds[0].any() and speeds[-1] == pytest.approx(0.0)
    assert places[5] == pytest.approx(START + 0.5 * (0.5 - START))
    assert speeds[5] == pytest.approx((0.5 - START) / 0.1 * 1.875)  # of minimum jerk in its middle


def test_a_path_is_followed_with_its_speed_and_torque() -> None:
    made = bench(("joints", "setpoint"))
    for k in range(15):
        made.set("setpoint", position=START + 0.01 * k, velocity=[1.0] * 10, torque=[2.0] * 10)
        made.step()
    command = made.get("command")
    assert command.position == pytest.approx(START + 0.14)
    assert command.velocity == pytest.approx(1.0) and command.torque.tolist() == [2.0] * 10


def test_it_holds_a_simulated_robot_with_no_block_between() -> None:
    graph = aloft.load("""
rate: 500 Hz
duration: 0.2 s
robot: bruce
blocks:
  robot: {use: hal.MujocoRobot, with: {seed: 0}, in: {command: pd.command}}
  pd: {use: blocks.HoldJoints, with: {stiffness: 60 N m/rad, damping: 1.5 N m s/rad}, in: {joints: robot.joints}}
""")
    position = graph.run().signal("robot.joints.position")
    assert np.abs(position[-1] - position[0]).max() < 0.2
