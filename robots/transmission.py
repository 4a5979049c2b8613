"""Transmission between joints and motors: motion and torque both ways, and the gains that motors can give.

With the transmission's matrix ``A`` (``RobotDescription.joint_to_motor``) and the joints' angles
``q``, torques ``tau`` and feedback gains ``K``::

    motor angle phi = A q        motor velocity phi' = A q'        motor torque kappa = A^-T tau
    joint angle q = A^-1 phi     joint velocity q' = A^-1 phi'     joint torque tau = A^T kappa

so that the power ``kappa . phi' = tau . q'`` is the same on both sides. A drive closes its loop on
its own motor. With gains ``P`` (one a motor) the joints feel the stiffness ``A^T diag(P) A``, which
for motors that share joints is not diagonal: not every set of joint gains can be given by drives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.linear_algebra import inverse, product
from .robot_description import RobotDescription

_SWEEPS = 10_000
_CONVERGED = 1e-15
_SMALL = 1e-9
"""The share of a gain that is lost to rounding only."""


PLAY_TORQUE = 0.1
"""The torque [N m] that holds a rotor at three quarters of the width of its play."""
PLAY_TIME = 0.005
"""The time constant in which a rotor crosses its play [s]: BRUCE's, 10 mrad wide, takes 6 ms at 1 N m. If it
took none, the drive's loop around the encoder would chatter between both ends."""
SLIDING_SPEED = 0.2
"""The speed [rad/s] at which the load friction of a gear has three quarters of its size."""


class TransmissionMap:
    """The products of a robot's transmission, without allocating arrays.

    All arrays have one element a joint or one a motor, of which there are as many. ``out`` must not
    be one of the arguments.
    """

    def __init__(self, robot: RobotDescription) -> None:
        matrix = robot.joint_to_motor
        self._to_motor = np.ascontiguousarray(matrix)
        self._to_joint = inverse(matrix)
        self._torque_to_motor = robot.torque_to_motor
        self._torque_to_joint = np.ascontiguousarray(matrix.T)

    def motor_motion(self, joint: Array, out: Array) -> None:
        """Write the motors' angles [rad] or velocities [rad/s] for those of the joints."""
        np.dot(self._to_motor, joint, out=out)

    def joint_motion(self, motor: Array, out: Array) -> None:
        """Write the joints' angles [rad] or velocities [rad/s] for those of the motors."""
        np.dot(self._to_joint, motor, out=out)

    def motor_torque(self, joint: Array, out: Array) -> None:
        """Write the motors' torques [N m] for those of the joints."""
        np.dot(self._torque_to_motor, joint, out=out)

    def joint_torque(self, motor: Array, out: Array) -> None:
        """Write the joints' torques [N m] for those of the motors."""
        np.dot(self._torque_to_joint, motor, out=out)


@dataclass(frozen=True)
class MotorGains:
    """The gains of the drives that come nearest to wanted gains of the joints.

    Attributes:
        motor: one gain a motor, at its output, (n_joints,).
        joint: the matrix of gains that the joints feel, ``A^T diag(motor) A``.
        wanted: the joints' gains that were asked for, (n_joints,).
        losses: one text for every joint or pair of joints whose gain is another.
    """

    motor: Array
    joint: Array
    wanted: Array
    losses: tuple[str, ...]

    @property
    def exact(self) -> bool:
        """True if the drives give the joints exactly the wanted gains."""
        return not self.losses


def motor_gains(robot: RobotDescription, wanted: Array, unit: str) -> MotorGains:
    """Return the gains of the drives for the wanted gains of the joints.

    Where no set of motor gains gives them, these are the non-negative ones with the least sum of
    squared errors of the joints' matrix, in which the error of the pair of joints (i, j) is taken
    relative to ``sqrt(wanted_i wanted_j)``.

    Args:
        robot: the description with the transmission.
        wanted: stiffness or damping of every joint, not negative, (n_joints,).
        unit: the gains' unit, for the texts in ``losses``.
    """
    matrix = robot.joint_to_motor
    largest = float(wanted.max(initial=0.0))
    if largest <= 0.0:
        return MotorGains(0.0 * wanted, 0.0 * matrix, wanted.copy(), ())
    floor = 1e-3 * largest
    scale = 1.0 / np.sqrt(np.maximum(wanted, floor))
    scaled = matrix * scale
    columns = np.stack([np.outer(row, row).ravel() for row in scaled], axis=1)
    target = np.diag(wanted * scale**2).ravel()
    motor = _non_negative_least_squares(columns, target)
    joint = product(matrix.T * motor, matrix)
    losses = _losses(robot, wanted, joint, unit, floor)
    return MotorGains(motor, joint, wanted.copy(), losses)


def _non_negative_least_squares(columns: Array, target: Array) -> Array:
    """Return the ``x >= 0`` with the least ``|columns x - target|``, one element after the other in turn; the problem
    is convex and its columns are independent, so this ends at the minimum.
    """
    products, slope = product(columns.T, columns), product(columns.T, target)
    found = np.zeros(len(slope))
    for _ in range(_SWEEPS):
        largest = 0.0
        for k in range(len(found)):
            if products[k, k] > 0.0:
                rest = slope[k] - product(products[k], found) + products[k, k] * found[k]
                value = max(0.0, float(rest / products[k, k]))
                largest = max(largest, abs(value - found[k]))
                found[k] = value
        if largest <= _CONVERGED * float(found.max(initial=0.0)):
            break
    return found


def _losses(
    robot: RobotDescription, wanted: Array, joint: Array, unit: str, floor: float
) -> tuple[str, ...]:
    names = [each.name for each in robot.joints]
    found = []
    for i, name in enumerate(names):
        if abs(joint[i, i] - wanted[i]) > _SMALL * max(wanted[i], floor):
            found.append(f"{name} has {joint[i, i]:.4g} instead of {wanted[i]:.4g} {unit}")
        for j in range(i + 1, len(names)):
            if abs(joint[i, j]) > _SMALL * max(np.sqrt(wanted[i] * wanted[j]), floor):
                found.append(f"{name} and {names[j]} are coupled by {joint[i, j]:.4g} {unit}")
    return tuple(found)
