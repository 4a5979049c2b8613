"""The standing start of a simulated robot before a run: its pose, and the torques and gains that hold it.

The linear algebra here is MuJoCo's own, because NumPy's rounds differently from one CPU to the
next, and then runs of the same seed would differ from their first tick on.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.linear_algebra import product
from ...robots.description import Hull, RobotDescription
from ...robots.kinematics import ball_feet, joints_above, standing_com, standing_heights
from ...robots.terrain import Vector
from ...runtime.language.errors import BlockError
from .base import BASES, FixedBase
from .unsupported import uneven_contacts

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


UPWARDS: Vector = (0.0, 0.0, 1.0)
"""The normal of level ground."""
_REACHED = 1e-12
"""m; what the legs leave between contact points and their places."""
_LEAN_ROUNDS = 12
"""Of the search for the base's place on ground that leans."""
_SINGULAR = 1e-12
_DAMPING = 1e-8


class StartError(BlockError):
    """A simulated robot cannot start a run as it stands by its description."""


def set_standing_pose(
    model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription, attitude: Array,
    level: bool = False, normal: Vector = UPWARDS,
) -> None:  # fmt: skip
    """Put the robot into its standing pose with the soles flat on the ground around the origin and
    the base rotated by the rotation vector ``attitude`` [rad, world].

    The legs take the base's rotation up (Newton's method on the contact points), and with ``level``
    also what links longer or shorter than described leave between soles and ground. Where the ground leans
    (``normal`` [world]) base and centre of mass are as the planner has them, see ``StanceFinder``. A robot without
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
        _lower(model, data, base, robot)
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
    if level:
        places[:, 2] = below
    if normal != UPWARDS:
        _lean_ground(model, data, base, robot, places, normal)
    base.turn(attitude)
    error = _reach(model, data, base, robot, places)
    if error < _REACHED:
        return
    position, limits = data.qpos[base.positions :], robot.joint_limits
    outside = np.any(position < limits[:, 0]) or np.any(position > limits[:, 1])
    if outside or error > 1e-6:
        raise StartError(
            f"{robot.name} cannot stand with its torso rotated by {attitude} rad and its feet where "
            "they are in the standing pose; legs of fewer than five joints cannot take up any "
            "attitude: set initial_attitude_error to 0"
        )


def _reach(
    model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription, places: Array
) -> float:
    """Move the legs until the contact points are at their ``places`` (n_contacts, 3) [m, world]; returns
    what is missing [m]."""
    import mujoco

    names, legs = [contact.name for contact in robot.contacts], _leg_joints(robot)
    jacobian = np.zeros((3, model.nv))
    for _ in range(20):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error = places - np.array([data.site(name).xpos for name in names])
        if float(np.abs(error).max()) < _REACHED:
            break
        rows = []
        for name in names:
            mujoco.mj_jacSite(model, data, jacobian, None, data.site(name).id)
            rows.append(jacobian[:, base.velocities + legs])
        data.qpos[base.positions + legs] += _solve_normal(np.vstack(rows), error.ravel())
    return float(np.abs(error).max())


def _lean_ground(
    model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription, places: Array,
    normal: Vector,
) -> None:  # fmt: skip
    """Turn the ``places`` of the contact points on level ground onto ground with that normal, lower the
    base as far as the lowest sole is, and move it until the centre of mass is where it was."""
    import mujoco

    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    com = data.subtree_com[0].copy()
    x, y, z = normal
    ahead = math.hypot(x, z)
    turn = np.array(
        [[z / ahead, -x * y / ahead, x], [0.0, ahead, y], [-x / ahead, -y * z / ahead, z]]
    )
    soles = np.array(_soles(data, robot))
    lowest = min(product(turn, sole).item(2) for sole in soles)
    base.shift(np.array([0.0, 0.0, min(0.0, lowest)]))
    places[:] = [product(turn, place) for place in places]
    for _ in range(_LEAN_ROUNDS):
        _reach(model, data, base, robot, places)
        missed = com - data.subtree_com[0]
        missed[2] = 0.0
        if float(np.abs(missed).max()) < 1e-10:
            break
        base.shift(missed)


def holding_torque(
    model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription, hangs: bool = False
) -> Array:
    """Return the joint torques [N m] (n_joints,) that hold the robot still in its present pose, with the smallest
    contact forces that carry its weight, or with none where it ``hangs`` by its base."""
    import mujoco

    mujoco.mj_forward(model, data)
    size = base.velocities
    if size == 0 or hangs or not robot.contacts:
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


def standing_torques(robot: RobotDescription, model: MjModel) -> Array:
    """Return the motor torques [N m] (n_motors,) that hold a robot with feet still as it stands.

    Raises:
        StartError: it cannot be put on the ground.
    """
    import mujoco

    data = mujoco.MjData(model)
    base = BASES[robot.base_joint](data)
    set_standing_pose(model, data, base, robot, np.zeros(3))
    return product(robot.torque_to_motor, holding_torque(model, data, base, robot))


def joint_inertias(robot: RobotDescription, model: MjModel) -> Array:
    """Return the inertia [kg m^2, kg] (n_joints,) that every joint turns as the robot stands, rotors included, while
    its base and all other joints are still."""
    import mujoco

    data = mujoco.MjData(model)
    base = BASES[robot.base_joint](data)
    data.qpos[base.positions :] = robot.standing_position
    base.place()
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return np.asarray(np.diag(matrix)[base.velocities :])


def centre_on_origin(data: MjData, base: FixedBase, robot: RobotDescription) -> None:
    """Shift the robot horizontally so that the middle between its soles is above the origin; a
    robot without feet stays where it is."""
    if robot.feet:
        offset = -_sole_middle(data, robot)
        offset[2] = 0.0
        base.shift(offset)


def depth_of_contacts(robot: RobotDescription) -> Array:
    """Return the depth of every contact point below its site in the simulator's model [m], (n_contacts,).

    For a foot that is one ball this is the ball's radius, because the site is at the ball's centre;
    for all other points it is zero.
    """
    below = np.zeros(len(robot.contacts))
    for ball in ball_feet(robot):
        below[ball.point] = ball.radius
    return below


def _leg_joints(robot: RobotDescription) -> NDArray[np.int64]:
    """Return the indices of the joints that move a foot."""
    legs = np.zeros(len(robot.joints), dtype=np.bool_)
    for foot in robot.feet:
        legs |= np.array(joints_above(robot, foot.link), np.bool_)
    return np.flatnonzero(legs)


def put_down(
    model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription, attitude: Array
) -> None:
    """Put the robot into its standing pose, with its base turned by the rotation vector ``attitude`` [rad, world], and
    lower it until its lowest shape or contact point touches the ground, whether or not it stands so; a fixed base stays
    where it is.

    Raises:
        StartError: there is nothing to put the robot down on.
    """
    import mujoco

    data.qpos[base.positions :] = robot.standing_position
    base.place()
    if base.velocities:
        base.turn(attitude)
    mujoco.mj_kinematics(model, data)
    if base.velocities:
        _lower(model, data, base, robot)
        mujoco.mj_kinematics(model, data)


def _lower(model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription) -> None:
    """Lower the robot until its lowest shape or contact point touches the ground."""
    places = [data.geom(contact.name).xpos.item(2) - contact.radius for contact in robot.contacts]
    lowest = min(places, default=np.inf)
    for link in robot.links:
        for k, shape in enumerate(link.shapes):
            geom, form = data.geom(f"{link.name}/{k}"), model.geom(f"{link.name}/{k}")
            if isinstance(shape, Hull):
                mesh = model.mesh(int(form.dataid[0]))
                first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
                reach = -float((model.mesh_vert[first : first + count] @ geom.xmat[6:]).min())
            else:
                reach = abs(float(form.size[1]) * geom.xmat.item(8)) + shape.radius
            lowest = min(lowest, geom.xpos.item(2) - reach)
    if lowest == np.inf:
        raise StartError(
            f"{robot.name} has neither feet nor shapes to rest on; give its description feet and "
            "contacts, shapes, or `base_joint: fixed`"
        )
    base.shift(np.array([0.0, 0.0, -lowest]))


def _solve_normal(matrix: Array, right: Array) -> Array:
    """Return the least-squares solution of an overdetermined system, damped where it is singular."""
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


def _soles(data: MjData, robot: RobotDescription) -> list[Array]:
    """Return the place of each foot's sole; of a foot that is one ball, its centre."""
    import mujoco

    from .mujoco_model import body_name  # not for a check

    soles, offset, found = [np.array(foot.sole) for foot in robot.feet], np.zeros(3), list[Array]()
    for ball in ball_feet(robot):  # the lowest point is straight below the centre
        soles[ball.foot] = ball.centre
    for foot, sole in zip(robot.feet, soles, strict=True):
        body = data.body(body_name(foot.link))
        mujoco.mju_mulMatVec(offset, body.xmat.reshape(3, 3), sole)
        found.append(body.xpos + offset)
    return found


def _sole_middle(data: MjData, robot: RobotDescription) -> Array:
    middle = np.zeros(3)
    for sole in _soles(data, robot):
        middle += sole / len(robot.feet)
    return middle


GRAVITY_SHARE = 18.0
DAMPING_TIME = 0.005
NATURAL_FREQUENCY = 60.0
RELEASED = 1.0 / 3.0
"""The damping of a drive in its damping mode, as a share of its damping while it holds the pose."""


def holding_gains(model: MjModel, robot: RobotDescription, lag: float = 0.0) -> tuple[Array, Array]:
    """Return the stiffness [N m/rad] and damping [N m s/rad] that hold every joint before the first command, each
    (n_joints,).

    They follow from the robot, so that a robot of 2 kg and one of 100 kg are held alike:

    * A joint of a leg carries the robot, which would topple about it like an inverted pendulum of
      gravity stiffness ``m g h``, with the mass ``m`` and the height ``h`` of the centre of mass above
      the ground. It is held 18 times as stiffly, with 5 ms of that stiffness as damping.
    * Any other joint is held at a natural frequency of 60 rad/s, critically damped, for its inertia
      by the mass matrix in the standing pose.

    Both gains are bounded so that the drive's loop is stable. It is closed once in every physics step
    of ``dt`` on the inertia ``I`` of the joint with all others free, so the stiffness is at most
    ``I / (4 dt^2)`` and the damping at most ``I / dt``. Apart from that bound, the gains do not depend
    on what is drawn from the seed. A ``lag`` [s] of encoders and currents counts as a longer ``dt``.
    """
    import mujoco

    data = mujoco.MjData(model)
    base = BASES[robot.base_joint](data)
    base.place()
    data.qpos[base.positions :] = robot.standing_position
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    answers = np.zeros((model.nv, model.nv))
    mujoco.mj_solveM(
        model, data, answers, np.eye(model.nv)
    )  # NumPy's solver rounds differently by machine
    free = 1.0 / np.diag(answers)[base.velocities :]
    carried = np.diag(mass)[base.velocities :]
    stiffness = carried * NATURAL_FREQUENCY**2
    damping = 2.0 * carried * NATURAL_FREQUENCY
    if robot.contacts and base.velocities:
        legs = np.zeros(len(robot.joints), dtype=np.bool_)
        for foot in robot.feet:
            legs |= np.array(joints_above(robot, foot.link), np.bool_)
        height = float(standing_com(robot)[2] - standing_heights(robot).min())
        needed = _two_digits(GRAVITY_SHARE * robot.weight * max(height, 0.01))
        stiffness[legs], damping[legs] = needed, DAMPING_TIME * needed
    step = float(model.opt.timestep) + lag
    return np.minimum(stiffness, 0.25 * free / step**2), np.minimum(damping, free / step)


def passive_joints(robot: RobotDescription) -> NDArray[np.int64]:
    """Return the joints that no motor can move: all motors geared to them have a peak torque of zero."""
    driven = (robot.joint_to_motor[robot.motors.peak_torque > 0.0] != 0.0).any(axis=0)
    return np.flatnonzero(~driven)


def _two_digits(value: float) -> float:
    """Return the value rounded to two significant digits, so that it is the same on every machine."""
    return float(f"{value:.1e}") if math.isfinite(value) else value
