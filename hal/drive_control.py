"""The control loops in a robot's drives, real or simulated: their gains, and the goals of each command.

A drive in direct-force mode closes a loop with fixed gains on its own motor::

    current = goal_iq + P (goal_position - position) + D (goal_velocity - velocity)

The gains are registers that can be written only while the torque is off, but the command's gains
differ from tick to tick: zero where a leg stands, large where it swings. So the goals are chosen
such that, at the instant of the measurement, the joints get exactly the torque that the command
asks for, and the drive's own loop acts on as much of the error as the command's gains allow::

    phi_goal  = phi + phi' T + s (phi_d - phi)     s: share of the drive's stiffness, 0 to 1
    phi_goal' = phi' + d (phi_d' - phi')           d: share of its damping
    kappa     = A^-T (tau + Kp (q_d - q) + Kd (q_d' - q')) - s P (phi_d - phi) - d D (phi_d' - phi')

With the gains that the drives were given, ``s`` and ``d`` are 1 and ``kappa`` is the feedforward
alone: the whole feedback runs in the drives. With zero gains both are 0: the goals then are the
measured motion, carried on by the time ``T`` that passes until they arrive, and the drive adds no
torque of its own. What the drives cannot give, such as different gains on coupled joints, is left
in ``kappa`` and runs at the rate of the bus instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple, Protocol

import numpy as np

from ..mathematics.arrays import Array, Array1D, Array2D
from ..mathematics.compiling.kernel_call import KernelCall
from ..mathematics.kernel import kernel
from ..mathematics.linear_algebra import multiply_vector, product
from ..robots.robot_description import RobotDescription
from ..robots.transmission import MotorGains, motor_gains
from ..runtime.language.block import UnmetRequirement
from ..runtime.language.parameters import Parameters, parameter
from ..runtime.language.per_joint import PerJoint

_REACH = 3.0
"""How far from its target a joint is [rad] where the default stiffness asks for the peak torque.
BRUCE's joints get 3.5 N m/rad, as in its maker's own program; stiffer drives hinder a thrust, since
their goals are as old as a period of the bus."""
_DAMPING_TIME = 0.025
"""The default damping as a time of the stiffness [s]."""


class DriveGains(Parameters):
    """The gains of the joints that the drives' own loops are set for."""

    stiffness: PerJoint | None = parameter(
        None, unit="N m/rad", ge=0.0,
        text="joint stiffness that runs in the drives; none: the motors' peak torque at 3 rad",
    )  # fmt: skip
    damping: PerJoint | None = parameter(
        None, unit="N m s/rad", ge=0.0,
        text="joint damping that runs in the drives; none: the stiffness times 0.025 s",
    )  # fmt: skip
    gains: Literal["exact", "nearest"] = parameter(
        "exact",
        text="if no motor gains give these joints' gains: refuse them, or take the nearest and let "
        "the driver add what is lost at the rate of the bus",
    )


def joint_gains(params: DriveGains, robot: RobotDescription) -> tuple[Array, Array]:
    """The joints' gains that are to run in the drives [N m/rad, N m s/rad], each (n_joints,)."""
    peak = product(np.abs(robot.joint_to_motor).T, robot.motors.peak_torque)
    default = motor_gains(robot, peak / _REACH, "N m/rad")
    own = np.diag(default.joint).copy()
    stiffness = own if params.stiffness is None else params.stiffness.resolve(robot)
    damping = _DAMPING_TIME * stiffness
    if params.damping is not None:
        damping = params.damping.resolve(robot)
    return stiffness, damping


def gain_requirements(params: DriveGains, robot: RobotDescription) -> Iterator[UnmetRequirement]:
    """Report gains that no drives can give the joints, unless the nearest ones are asked for."""
    if params.gains == "nearest":
        return
    for name, given, gains in zip(
        ("stiffness", "damping"), (params.stiffness, params.damping),
        joint_gains(params, robot), strict=True,
    ):  # fmt: skip
        if given is None:
            continue
        found = motor_gains(robot, gains, "N m/rad" if name == "stiffness" else "N m s/rad")
        if not found.exact:
            yield UnmetRequirement(
                f"no motor gains give {robot.name}'s joints this {name}, because motors share "
                f"joints; with the nearest ones {_some(found)}",
                parameter=name,
                expected="gains with joint_to_motor^-T diag(gains) joint_to_motor^-1 diagonal",
                fix="gains: nearest",
            )


def lost_gains(params: DriveGains, robot: RobotDescription) -> dict[str, str]:
    """What the drives do not give of the gains that the graph names, as a metric; empty if nothing."""
    found = [
        text
        for given, gains, unit in zip(
            (params.stiffness, params.damping), joint_gains(params, robot), ("N m/rad", "N m s/rad"),
            strict=True,
        )
        if given is not None
        for text in motor_gains(robot, gains, unit).losses
    ]  # fmt: skip
    return {"lost_drive_gains": "; ".join(found)} if found else {}


def _some(gains: MotorGains, limit: int = 4) -> str:
    text = ", ".join(gains.losses[:limit])
    more = len(gains.losses) - limit
    return f"{text} and {more} more" if more > 0 else text


class Targets(NamedTuple):
    """What some commands say of the joints: ``JointTargets``, each (n_commands, n_joints)."""

    torque: Array2D
    position: Array2D
    velocity: Array2D
    stiffness: Array2D
    damping: Array2D


class Gears(NamedTuple):
    """Between joints and drives: ``to_motor``, ``torque_to_motor`` and ``torque_to_joint`` (n, n), the
    gains of the joints that the drives were set for, ``stiffness`` and ``damping`` (n,), the drives' own
    gains at the motors' outputs, ``motor_stiffness`` and ``motor_damping`` (n,), and the ``lead`` [s]."""

    to_motor: Array2D
    torque_to_motor: Array2D
    torque_to_joint: Array2D
    stiffness: Array1D
    damping: Array1D
    motor_stiffness: Array1D
    motor_damping: Array1D
    lead: float


class Goals(NamedTuple):
    """The goals of every motor [N m, rad, rad/s], each (n,)."""

    torque: Array1D
    position: Array1D
    velocity: Array1D


class MeasuredMotion(NamedTuple):
    """The measured motion of motors and joints [rad, rad/s], each (n,)."""

    position: Array1D
    velocity: Array1D
    joint_position: Array1D
    joint_velocity: Array1D


class TrackingErrors(NamedTuple):
    """Scratch, each (n,): the joints' errors, and the torque that is asked of them."""

    position: Array1D
    velocity: Array1D
    torque: Array1D


@kernel
def smallest_share(gears: Gears, motor: int, commanded: Array1D, drives: Array1D) -> float:
    """Of a motor, the least share of the drives' gains among the joints it moves."""
    share = 1.0
    for joint in range(commanded.shape[0]):
        own = drives[joint]
        if gears.to_motor[motor, joint] != 0.0 and own > 0.0:
            share = min(share, commanded[joint] / own)
    return share


@kernel
def make_goals(
    gears: Gears,
    targets: Targets,
    row: int,
    measured: MeasuredMotion,
    goals: Goals,
    errors: TrackingErrors,
) -> None:
    """The goals of all drives for the command in a row of ``targets``: see the module."""
    stiffness, damping = targets.stiffness[row], targets.damping[row]
    for k in range(errors.torque.shape[0]):
        position = targets.position[row, k] - measured.joint_position[k]
        velocity = targets.velocity[row, k] - measured.joint_velocity[k]
        errors.position[k], errors.velocity[k] = position, velocity
        requested = position * stiffness[k] + targets.torque[row, k]
        errors.torque[k] = requested + velocity * damping[k]
    multiply_vector(gears.torque_to_motor, errors.torque, goals.torque)
    multiply_vector(gears.to_motor, errors.position, goals.position)
    multiply_vector(gears.to_motor, errors.velocity, goals.velocity)
    for k in range(errors.torque.shape[0]):
        angle, speed = measured.position[k], measured.velocity[k]
        share = smallest_share(gears, k, stiffness, gears.stiffness)
        error = goals.position[k] * share
        # Where the drive follows the target by itself, its goal needs no lead.
        goals.position[k] = error + angle + (1.0 - share) * speed * gears.lead
        torque = goals.torque[k] - error * gears.motor_stiffness[k]
        error = goals.velocity[k] * smallest_share(gears, k, damping, gears.damping)
        goals.torque[k] = torque - error * gears.motor_damping[k]
        goals.velocity[k] = error + speed


class JointTargets(Protocol):
    """What a command says of the joints: ``JointCommand`` without its mode, each (n_joints,)."""

    @property
    def torque(self) -> Array: ...
    @property
    def position(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...
    @property
    def stiffness(self) -> Array: ...
    @property
    def damping(self) -> Array: ...


class DriveGoals:
    """The goals of all drives for one command.

    Args:
        robot: the description.
        stiffness, damping: the joints' gains that the drives were set for [N m/rad, N m s/rad].
        motor_stiffness, motor_damping: the drives' own gains, at the motors' outputs.
        lead: the time from a measurement to when the goals made from it act [s].

    Attributes:
        torque, position, velocity: the goals of every motor [N m, rad, rad/s], (n_joints,).
    """

    def __init__(
        self, robot: RobotDescription, stiffness: Array, damping: Array, motor_stiffness: Array,
        motor_damping: Array, lead: float,
    ) -> None:  # fmt: skip
        n = len(robot.joints)
        self.gears = gears_of(robot, stiffness, damping, motor_stiffness, motor_damping, lead)
        self.torque, self.position, self.velocity = (np.zeros(n) for _ in range(3))
        self._targets = Targets(*(np.zeros((1, n)) for _ in Targets._fields))
        self._measured = MeasuredMotion(*(np.zeros(n) for _ in MeasuredMotion._fields))
        self._make = KernelCall(
            make_goals, self.gears, self._targets, 0, self._measured,
            Goals(self.torque, self.position, self.velocity),
            TrackingErrors(*(np.zeros(n) for _ in TrackingErrors._fields)),
        )  # fmt: skip

    def follow(
        self, command: JointTargets, position: Array, velocity: Array, joint_position: Array,
        joint_velocity: Array,
    ) -> None:  # fmt: skip
        """Set the goals for an active command and the measured motion of motors and joints."""
        targets, measured = self._targets, self._measured
        targets.torque[0], targets.position[0] = command.torque, command.position
        targets.velocity[0] = command.velocity
        targets.stiffness[0], targets.damping[0] = command.stiffness, command.damping
        measured.position[:], measured.velocity[:] = position, velocity
        measured.joint_position[:], measured.joint_velocity[:] = joint_position, joint_velocity
        self._make.run()

    def hold(self, position: Array) -> None:
        """Set the goals to motor angles [rad] at rest, without any torque of their own."""
        self.torque.fill(0.0)
        self.position[:] = position
        self.velocity.fill(0.0)


def gears_of(
    robot: RobotDescription, stiffness: Array, damping: Array, motor_stiffness: Array,
    motor_damping: Array, lead: float,
) -> Gears:  # fmt: skip
    """The gears of a robot; arguments as for ``DriveGoals``."""
    matrix = np.ascontiguousarray(robot.joint_to_motor)
    return Gears(
        matrix, np.ascontiguousarray(robot.torque_to_motor), np.ascontiguousarray(matrix.T),
        np.array(stiffness), np.array(damping), np.array(motor_stiffness),
        np.array(motor_damping), float(lead),
    )  # fmt: skip
