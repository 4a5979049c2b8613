from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from aloft.hal.simulated.base import FloatingBase
from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.hal.simulated.stance import (
    StartError,
    centre_on_origin,
    holding_torque,
    place_standing,
)
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
MODEL = build_mujoco_model(ROBOT)


def placed(attitude: Any) -> Any:
    data = mujoco.MjData(MODEL)
    place_standing(MODEL, data, FloatingBase(data), ROBOT, np.array(attitude))
    mujoco.mj_forward(MODEL, data)
    return data


@pytest.mark.parametrize("attitude", [[0, 0, 0], [0.03, 0, 0], [0, -0.03, 0], [0.01, 0.02, -0.03]])
def test_soles_are_flat_on_the_ground_under_a_turned_torso(attitude: Any) -> None:
    data = placed(attitude)
    places = np.array([data.site(contact.name).xpos for contact in ROBOT.contacts])
    np.testing.assert_allclose(places[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(places[:, 0], [0.0425, -0.0425] * 2, atol=1e-9)
    half = np.linalg.norm(attitude) / 2
    assert np.linalg.norm(data.qpos[4:7]) == pytest.approx(np.sin(half))


def test_holding_torque_leaves_no_acceleration() -> None:
    data = placed([0.0, 0.01, 0.0])
    torque = holding_torque(MODEL, data, FloatingBase(data), ROBOT)
    jacobian = np.zeros((3, MODEL.nv))
    rows = []
    for contact in ROBOT.contacts:
        mujoco.mj_jacSite(MODEL, data, jacobian, None, data.site(contact.name).id)
        rows.append(jacobian.copy())
    matrix = np.vstack(rows)
    left = data.qfrc_bias - np.concatenate([np.zeros(6), torque])
    force = np.linalg.lstsq(matrix.T, left, rcond=None)[0]
    np.testing.assert_allclose(matrix.T @ force, left, atol=1e-9)
    assert force.reshape(-1, 3)[:, 2].sum() == pytest.approx(5.118 * 9.81)


def test_centring() -> None:
    data = placed([0.0, 0.0, 0.0])
    data.qpos[:2] += [0.3, -0.2]
    mujoco.mj_kinematics(MODEL, data)
    centre_on_origin(data, FloatingBase(data), ROBOT)
    mujoco.mj_kinematics(MODEL, data)
    places = np.array([data.site(contact.name).xpos for contact in ROBOT.contacts])
    np.testing.assert_allclose(places[:, :2].mean(axis=0), 0.0, atol=1e-12)


def test_an_attitude_the_legs_cannot_take_up_is_an_error() -> None:
    with pytest.raises(StartError, match="bruce cannot stand with its torso rotated by"):
        placed([1.2, 0.0, 0.0])
