"""Contacts that count the bias acceleration: soles stand below moving legs."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from aloft.hal.simulated.base import BASES
from aloft.hal.simulated.contact_bias import ContactBias
from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.simulated.physics_step import step_calls
from aloft.hal.simulated.stance import set_standing_pose
from aloft.hal.simulated.variation import Variation
from aloft.mathematics.arrays import Array
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.mark.parametrize("name", ["bruce", "go2"])
def test_the_bias_is_what_the_jacobians_change_by(name: str) -> None:
    robot = find_robot(name)
    model = build_mujoco_model(robot)
    data = mujoco.MjData(model)
    draw = np.random.default_rng(1)
    data.qpos[3:7] = draw.standard_normal(4)
    data.qpos[7:] = draw.uniform(-0.5, 0.5, model.nq - 7)
    data.qvel[:] = 3.0 * draw.standard_normal(model.nv)
    mujoco.mj_step1(model, data)
    balls = np.array([model.geom(contact.name).id for contact in robot.contacts])
    arms = 0.02 * draw.standard_normal((len(balls), 3))
    expected = []
    moving, turning = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for ball, arm in zip(balls, arms, strict=True):
        body = int(model.geom_bodyid[ball])
        mujoco.mj_jacDot(model, data, moving, turning, data.geom_xpos[ball], body)
        expected.append(moving @ data.qvel + np.cross(turning @ data.qvel, arm))
    found = ContactBias(model, data).bias(balls, data.geom_xpos[balls] + arms)
    assert np.abs(found).max() > 5.0
    np.testing.assert_allclose(found, expected, atol=1e-12)


def slide(scene: str, *, contact_bias: bool) -> float:
    """How fast [m/s] the soles of a robot slide whose legs fold at 6 rad/s, 10 ms after they stood."""
    params = SimulatorParameters.model_validate({"ground": {"scene": scene, "platform_edge": 0.5}})
    model = build_mujoco_model(
        ROBOT, scene=params.build_scene(ROBOT), variation=Variation(contact_stiffness=0.25)
    )
    data = mujoco.MjData(model)
    place_standing_on(model, data, params)
    jacobian = jacobian_of_points(model, data)
    wanted = np.zeros(model.nv)
    for joint in ROBOT.joints:
        if "hip_pitch" in joint.name:
            wanted[model.joint(joint.name).dofadr[0]] = -6.0
    data.qvel[:] = wanted - np.linalg.pinv(jacobian) @ (jacobian @ wanted)
    assert np.abs(data.qvel).max() > 2.0
    first, second = (call.run for call in step_calls(model, data))
    if contact_bias:
        first = ContactBias(model, data).begin_step
    for _ in range(20):
        first()
        second()
    speeds = (jacobian_of_points(model, data) @ data.qvel).reshape(-1, 3)
    return float(np.abs(speeds[:, :2]).max())


def place_standing_on(
    model: mujoco.MjModel, data: mujoco.MjData, params: SimulatorParameters
) -> None:
    base = BASES[ROBOT.base_joint](data)
    normal = params.build_scene(ROBOT).normal(0.0, 0.0)
    set_standing_pose(model, data, base, ROBOT, np.zeros(3), False, normal)
    base.shift(np.array([0.0, 0.0, -2e-4]))
    mujoco.mj_step1(model, data)


def jacobian_of_points(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Of the contact points, (3 n, n_v)."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    rows = np.zeros((len(ROBOT.contacts), 3, model.nv))
    for row, contact in zip(rows, ROBOT.contacts, strict=True):
        mujoco.mj_jacSite(model, data, row, None, model.site(contact.name).id)
    return rows.reshape(-1, model.nv)


@pytest.mark.parametrize("scene", ["flat", "platform"])
def test_soles_stand_below_moving_legs(scene: str) -> None:
    assert slide(scene, contact_bias=False) > 1e-3
    assert slide(scene, contact_bias=True) < 1e-4
