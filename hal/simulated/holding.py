"""How stiffly the drives of a simulated robot hold its pose before the first command.

The gains follow from the robot, so that a robot of 2 kg and one of 100 kg are held alike:

* A joint of a leg carries the robot, which would topple about it like an inverted pendulum of
  gravity stiffness ``m g h``, with the mass ``m`` and the height ``h`` of the centre of mass above
  the ground. It is held 18 times as stiffly, with 5 ms of that stiffness as damping.
* Any other joint is held at a natural frequency of 60 rad/s, critically damped, for the inertia
  that the mass matrix says it has in the standing pose.

Both gains are bounded so that the drive's loop is stable. It is closed once in every physics step
of ``dt`` on the inertia ``I`` of the joint with all others free, so the stiffness is at most
``I / (4 dt^2)`` and the damping at most ``I / dt``. Apart from that bound, the gains do not depend
on what is drawn from the seed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...robots.description import RobotDescription
from ...robots.kinematics import joints_above, standing_com, standing_heights
from .base import BASES

if TYPE_CHECKING:
    from mujoco import MjModel


GRAVITY_SHARE = 18.0
DAMPING_TIME = 0.005
NATURAL_FREQUENCY = 60.0
RELEASED = 1.0 / 3.0
"""The damping of a drive in its damping mode, as a share of its damping while it holds the pose."""


def holding_gains(model: MjModel, robot: RobotDescription) -> tuple[Array, Array]:
    """The stiffness [N m/rad] and damping [N m s/rad] of every joint, each (n_joints,)."""
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
            legs |= joints_above(robot, foot.link)
        height = float(standing_com(robot)[2] - standing_heights(robot).min())
        needed = _two_digits(GRAVITY_SHARE * robot.total_mass * GRAVITY * max(height, 0.01))
        stiffness[legs], damping[legs] = needed, DAMPING_TIME * needed
    step = float(model.opt.timestep)
    return np.minimum(stiffness, 0.25 * free / step**2), np.minimum(damping, free / step)


def passive_joints(robot: RobotDescription) -> NDArray[np.int64]:
    """The joints that no motor can move: all motors geared to them have a peak torque of zero."""
    driven = (robot.joint_to_motor[robot.motors.peak_torque > 0.0] != 0.0).any(axis=0)
    return np.flatnonzero(~driven)


def _two_digits(value: float) -> float:
    """The value rounded to two significant digits, so that it is the same on every machine."""
    return float(f"{value:.1e}") if math.isfinite(value) else value
