"""All models must see the same robot: same places, same inertia, same gravity, same momentum.

Of every shipped robot: Pinocchio (set-up and checks), MuJoCo (simulator), the kernels (tick), CasADi (planner)
and NumPy (pictures). The equations of motion of the kernels are compared in ``test_dynamics_of_any_robot``, those
of CasADi in ``test_symbolic_model_of_any_robot``.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import mujoco
import numpy as np
import pinocchio as pin
import pytest

from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.hal.simulated.scenes import platform, step
from aloft.hal.simulated.variation import Variation
from aloft.mathematics.rotations import to_matrix
from aloft.planner.models.symbolic_model import SymbolicModel, centroidal_momentum
from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import find_robot
from aloft.robots.five_joint_leg import find_leg, forward
from aloft.robots.kinematics import ball_feet, link_poses, link_poses_in_base, standing_com
from aloft.robots.limb import read_limb, set_limb_pose
from aloft.robots.pinocchio_model import build_pinocchio_model

from ..planner.models.test_symbolic_model import evaluate, to_pinocchio
from .example_robots import URDF, needs_robots

ROBOT = find_robot("bruce")
SIMULATED = build_mujoco_model(ROBOT)
CONTROLLER = build_pinocchio_model(ROBOT)


def random_state(seed: int) -> tuple[Any, Any, Any]:
    """The same random state for both: MuJoCo's data and Pinocchio's q and v."""
    random = np.random.default_rng(seed)
    limits = ROBOT.joint_limits
    data = mujoco.MjData(SIMULATED)
    data.qpos[:3] = random.normal(loc=(0.0, 0.0, 10.0))
    quaternion = random.normal(size=4)
    data.qpos[3:7] = quaternion / np.linalg.norm(quaternion)
    data.qpos[7:] = random.uniform(limits[:, 0], limits[:, 1])
    data.qvel[:] = 3.0 * random.normal(size=16)
    q = np.concatenate([data.qpos[:3], data.qpos[[4, 5, 6, 3]], data.qpos[7:]])
    v = data.qvel.copy()
    rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
    v[:3] = rotation.T @ v[:3]
    mujoco.mj_forward(SIMULATED, data)
    return data, q, v


def world_linear(q: Any) -> Any:
    """The matrix that takes Pinocchio's velocity to MuJoCo's (linear part in the world)."""
    turn = np.eye(16)
    turn[:3, :3] = pin.Quaternion(q[3:7]).toRotationMatrix()
    return turn


@pytest.mark.parametrize("seed", range(5))
def test_mass_matrix_with_rotors(seed: int) -> None:
    data, q, _ = random_state(seed)
    ours = np.zeros((16, 16))
    mujoco.mj_fullM(SIMULATED, data, ours)
    model = CONTROLLER.model
    theirs = pin.crba(model, model.createData(), q) + CONTROLLER.rotor_coupling
    turn = world_linear(q)
    np.testing.assert_allclose(turn.T @ ours @ turn, theirs, rtol=0, atol=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_bias_forces(seed: int) -> None:
    data, q, v = random_state(seed)
    model = CONTROLLER.model
    theirs = pin.nonLinearEffects(model, model.createData(), q, v)
    # The bias of MuJoCo's linear coordinates lacks the Coriolis term of a rotating frame.
    turn = world_linear(q)
    rate = np.zeros(16)
    rate[:3] = np.cross(v[3:6], v[:3])
    mass = pin.crba(model, model.createData(), q)
    np.testing.assert_allclose(turn.T @ data.qfrc_bias + mass @ rate, theirs, rtol=0, atol=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_centre_of_mass_momentum_and_contact_points(seed: int) -> None:
    data, q, v = random_state(seed)
    model = CONTROLLER.model
    memory = model.createData()
    pin.computeCentroidalMomentum(model, memory, q, v)
    pin.framesForwardKinematics(model, memory, q)
    com = pin.centerOfMass(model, memory, q)
    np.testing.assert_allclose(data.sensor("com").data, com, rtol=0, atol=1e-10)
    velocity = memory.hg.linear / ROBOT.total_mass
    np.testing.assert_allclose(data.sensor("com_velocity").data, velocity, rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        data.sensor("angular_momentum").data, memory.hg.angular, rtol=0, atol=1e-10
    )
    for contact, frame in zip(ROBOT.contacts, CONTROLLER.contact_frames, strict=True):
        np.testing.assert_allclose(
            data.site(contact.name).xpos, memory.oMf[frame].translation, rtol=0, atol=1e-10
        )


@pytest.mark.parametrize("name", ["bruce", *(pytest.param(n, marks=needs_robots) for n in URDF)])
def test_every_model_of_a_robot_puts_it_in_the_same_place(name: str) -> None:
    robot = find_robot(name)
    built = build_pinocchio_model(robot)
    model, memory = built.model, built.model.createData()
    random = np.random.default_rng(8)
    coordinates, rates = random.uniform(-0.9, 0.9, (2, model.nv))
    q, v, _ = to_pinocchio(coordinates, rates, np.zeros(model.nv))
    base, joints, turn = q[:3], q[7:], pin.Quaternion(q[3:7]).toRotationMatrix()
    pin.computeCentroidalMomentum(model, memory, q, v)
    pin.framesForwardKinematics(model, memory, q)
    com = memory.com[0].copy()
    places = {robot.base: memory.oMi[1]}
    places |= {joint.child: memory.oMi[model.getJointId(joint.name)] for joint in robot.joints}
    points = np.array([memory.oMf[k].translation for k in built.contact_frames]).reshape(-1, 3)
    for ball in ball_feet(robot):
        frame = memory.oMf[built.contact_frames[ball.point]]
        points[ball.point] += ball.radius * (frame.rotation[:, 2] - [0.0, 0.0, 1.0])

    def close(found: Any, expected: Any) -> None:
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)

    # NumPy
    poses = link_poses(robot, base[None], q[None, 3:7], joints[None])
    for link, place in places.items():
        position, rotation = poses.of(link)
        close(position[0], place.translation)
        close(rotation[0], place.rotation)

    # kernels, seen from the base
    matrix = np.empty((3, 3))
    to_matrix(q[3:7], matrix)
    close(matrix, turn)
    for link, (rotation, position) in link_poses_in_base(robot, joints).items():
        close(base + turn @ position, places[link].translation)
        close(turn @ rotation, places[link].rotation)
    contacts = ContactKinematics(robot)
    contacts.evaluate(q[3:7], v[3:6], joints, v[6:])
    lowest = points.copy()  # of the round rubber, of balls and others
    for k, contact in enumerate(robot.contacts):
        if k not in {ball.point for ball in ball_feet(robot)}:
            up = memory.oMf[built.contact_frames[k]].rotation[:, 2]
            lowest[k] += contact.radius * (up - [0.0, 0.0, 1.0])
    close(base + contacts.points @ turn.T, lowest)
    velocity = memory.hg.linear / robot.total_mass
    close(turn @ (v[:3] + contacts.com_velocity), velocity)
    for foot, frame in enumerate(built.sole_frames):
        limb, leg = read_limb(robot, foot), find_leg(robot, foot)
        pose, sole = np.empty((4, 3)), memory.oMf[frame]
        angles = joints[list(limb.joints)]
        set_limb_pose(limb.links, limb.tip, angles, np.empty((len(angles), 6)), pose)
        close(base + turn @ pose[0], sole.translation)
        close(turn @ pose[1:], sole.rotation)
        if leg is not None:
            forward(leg, angles, pose[0], pose[1:])
            close(base + turn @ pose[0], sole.translation)
            close(turn @ pose[1:], sole.rotation)

    # CasADi
    symbolic, symbols = SymbolicModel(robot), [ca.SX.sym(x, model.nv) for x in "qv"]
    frames = symbolic.frames(symbols[0])
    found = evaluate(
        [
            ca.horzcat(*(frames[link][1] for link in places)),
            ca.horzcat(*symbolic.contact_points(symbols[0])),
            *centroidal_momentum(symbolic, *symbols),
        ],
        symbols,
        [coordinates, rates],
    )
    close(found[0].T, [place.translation for place in places.values()])
    close(found[1].T, points)
    close(found[2].ravel(), com)
    close(found[3].ravel(), memory.hg.linear)
    close(found[4].ravel(), memory.hg.angular)

    # MuJoCo
    simulated = build_mujoco_model(robot)
    data = mujoco.MjData(simulated)
    data.qpos[:3], data.qpos[3:7], data.qpos[7:] = base, q[[6, 3, 4, 5]], joints
    data.qvel[:] = v
    data.qvel[:3] = turn @ v[:3]
    mujoco.mj_forward(simulated, data)
    for link, place in places.items():
        close(data.body(link).xpos, place.translation)
        close(data.body(link).xmat.reshape(3, 3), place.rotation)
    close(data.sensor("com").data, com)
    close(data.sensor("com_velocity").data, velocity)
    close(data.sensor("angular_momentum").data, memory.hg.angular)

    q = np.concatenate([np.zeros(6), [1.0], robot.standing_position])
    close(standing_com(robot), pin.centerOfMass(model, memory, q))


def test_total_mass_is_the_papers() -> None:
    assert ROBOT.total_mass == pytest.approx(5.118, abs=1e-12)
    assert mujoco.mj_getTotalmass(SIMULATED) == pytest.approx(5.118, abs=1e-12)
    assert pin.computeTotalMass(CONTROLLER.model) == pytest.approx(5.118, abs=1e-12)


def upright(pitch: float, knee: float, ankle: float) -> Any:
    """Pinocchio's q with both legs at these angles and the torso upright."""
    q = pin.neutral(CONTROLLER.model)
    q[7:] = [0.0, pitch, 0.0, knee, ankle] * 2
    return q


@pytest.mark.parametrize(
    ("flexion", "pitch", "ankle", "base", "com"),
    [
        (0.0, -0.04, 0.04, 0.407, 0.353),
        (0.4, 0.19, 0.21, 0.400, 0.346),
        (0.8, 0.42, 0.38, 0.380, 0.329),
        (1.2, 0.65, 0.55, 0.346, 0.301),
        (1.6, 0.90, 0.70, 0.301, 0.264),
        (2.0, 1.16, 0.84, 0.245, 0.220),
    ],
)
def test_published_heights_by_knee_flexion(
    flexion: float, pitch: float, ankle: float, base: float, com: float
) -> None:
    q = upright(pitch, -flexion, ankle)
    memory = CONTROLLER.model.createData()
    pin.framesForwardKinematics(CONTROLLER.model, memory, q)
    sole = memory.oMf[CONTROLLER.sole_frames[0]].translation
    height = pin.centerOfMass(CONTROLLER.model, memory, q)[2] - sole[2]
    assert -sole[2] == pytest.approx(base, abs=0.002)
    assert height == pytest.approx(com, abs=0.002)


def test_standing_pose_balances_over_mid_foot() -> None:
    q = pin.neutral(CONTROLLER.model)
    q[7:] = ROBOT.standing_position
    memory = CONTROLLER.model.createData()
    pin.framesForwardKinematics(CONTROLLER.model, memory, q)
    com = pin.centerOfMass(CONTROLLER.model, memory, q)
    soles = [memory.oMf[frame] for frame in CONTROLLER.sole_frames]
    np.testing.assert_allclose(com[:2], (soles[0].translation + soles[1].translation)[:2] / 2,
                               atol=1e-9)  # fmt: skip
    for sole in soles:
        np.testing.assert_allclose(sole.rotation, np.eye(3), atol=1e-9)
    pin.ccrba(CONTROLLER.model, memory, q, np.zeros(16))
    np.testing.assert_allclose(np.diag(memory.Ig.inertia), [0.1044, 0.0820, 0.0352], rtol=0.005)


def test_reflected_rotor_inertia() -> None:
    inertia = ROBOT.profiles["koala"].rotor_inertia
    matrix = CONTROLLER.rotor_coupling[6:, 6:] + np.diag(CONTROLLER.model.armature[6:])
    leg = np.diag([1.0, 2.0, 2.0, 2.0, 1.0])
    leg[3, 4] = leg[4, 3] = 1.0
    np.testing.assert_allclose(matrix[:5, :5], inertia * leg, atol=1e-15)
    np.testing.assert_allclose(matrix[5:, 5:], inertia * leg, atol=1e-15)
    np.testing.assert_array_equal(matrix[:5, 5:], 0.0)


@pytest.mark.parametrize("flexion", [0.02, 0.8, 1.6, 2.1])
def test_no_pose_on_the_ground_touches_anything_but_toes_and_heels(flexion: float) -> None:
    data = mujoco.MjData(SIMULATED)
    ankle = min(0.95, 0.05 + 0.4 * flexion)
    data.qpos[7:] = [0.0, flexion - ankle, 0.0, -flexion, ankle] * 2
    mujoco.mj_kinematics(SIMULATED, data)
    data.qpos[2] = 1e-4 - data.site("right_toe").xpos[2] - 2e-4
    mujoco.mj_forward(SIMULATED, data)
    touching = {SIMULATED.geom(int(g)).name for g in data.contact.geom.ravel()}
    assert touching == {"floor"} | {contact.name for contact in ROBOT.contacts}


def test_legs_collide_with_each_other() -> None:
    data = mujoco.MjData(SIMULATED)
    data.qpos[2] = 2.0
    data.qpos[7:] = ROBOT.standing_position
    mujoco.mj_forward(SIMULATED, data)
    assert data.ncon == 0
    data.qpos[[7 + 2, 7 + 7]] = [0.5, -0.5]  # hip roll: both legs inward
    mujoco.mj_forward(SIMULATED, data)
    assert data.ncon > 0


def test_variation_and_scenes_reach_the_model() -> None:
    variation = Variation(friction=0.5, contact_stiffness=4.0, mass=1.05,
                          base_com_offset=(0.005, 0.0, -0.005))  # fmt: skip
    model = build_mujoco_model(ROBOT, variation=variation, scene=step(0.05, 0.1))
    assert mujoco.mj_getTotalmass(model) == pytest.approx(1.05 * 5.118)
    assert model.geom("right_toe").friction[0] == 0.5
    assert model.geom("box/0").solref[0] == pytest.approx(0.002)
    assert model.body("torso").ipos[0] == pytest.approx(0.02325 + 0.005)
    assert step(0.05, 0.1).height(0.2, 0.0) == 0.05
    assert step(0.05, 0.1).height(0.05, 0.0) == 0.0
    off = platform(0.35, 0.1)
    assert off.height(0.0, 0.0) == 0.0
    assert off.height(0.2, 0.0) == -0.35
    behind = platform(0.35, -0.1)
    assert [behind.height(x, 0.0) for x in (-0.2, 0.0, 0.2)] == [-0.35, 0.0, 0.0]
