"""How a simulated robot stands before a run: its pose on the ground and the torques that hold it.

Linear algebra here is MuJoCo's own: NumPy's rounds differently from one CPU to the next, and runs
of the same seed would then differ from their first tick on.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription

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
    angle = math.sqrt(sum(float(x) ** 2 for x in attitude))
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
        data.qpos[7:] += _solve_normal(np.vstack(rows), error.ravel())
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
    # The force of least norm among those that carry the base: base_rows (base_rows' base_rows)^-1 w.
    base_rows = np.ascontiguousarray(jacobian[:, :6])
    square = np.zeros((6, 6))
    mujoco.mju_mulMatTMat(square, base_rows, base_rows)
    mujoco.mju_cholFactor(square, 0.0)
    multiplier = np.zeros(6)
    mujoco.mju_cholSolve(multiplier, square, data.qfrc_bias[:6])
    force = np.zeros(len(jacobian))
    mujoco.mju_mulMatVec(force, base_rows, multiplier)
    carried = np.zeros(model.nv)
    mujoco.mju_mulMatTVec(carried, jacobian, force)
    return np.asarray(data.qfrc_bias[6:] - carried[6:])


def _solve_normal(matrix: Array, right: Array) -> Array:
    """The least-squares solution of a full-rank overdetermined system."""
    import mujoco

    size = matrix.shape[1]
    square, projected, solution = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    mujoco.mju_mulMatTMat(square, matrix, matrix)
    mujoco.mju_mulMatTVec(projected, matrix, right)
    mujoco.mju_cholFactor(square, 0.0)
    mujoco.mju_cholSolve(solution, square, projected)
    return solution


def centre_on_origin(data: MjData, robot: RobotDescription) -> None:
    """Shift the robot horizontally so that the middle between its soles is above the origin."""
    data.qpos[:2] -= _sole_middle(data, robot)[:2]


def _sole_middle(data: MjData, robot: RobotDescription) -> Array:
    import mujoco

    middle, offset = np.zeros(3), np.zeros(3)
    for foot in robot.feet:
        body = data.body(foot.link)
        mujoco.mju_mulMatVec(offset, body.xmat.reshape(3, 3), np.array(foot.sole))
        middle += (body.xpos + offset) / len(robot.feet)
    return middle
