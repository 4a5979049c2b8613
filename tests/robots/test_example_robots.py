"""Robots that nobody here made: our models agree with Pinocchio's own reader and with MuJoCo."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.kinematics import link_poses_in_base, standing_com, standing_heights
from aloft.robots.pinocchio_model import build_pinocchio_model

from .example_robots import URDF, needs_robots, urdf

MASSES = {
    "a1": 13.741, "alexander": 49.08069743, "anymal_c": 52.13485, "bolt": 1.25387789, "g1": 33.34114202, "go2": 16.085,
    "hyq": 86.774005, "simple_humanoid": 130.8, "solo12": 2.50000279, "talos": 90.272192,
}  # fmt: skip


def unit(values: Any) -> Any:
    return values / np.linalg.norm(values)


class Pair:
    """Our Pinocchio model of a robot and Pinocchio's own of its URDF, at the same random state."""

    def __init__(self, name: str, seed: int) -> None:
        self.robot = find_robot(name)
        self.ours = build_pinocchio_model(self.robot).model
        self.theirs = pin.buildModelFromUrdf(str(urdf(name)), pin.JointModelFreeFlyer())
        for model in (self.ours, self.theirs):
            model.armature = np.zeros(model.nv)
        named = {joint.name for joint in self.robot.joints}
        self.others = [
            k for k in range(2, self.theirs.njoints) if self.theirs.names[k] not in named
        ]
        random = np.random.default_rng(seed)
        base = np.concatenate([random.normal(size=3), unit(random.normal(size=4))])
        self.angles = random.normal(size=len(self.robot.joints))
        self.q = np.concatenate([base, self.angles])
        self.v = random.normal(size=self.ours.nv)
        self.their_q = pin.neutral(self.theirs)
        self.their_q[:7] = base
        # Theirs are in the order of the alphabet, and have joints that we weld.
        self.select = np.zeros((self.theirs.nv, self.ours.nv))
        self.select[:6, :6] = np.eye(6)
        for k, joint in enumerate(self.robot.joints):
            their = self.theirs.joints[self.theirs.getJointId(joint.name)]
            value = [self.angles[k]]
            if their.nq == 2:
                value = [np.cos(self.angles[k]), np.sin(self.angles[k])]
            self.their_q[their.idx_q : their.idx_q + their.nq] = value
            self.select[their.idx_v, 6 + k] = 1.0


@needs_robots
@pytest.mark.parametrize("name", URDF)
def test_dynamics_are_those_of_pinocchios_own_reader(name: str) -> None:
    for seed in range(3):
        pair = Pair(name, seed)
        ours, theirs = pair.ours.createData(), pair.theirs.createData()
        select = pair.select
        mass = pin.crba(pair.ours, ours, pair.q)
        their_mass = select.T @ pin.crba(pair.theirs, theirs, pair.their_q) @ select
        scale = max(1.0, float(np.abs(their_mass).max()))
        np.testing.assert_allclose(mass, their_mass, rtol=0, atol=1e-9 * scale)
        gravity = pin.computeGeneralizedGravity(pair.ours, ours, pair.q)
        their_gravity = pin.computeGeneralizedGravity(pair.theirs, theirs, pair.their_q)
        np.testing.assert_allclose(gravity, select.T @ their_gravity, rtol=0, atol=1e-9 * scale)
        bias = pin.nonLinearEffects(pair.ours, ours, pair.q, pair.v)
        their_bias = pin.nonLinearEffects(pair.theirs, theirs, pair.their_q, select @ pair.v)
        np.testing.assert_allclose(bias, select.T @ their_bias, rtol=0, atol=1e-9 * scale)
        com = pin.centerOfMass(pair.ours, ours, pair.q)
        their_com = pin.centerOfMass(pair.theirs, theirs, pair.their_q)
        np.testing.assert_allclose(com, their_com, rtol=0, atol=1e-9)


@needs_robots
@pytest.mark.parametrize("name", URDF)
def test_joints_are_where_pinocchios_own_reader_has_them(name: str) -> None:
    pair = Pair(name, 7)
    ours, theirs = pair.ours.createData(), pair.theirs.createData()
    pin.forwardKinematics(pair.ours, ours, pair.q)
    pin.forwardKinematics(pair.theirs, theirs, pair.their_q)
    zero = pair.theirs.createData()
    neutral = pin.neutral(pair.theirs)
    pin.forwardKinematics(pair.theirs, zero, neutral)
    for joint in pair.robot.joints:
        mine = ours.oMi[pair.ours.getJointId(joint.name)]
        their = theirs.oMi[pair.theirs.getJointId(joint.name)]
        np.testing.assert_allclose(mine.translation, their.translation, rtol=0, atol=1e-9)
        # Our frames are parallel to the base's at the zero pose.
        start = zero.oMi[pair.theirs.getJointId(joint.name)].rotation
        np.testing.assert_allclose(mine.rotation @ start, their.rotation, rtol=0, atol=1e-9)


@needs_robots
@pytest.mark.parametrize("name", URDF)
def test_the_simulators_model_agrees(name: str) -> None:
    robot = find_robot(name)
    simulated, built = build_mujoco_model(robot), build_pinocchio_model(robot)
    random = np.random.default_rng(1)
    data = mujoco.MjData(simulated)
    data.qpos[2], data.qpos[3:7] = 10.0, unit(random.normal(size=4))
    data.qpos[7:] = random.normal(size=len(robot.joints))
    mujoco.mj_forward(simulated, data)
    q = np.concatenate([data.qpos[:3], data.qpos[[4, 5, 6, 3]], data.qpos[7:]])
    turn = np.eye(simulated.nv)
    turn[:3, :3] = pin.Quaternion(q[3:7]).toRotationMatrix()
    mass = np.zeros((simulated.nv, simulated.nv))
    mujoco.mj_fullM(simulated, data, mass)
    theirs = pin.crba(built.model, built.model.createData(), q) + built.rotor_coupling
    np.testing.assert_allclose(turn.T @ mass @ turn, theirs, rtol=0, atol=1e-8)
    com = pin.centerOfMass(built.model, built.model.createData(), q)
    np.testing.assert_allclose(data.sensor("com").data, com, rtol=0, atol=1e-9)


@needs_robots
@pytest.mark.parametrize("name", URDF)
def test_the_shipped_robot_stands(name: str) -> None:
    robot = find_robot(name)
    assert robot.total_mass == pytest.approx(MASSES[name], abs=1e-6)
    heights = standing_heights(robot)
    np.testing.assert_allclose(heights, heights[0], rtol=0, atol=1e-8)
    com, soles = standing_com(robot), []
    poses = link_poses_in_base(robot, robot.standing_position)
    for foot in robot.feet:
        turn, place = poses[foot.link]
        if sum(contact.foot == foot.name for contact in robot.contacts) > 1:
            np.testing.assert_allclose(turn, np.eye(3), atol=1e-8)
            soles.append(place + turn @ np.array(foot.sole))
        else:
            radius = next(c.radius for c in robot.contacts if c.foot == foot.name)
            soles.append(place + turn @ np.add(foot.sole, (0.0, 0.0, radius)))
    np.testing.assert_allclose(com[:2], np.mean(soles, axis=0)[:2], rtol=0, atol=1e-8)
    limits = robot.joint_limits
    position = robot.standing_position
    assert np.all((limits[:, 0] <= position) & (position <= limits[:, 1]))


@needs_robots
@pytest.mark.parametrize("name", URDF)
def test_nothing_but_contact_points_touches_in_the_standing_pose(name: str) -> None:
    robot = find_robot(name)
    model = build_mujoco_model(robot)
    data = mujoco.MjData(model)
    data.qpos[7:] = robot.standing_position
    data.qpos[2] = -standing_heights(robot).min() - 1e-4
    mujoco.mj_forward(model, data)
    touching = {model.geom(int(g)).name for g in data.contact.geom.ravel()}
    assert touching == {"floor"} | {contact.name for contact in robot.contacts}


@needs_robots
def test_what_the_yaml_adds_is_there() -> None:
    robot: RobotDescription = find_robot("go2")
    assert [foot.name for foot in robot.feet] == ["FL", "FR", "RL", "RR"]
    assert robot.motors.peak_torque.tolist() == [23.7, 23.7, 45.43] * 4
    assert robot.motors.no_load_speed.tolist() == [30.1, 30.1, 15.7] * 4
    assert robot.motors.corner_speed[0] == pytest.approx(0.6 * 30.1)
    assert robot.motors.rotor_inertia.tolist() == [0.01, 0.01, 0.037] * 4
    assert find_robot("solo12").motors.peak_torque.tolist() == [2.7] * 12
    assert len(find_robot("g1").held) == 17
    assert not [joint for joint in find_robot("talos").joints if "gripper" in joint.name]
