"""How a simulated robot is made to stand before a run: its pose and the torques that hold it.

The linear algebra here is MuJoCo's own, because NumPy's rounds differently from one CPU to the
next, and then runs of the same seed would differ from their first tick on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet, joints_above, standing_heights
from ...runtime.language.errors import BlockError
from .base import FixedBase
from .mujoco_model import body_name

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


UNEVEN = 0.002
"""The largest difference in height of contact points in the standing pose [m]."""
_SINGULAR = 1e-12
_DAMPING = 1e-8


class StartError(BlockError):
    """A simulated robot cannot start a run as its description says it stands."""


def place_standing(
    model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription, attitude: Array
) -> None:
    """Put the robot into its standing pose with the soles flat on the ground around the origin and
    the base rotated by the rotation vector ``attitude`` [rad, world].

    The legs take the base's rotation up (Newton's method on the contact points). A robot without
    feet is put down upright on its lowest shape instead; a fixed base stays where it is.

    Raises:
        StartError: the contact points are not at one height in the standing pose, the legs cannot
            reach the ground with that attitude, or there is nothing to put the robot down on.
    """
    import mujoco

    data.qpos[base.positions :] = robot.standing_position
    base.place()
    mujoco.mj_kinematics(model, data)
    if base.velocities == 0:
        return
    if not robot.contacts:
        _put_down(model, data, base, robot)
        return
    uneven = uneven_contacts(robot)
    if uneven:
        raise StartError(uneven)
    names = [contact.name for contact in robot.contacts]
    places = np.array([data.site(name).xpos for name in names])
    below = depth_of_contacts(robot)
    down = -_sole_middle(data, robot)
    height = float((places[:, 2] - below).mean() + down[2])
    if abs(height) > 1e-9:  # the sole centre is not at the height of the contact points
        down[2] -= height
    base.shift(down)
    places += down
    base.turn(attitude)
    legs = _leg_joints(robot)
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
            rows.append(jacobian[:, base.velocities + legs])
        data.qpos[base.positions + legs] += _solve_normal(np.vstack(rows), error.ravel())
    position, limits = data.qpos[base.positions :], robot.joint_limits
    outside = np.any(position < limits[:, 0]) or np.any(position > limits[:, 1])
    if outside or float(np.abs(error).max()) > 1e-6:
        raise StartError(
            f"{robot.name} cannot stand with its torso rotated by {attitude} rad and its feet where "
            "they are in the standing pose; legs of fewer than five joints cannot take up any "
            "attitude: set initial_attitude_error to 0"
        )


def uneven_contacts(robot: RobotDescription) -> str:
    """A text that says which contact points are above the lowest one in the standing pose, so that
    the robot cannot stand on level ground; empty if all are at one height."""
    heights = standing_heights(robot)
    above = heights - heights.min(initial=np.inf)
    if float(above.max(initial=0.0)) <= UNEVEN:
        return ""
    found = [
        f"{contact.name} by {1e3 * height:.0f} mm"
        for contact, height in zip(robot.contacts, above.tolist(), strict=True)
        if height > UNEVEN
    ]
    return (
        f"{robot.name} cannot stand on level ground: in its standing pose these contact points are "
        f"above the lowest one: {', '.join(found)}"
    )


def holding_torque(model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription) -> Array:
    """The joint torques [N m] (n_joints,) that hold the robot still in its present pose, with the
    smallest contact forces that carry its weight."""
    import mujoco

    mujoco.mj_forward(model, data)
    size = base.velocities
    if size == 0 or not robot.contacts:
        return np.array(data.qfrc_bias[size:])
    below = depth_of_contacts(robot)
    jacobian = np.zeros((3 * len(robot.contacts), model.nv))
    for k, contact in enumerate(robot.contacts):
        rows = jacobian[3 * k : 3 * k + 3]
        place = data.site(contact.name).xpos - [0.0, 0.0, below[k]]
        mujoco.mj_jac(model, data, rows, None, place, int(model.site(contact.name).bodyid[0]))
    # The force of least norm that carries the base: base_rows (base_rows' base_rows)^-1 w.
    base_rows = np.ascontiguousarray(jacobian[:, :size])
    square, multiplier = np.zeros((size, size)), np.zeros(size)
    mujoco.mju_mulMatTMat(square, base_rows, base_rows)
    _solve_positive(square, np.array(data.qfrc_bias[:size]), multiplier)
    force = np.zeros(len(jacobian))
    mujoco.mju_mulMatVec(force, base_rows, multiplier)
    carried = np.zeros(model.nv)
    mujoco.mju_mulMatTVec(carried, jacobian, force)
    return np.asarray(data.qfrc_bias[size:] - carried[size:])


def centre_on_origin(data: MjData, base: FixedBase, robot: RobotDescription) -> None:
    """Shift the robot horizontally so that the middle between its soles is above the origin; a
    robot without feet stays where it is."""
    if robot.feet:
        offset = -_sole_middle(data, robot)
        offset[2] = 0.0
        base.shift(offset)


def depth_of_contacts(robot: RobotDescription) -> Array:
    """How far every contact point is below its site in the simulator's model [m], (n_contacts,).

    For a foot that is one ball this is the ball's radius, because the site is at the ball's centre;
    for all other points it is zero.
    """
    below = np.zeros(len(robot.contacts))
    for ball in ball_feet(robot):
        below[ball.point] = ball.radius
    return below


def _leg_joints(robot: RobotDescription) -> NDArray[np.int64]:
    """The indices of the joints that move a foot."""
    legs = np.zeros(len(robot.joints), dtype=np.bool_)
    for foot in robot.feet:
        legs |= joints_above(robot, foot.link)
    return np.flatnonzero(legs)


def _put_down(model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription) -> None:
    """Lower the robot until its lowest shape touches the ground."""
    lowest = np.inf
    for link in robot.links:
        for k, shape in enumerate(link.shapes):
            geom = data.geom(f"{link.name}/{k}")
            half = float(model.geom(f"{link.name}/{k}").size[1])
            reach = abs(half * geom.xmat.item(8)) + shape.radius
            lowest = min(lowest, geom.xpos.item(2) - reach)
    if lowest == np.inf:
        raise StartError(
            f"{robot.name} has neither feet nor shapes to rest on; give its description feet and "
            "contacts, shapes, or `base_joint: fixed`"
        )
    base.shift(np.array([0.0, 0.0, -lowest]))


def _solve_normal(matrix: Array, right: Array) -> Array:
    """The least-squares solution of an overdetermined system, damped where it is singular."""
    import mujoco

    size = matrix.shape[1]
    square, projected, solution = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    mujoco.mju_mulMatTMat(square, np.ascontiguousarray(matrix), np.ascontiguousarray(matrix))
    mujoco.mju_mulMatTVec(projected, np.ascontiguousarray(matrix), right)
    _solve_positive(square, projected, solution)
    return solution


def _solve_positive(square: Array, right: Array, solution: Array) -> None:
    """Solve a symmetric positive definite system; a singular one is damped a little."""
    import mujoco

    largest = float(np.diag(square).max())
    factor = square.copy()
    if mujoco.mju_cholFactor(factor, _SINGULAR * largest) < len(square):
        factor = square + np.eye(len(square)) * (_DAMPING * largest)
        mujoco.mju_cholFactor(factor, 0.0)
    mujoco.mju_cholSolve(solution, factor, right)


def _sole_middle(data: MjData, robot: RobotDescription) -> Array:
    import mujoco

    middle, offset = np.zeros(3), np.zeros(3)
    soles = [np.array(foot.sole) for foot in robot.feet]
    for ball in ball_feet(robot):  # the lowest point is straight below the centre
        soles[ball.foot] = ball.centre
    for foot, sole in zip(robot.feet, soles, strict=True):
        body = data.body(body_name(foot.link))
        mujoco.mju_mulMatVec(offset, body.xmat.reshape(3, 3), sole)
        middle += (body.xpos + offset) / len(robot.feet)
    return middle
