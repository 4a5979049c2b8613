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

**Motors as they are.** Where by ``motor_model`` a motor differs from its nominal torque constant, the
driver asks of it the nominal torque r for which it gives the torque t that the joints need::

    t = c r (1 - s (r / peak)^2) - f |r| tanh(v / v_0)

**Shares.** With the gains that the drives were given, ``s`` and ``d`` are 1 and ``kappa`` is the feedforward
alone: the whole feedback runs in the drives. With zero gains both are 0: the goals then are the
measured motion, carried on by the time ``T`` that passes until they arrive, and the drive adds no
torque of its own. What the drives cannot give, such as different gains on coupled joints, is left
in ``kappa`` and runs at the rate of the bus instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from fnmatch import fnmatchcase
from typing import Literal, NamedTuple

import numpy as np

from ..blocks.signals import JointCommand
from ..mathematics.arrays import Array, Array1D, Array2D
from ..mathematics.compiling.kernel_call import KernelCall
from ..mathematics.elementary import tanh
from ..mathematics.kernel import kernel
from ..mathematics.linear_algebra import multiply_vector, product
from ..robots.robot_description import RobotDescription
from ..robots.transmission import SLIDING_SPEED, MotorGains, motor_gains
from ..runtime.language.block import UnmetRequirement
from ..runtime.language.parameters import Parameters, parameter
from ..runtime.language.per_joint import PerJoint
from ..runtime.language.signals import Field, Signal
from ..runtime.language.steps import signal_call

_REACH = 3.0
"""Distance of a joint from its target [rad] at which the default stiffness asks for the peak torque. BRUCE's joints get
3.5 N m/rad, as in its maker's own program; stiffer drives hinder a thrust, since their goals are as old as a period of
the bus."""
_DAMPING_TIME = 0.025
"""The default damping as a time of the stiffness [s]."""


_ROUNDS = 8
"""Fixed-point rounds in which the nominal torque is found: at 12 % saturation 1e-4 of it is left."""


class MotorModel(Parameters):
    """Differences of the motors from their nominal torque constants, as far as they are known.

    Values by motor are given by name or shell pattern; later entries win, and motors that none
    matches are nominal.
    """

    torque_constant: float | dict[str, float] = parameter(
        1.0, text="factor on the nominal torque constant, of all motors or by motor"
    )
    saturation: float = parameter(
        0.0, ge=0.0, le=0.3,
        text="share of the torque that is missing at the peak torque; it grows with its square",
    )  # fmt: skip
    load_friction: float = parameter(
        0.0, ge=0.0, le=0.3, text="share of the torque that the gear loses to friction under load"
    )

    def constants(self, robot: RobotDescription) -> Array:
        """Return the factor of every motor, (n_joints,)."""
        given = self.torque_constant
        patterns = given if isinstance(given, dict) else {"*": given}
        out = np.ones(len(robot.joints))
        for k, name in enumerate(robot.transmission.motors):
            for pattern, value in patterns.items():
                if fnmatchcase(name, pattern):
                    out[k] = value
        return out

    def unmet(self, robot: RobotDescription) -> Iterator[UnmetRequirement]:
        """Report factors that are not positive, or of motors that are not there."""
        given = self.torque_constant
        for pattern, value in (given if isinstance(given, dict) else {"*": given}).items():
            place = f"motor_model.torque_constant of {pattern}"
            if not 0.5 <= value <= 2.0:
                yield UnmetRequirement(
                    f"{place} is {value:g}", parameter="motor_model",
                    expected="a factor from 0.5 to 2", found=f"{value:g}",
                    fix="the measured torque constant divided by the nominal one",
                )  # fmt: skip
            named = isinstance(given, dict)
            if named and not any(fnmatchcase(name, pattern) for name in robot.transmission.motors):
                yield UnmetRequirement(
                    f"{robot.name} has no motor {pattern}", parameter="motor_model",
                    expected=", ".join(robot.transmission.motors), found=pattern,
                )  # fmt: skip


class DriveGains(Parameters):
    """The gains of the joints that the drives' own loops are set for, and what is known of the motors."""

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
    sit_down_speed: float = parameter(
        0.0, unit="m/s", ge=0.0, le=0.5,
        text="speed at which a robot that stands at the end sits down before it is damped; zero: not",
    )  # fmt: skip
    motor_model: MotorModel = parameter(
        MotorModel, text="differences of the motors from their nominal torque constants"
    )


def joint_gains(params: DriveGains, robot: RobotDescription) -> tuple[Array, Array]:
    """Return the joints' gains that are to run in the drives [N m/rad, N m s/rad], each (n_joints,)."""
    peak = product(np.abs(robot.joint_to_motor).T, robot.motors.peak_torque)
    default = motor_gains(robot, peak / _REACH, "N m/rad")
    own = np.diag(default.joint).copy()
    stiffness = own if params.stiffness is None else params.stiffness.resolve(robot)
    damping = _DAMPING_TIME * stiffness
    if params.damping is not None:
        damping = params.damping.resolve(robot)
    return stiffness, damping


def gain_requirements(params: DriveGains, robot: RobotDescription) -> Iterator[UnmetRequirement]:
    """Report gains that no drives can give the joints, unless the nearest ones are allowed, and a model of other
    motors."""
    yield from params.motor_model.unmet(robot)
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
    """Return the losses of the drives against the gains that the graph names, as a metric; empty if there are none."""
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


class CommandTargets(Signal):
    """Targets of the joints by some commands, a row for each command."""

    torque = Field(
        ("n_queue", "n_joints"), unit="N m", text="feedforward joint torques", ring="active"
    )
    position = Field(("n_queue", "n_joints"), unit="rad", text="joint angle targets", ring="active")
    velocity = Field(
        ("n_queue", "n_joints"), unit="rad/s", text="joint velocity targets", ring="active"
    )
    stiffness = Field(
        ("n_queue", "n_joints"), unit="N m/rad", text="gains on position", ring="active"
    )
    damping = Field(
        ("n_queue", "n_joints"), unit="N m s/rad", text="gains on velocity", ring="active"
    )


class MotorGoals(Signal):
    """The goals of all drives."""

    torque = Field("n_joints", unit="N m", text="the motors' torques beside their feedback")
    position = Field("n_joints", unit="rad", text="the motors' target angles")
    velocity = Field("n_joints", unit="rad/s", text="the motors' target velocities")


class MeasuredMotion(Signal):
    """The measured motion of motors and joints."""

    position = Field("n_joints", unit="rad", text="angles of the motors")
    velocity = Field("n_joints", unit="rad/s", text="velocities of the motors")
    joint_position = Field("n_joints", unit="rad", text="angles of the joints")
    joint_velocity = Field("n_joints", unit="rad/s", text="velocities of the joints")


class GoalScratch(Signal):
    """Intermediate values of ``make_goals``."""

    position_error = Field("n_joints", unit="rad", text="of the joints, against their targets")
    velocity_error = Field("n_joints", unit="rad/s", text="of the joints, against their targets")
    joint_torque = Field("n_joints", unit="N m", text="commanded torques of the joints")


class Gears(NamedTuple):
    """Between joints and drives: ``to_motor``, ``torque_to_motor`` and ``torque_to_joint`` (n, n), the
    gains of the joints that the drives were set for, ``stiffness`` and ``damping`` (n,), the drives' own
    gains at the motors' outputs, ``motor_stiffness`` and ``motor_damping`` (n,), and the ``lead`` [s]. Of
    the motors: the factor on the torque ``constant`` and the ``peak`` torque [N m], (n,), ``saturation`` and
    ``load_friction``."""

    to_motor: Array2D
    torque_to_motor: Array2D
    torque_to_joint: Array2D
    stiffness: Array1D
    damping: Array1D
    motor_stiffness: Array1D
    motor_damping: Array1D
    lead: float
    constant: Array1D
    peak: Array1D
    saturation: float
    load_friction: float


@kernel
def nominal_torque(gears: Gears, motor: int, torque: float, speed: float) -> float:
    """Return the torque [N m] to ask of a motor by its nominal torque constant so that it gives ``torque``."""
    constant, peak = gears.constant[motor], gears.peak[motor]
    asked: float = torque / constant
    if gears.saturation > 0.0 or gears.load_friction > 0.0:
        lost = gears.load_friction * tanh(speed / SLIDING_SPEED)
        for _ in range(_ROUNDS):
            load = min(abs(asked) / peak, 1.0) if peak > 0.0 else 0.0
            asked = (torque + lost * abs(asked)) / (
                constant * (1.0 - gears.saturation * load * load)
            )
    return asked


@kernel
def true_torque(gears: Gears, motor: int, asked: float, speed: float) -> float:
    """Return the torque [N m] that a motor gives for a commanded one: the inverse of ``nominal_torque``."""
    peak = gears.peak[motor]
    load = min(abs(asked) / peak, 1.0) if peak > 0.0 else 0.0
    given: float = asked * gears.constant[motor] * (1.0 - gears.saturation * load * load)
    return given - gears.load_friction * abs(asked) * tanh(speed / SLIDING_SPEED)


class TorqueScratch(NamedTuple):
    """Torque and speed of the motors, (n_joints,)."""

    torque: Array1D
    speed: Array1D


@kernel
def correct_torque(
    gears: Gears, scratch: TorqueScratch, velocity: Array1D, torque: Array1D
) -> None:
    """Change joint torques [N m] by the nominal torque constants to those that the motors give.

    Args:
        velocity: of the joints [rad/s].
    """
    multiply_vector(gears.torque_to_motor, torque, scratch.torque)
    multiply_vector(gears.to_motor, velocity, scratch.speed)
    for k in range(torque.shape[0]):
        asked: float = scratch.torque[k]
        speed: float = scratch.speed[k]
        scratch.torque[k] = true_torque(gears, k, asked, speed)
    multiply_vector(gears.torque_to_joint, scratch.torque, torque)


@kernel
def smallest_share(gears: Gears, motor: int, commanded: Array1D, drives: Array1D) -> float:
    """Return the least share of the drives' gains among the joints that a motor moves."""
    share = 1.0
    for joint in range(commanded.shape[0]):
        own = drives[joint]
        if gears.to_motor[motor, joint] != 0.0 and own > 0.0:
            share = min(share, commanded[joint] / own)
    return share


@kernel
def make_goals(
    gears: Gears,
    commands: CommandTargets,
    row: int,
    measured: MeasuredMotion,
    goals: MotorGoals,
    scratch: GoalScratch,
) -> None:
    """Compute the goals of all drives for the command in a row of ``commands``: see the module."""
    stiffness, damping = commands.stiffness[row], commands.damping[row]
    scratch.position_error[:] = commands.position[row] - measured.joint_position
    scratch.velocity_error[:] = commands.velocity[row] - measured.joint_velocity
    scratch.joint_torque[:] = (
        scratch.position_error * stiffness + commands.torque[row] + scratch.velocity_error * damping
    )
    multiply_vector(gears.torque_to_motor, scratch.joint_torque, goals.torque)
    multiply_vector(gears.to_motor, scratch.position_error, goals.position)
    multiply_vector(gears.to_motor, scratch.velocity_error, goals.velocity)
    for k in range(goals.torque.shape[0]):
        angle, speed = measured.position[k], measured.velocity[k]
        goals.torque[k] = nominal_torque(gears, k, goals.torque[k], speed)
        share = smallest_share(gears, k, stiffness, gears.stiffness)
        error = goals.position[k] * share
        # Where the drive follows the target by itself, its goal needs no lead.
        goals.position[k] = error + angle + (1.0 - share) * speed * gears.lead
        torque = goals.torque[k] - error * gears.motor_stiffness[k]
        error = goals.velocity[k] * smallest_share(gears, k, damping, gears.damping)
        goals.torque[k] = torque - error * gears.motor_damping[k]
        goals.velocity[k] = error + speed


class DriveGoals:
    """The goals of all drives for one command.

    Args:
        robot: the description.
        stiffness, damping: the joints' gains that the drives were set for [N m/rad, N m s/rad].
        motor_stiffness, motor_damping: the drives' own gains, at the motors' outputs.
        lead: the time from a measurement to when the goals made from it act [s].
        motors: what is known of the motors.

    Attributes:
        torque, position, velocity: the goals of every motor [N m, rad, rad/s], (n_joints,).
    """

    def __init__(
        self, robot: RobotDescription, stiffness: Array, damping: Array, motor_stiffness: Array,
        motor_damping: Array, lead: float, motors: MotorModel | None = None,
    ) -> None:  # fmt: skip
        self.gears = gears_of(
            robot, stiffness, damping, motor_stiffness, motor_damping, lead, motors
        )
        goals = MotorGoals.allocate(robot.dimensions)
        self.torque, self.position, self.velocity = goals.torque, goals.position, goals.velocity
        self._targets = CommandTargets.allocate({**robot.dimensions, "n_queue": 1})
        self._measured = MeasuredMotion.allocate(robot.dimensions)
        scratch = GoalScratch.allocate(robot.dimensions)
        self._make = signal_call(
            make_goals, self.gears, self._targets, 0, self._measured, goals, scratch
        )
        self._nominal = motors is None or motors == MotorModel()
        n = len(robot.joints)
        room = TorqueScratch(np.zeros(n), np.zeros(n))
        self._speed, self._torque = np.zeros(n), np.zeros(n)
        self._correct = signal_call(correct_torque, self.gears, room, self._speed, self._torque)

    def follow(
        self, command: JointCommand, position: Array, velocity: Array, joint_position: Array,
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

    def correct(self, velocity: Array, torque: Array) -> None:
        """Change measured joint torques [N m] to those that the motors give; the joints' velocity
        [rad/s] gives the direction of friction."""
        if self._nominal:
            return
        self._speed[:], self._torque[:] = velocity, torque
        self._correct.run()
        torque[:] = self._torque

    def hold(self, position: Array) -> None:
        """Set the goals to motor angles [rad] at rest, without any torque of their own."""
        self.torque.fill(0.0)
        self.position[:] = position
        self.velocity.fill(0.0)


def gears_of(
    robot: RobotDescription, stiffness: Array, damping: Array, motor_stiffness: Array,
    motor_damping: Array, lead: float, motors: MotorModel | None = None,
) -> Gears:  # fmt: skip
    """Return the gears of a robot; arguments as for ``DriveGoals``."""
    motors = motors or MotorModel()
    matrix = np.ascontiguousarray(robot.joint_to_motor)
    return Gears(
        matrix, np.ascontiguousarray(robot.torque_to_motor), np.ascontiguousarray(matrix.T),
        np.array(stiffness), np.array(damping), np.array(motor_stiffness),
        np.array(motor_damping), float(lead), motors.constants(robot),
        np.array(robot.motors.peak_torque), motors.saturation, motors.load_friction,
    )  # fmt: skip


def correction_calls(
    params: DriveGains, robot: RobotDescription, velocity: Array, torque: Array
) -> list[KernelCall]:
    """Return the call that corrects measured joint torques; none where all motors are nominal."""
    if params.motor_model == MotorModel():
        return []
    n = len(robot.joints)
    none = np.zeros(n)
    gears = gears_of(robot, none, none, none, none, 0.0, params.motor_model)
    scratch = TorqueScratch(np.zeros(n), np.zeros(n))
    return [signal_call(correct_torque, gears, scratch, velocity, torque)]
