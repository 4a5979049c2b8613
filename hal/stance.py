"""How a simulated robot stands before a run: its pose on the ground and the torques that hold it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..runtime.description import RobotDescription

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

Array = NDArray[np.float64]


def place_standing(model: MjModel, data: MjData, robot: RobotDescription, attitude: Array) -> None:
    """Put the robot into its standing pose with the soles flat on the ground around the origin and
    the torso rotated by the rotation vector ``attitude`` [rad, world].

    The legs take the torso's rotation up (Newton's method on the contact points).

    Raises:
        ValueError: the legs cannot reach the ground with that attitude.
    """
    import mujoco

    names = [contact.name for contact in robot.contacts]
    data.qpos[:3] = 0.0
    data.qpos[3:7] = [1.0, 0.0, 0.0, 0.0]
    data.qpos[7:] = robot.standing_position
    mujoco.mj_kinematics(model, data)
    places = np.array([data.site(name).xpos for name in names])
    data.qpos[:3] -= _sole_middle(data, robot)
    places += data.qpos[:3]
    angle = float(np.linalg.norm(attitude))
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(data.qpos[3:7], attitude / angle, angle)
    jacobian = np.zeros((3, model.nv))
    for _ in range(20):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error = places - np.array([data.site(name).xpos for name in names])
        if float(np.abs(error).max()) < 1e-12:
            return
        rows = []
        for name in names:
            mujoco.mj_jacSite(model, data, jacobian, None, data.site(name).id)
            rows.append(jacobian[:, 6:].copy())
        data.qpos[7:] += np.linalg.lstsq(np.vstack(rows), error.ravel(), rcond=None)[0]
    limits = robot.joint_limits
    outside = np.any(data.qpos[7:] < limits[:, 0]) or np.any(data.qpos[7:] > limits[:, 1])
    if outside or float(np.abs(error).max()) > 1e-6:
        raise ValueError(f"{robot.name} cannot stand with its torso rotated by {attitude} rad")


def holding_torque(model: MjModel, data: MjData, robot: RobotDescription) -> Array:
    """The joint torques [N m] that hold the robot still in its present pose, with the smallest
    contact forces at the contact points that carry its weight."""
    import mujoco

    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3 * len(robot.contacts), model.nv))
    for k, contact in enumerate(robot.contacts):
        rows = jacobian[3 * k : 3 * k + 3]
        mujoco.mj_jacSite(model, data, rows, None, data.site(contact.name).id)
    force = np.linalg.lstsq(jacobian[:, :6].T, data.qfrc_bias[:6], rcond=None)[0]
    return np.asarray(data.qfrc_bias[6:] - jacobian[:, 6:].T @ force)


def centre_on_origin(data: MjData, robot: RobotDescription) -> None:
    """Shift the robot horizontally so that the middle between its soles is above the origin."""
    data.qpos[:2] -= _sole_middle(data, robot)[:2]


def _sole_middle(data: MjData, robot: RobotDescription) -> Array:
    soles = [
        data.body(foot.link).xpos + data.body(foot.link).xmat.reshape(3, 3) @ foot.sole
        for foot in robot.feet
    ]
    return np.asarray(np.mean(soles, axis=0))
