"""The joint controller: feedforward torque on the ground, joint feedback in the air."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Literal

import numpy as np

from ...mathematics.arrays import Array, Array1D
from ...mathematics.elementary import tanh
from ...mathematics.kept_arrays import code_digest, kept_arrays
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ...robots.limb import chain_to
from ...robots.pinocchio_model import build_pinocchio_model
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import (
    CommandMode,
    JointCommand,
    JointState,
    JointTarget,
    JumpReference,
    Phase,
    PhaseState,
    WholeBodyCommand,
)

NATURAL_FREQUENCY = 60.0
"""Natural frequency [rad/s] of a joint with the default gains, if its motor is strong enough."""
DAMPING_RATIO = 0.8
SATURATION_ERROR = 0.2
"""The joint error [rad] at which the default stiffness may at most ask for the peak torque."""


class JointPDParams(Parameters):
    """The parameters of ``JointPD``."""

    flight_stiffness: PerJoint | None = live_parameter(
        None, unit="N m/rad", ge=0.0, text="Kp in the air; none: default gains"
    )
    flight_damping: PerJoint | None = live_parameter(
        None, unit="N m s/rad", ge=0.0, text="Kd in the air; none: default gains"
    )
    flight_feedforward: float = live_parameter(
        1.0, ge=0.0, le=1.0, text="share of the planned torques that is fed forward in the air"
    )
    stance_stiffness: PerJoint = live_parameter(
        PerJoint(0.0), unit="N m/rad", ge=0.0, text="Kp on the ground"
    )
    stance_damping: PerJoint = live_parameter(
        PerJoint(0.0), unit="N m s/rad", ge=0.0, text="Kd on the ground"
    )
    blend: float = live_parameter(
        0.004, unit="s", ge=0.0, text="duration of the change between both sets of gains"
    )
    stance_targets: Literal["measured", "acceleration", "legs"] = parameter(
        "measured", text="the targets of the stance gains"
    )
    leak: float = live_parameter(
        0.02, unit="s", gt=0.0, text="time constant of the leak of integrated targets"
    )
    released: list[str] = parameter(
        [],
        text="names or patterns of held joints that follow the whole-body controller instead",
    )
    stop_margin: float = live_parameter(
        0.05, unit="rad", gt=0.0, le=0.3, text="distance of a soft stop from the joint's limit"
    )
    stop_gain: float = live_parameter(
        0.0, ge=0.0, le=20.0, text="gain of the soft stops, as a multiple of the flight gains"
    )
    friction: PerJoint = live_parameter(
        PerJoint(0.0), unit="N m",
        text="joint friction to compensate beyond the description's; negative: less",
    )  # fmt: skip
    damping: PerJoint = live_parameter(
        PerJoint(0.0), unit="N m s/rad", text="joint damping to compensate, likewise"
    )
    friction_share: float = live_parameter(
        0.0, ge=0.0, le=1.0, text="share of the motors' friction and damping to compensate"
    )
    friction_speed: float = live_parameter(
        0.3, unit="rad/s", gt=0.0, text="joint speed at which most of it is compensated"
    )


class JointFollower(Signal):
    """Each leg's blend between the gains of stance and flight, and the stance targets."""

    airborne = Field("n_feet", unit="", text="0: stance gains, 1: flight gains")
    position = Field("n_joints", unit="rad", text="integrated stance targets")
    velocity = Field("n_joints", unit="rad/s", text="their velocities")
    started = Field(dtype="bool", text="the targets have begun at the measured joints")


class JointPDConstants(Signal):
    """Constants derived from the parameters and the robot."""

    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    foot_of_joint = Field(
        "n_joints", dtype="int64", text="the foot of each joint; -1: it is held, or in no leg"
    )
    held = Field("n_joints", dtype="bool", text="each joint is held")
    held_angle = Field("n_joints", unit="rad", text="the angle at which it is held")
    free = Field("n_joints", dtype="bool", text="it is neither held nor in a leg")
    standing = Field("n_joints", unit="rad", text="the standing pose")
    planned = Field(dtype="bool", text="a plan is wired")
    limits = Field(("n_joints", 2), unit="rad", text="the joints' limits")
    flight_stiffness = Field("n_joints", unit="N m/rad", text="gains in the air")
    flight_damping = Field("n_joints", unit="N m s/rad", text="gains in the air")
    stance_stiffness = Field("n_joints", unit="N m/rad", text="gains on the ground")
    stance_damping = Field("n_joints", unit="N m s/rad", text="gains on the ground")
    blend_rate = Field(text="the largest change of a leg's weight in a tick")
    friction = Field("n_joints", unit="N m", text="friction to compensate")
    viscous_friction = Field("n_joints", unit="N m s/rad", text="damping to compensate")
    compensates = Field(dtype="bool", text="there is any of the two")


class JointPDScratch(Signal):
    """Scratch memory of one step of ``JointPD``."""

    airborne = Field("n_joints", text="weight of the flight gains of each joint")
    flight_position = Field("n_joints", unit="rad", text="targets of the flight gains")
    flight_velocity = Field("n_joints", unit="rad/s", text="their velocities")
    stance_position = Field("n_joints", unit="rad", text="targets of the stance gains")
    stance_velocity = Field("n_joints", unit="rad/s", text="their velocities")


class JointPD(Block):
    """The joint command of every tick: feedforward plus joint feedback (paper, V, first equation)::

        tau = tau_ff + Kp (q_d - q) + Kd (q_d' - q')

    The drives evaluate it at their own rate with the command's targets and gains.

    **Legs.** A leg with a stance point gets the whole-body controller's tau_ff and the stance gains.
    A leg without one during FLIGHT or LANDING gets the flight gains, the targets of its inverse
    kinematics and, as tau_ff, ``flight_feedforward`` times the planned torques while the plan is in
    flight too, so that it lags less. A leg that lands late keeps swinging while the others already
    stand; one that takes a step (``CaptureStep``) follows the whole-body controller instead.
    Gains, targets and torques change linearly from one set to the other within ``blend``.

    During HANG all joints have the flight gains towards the planned angles.

    **Other joints.** Joints that the robot's description holds always have tau_ff and the flight
    gains towards the planned angle, which is their held angle unless the plan moves them, or towards their held angle if
    no plan is wired. Joints that belong to no leg and are not held, or that are
    ``released``, follow the whole-body controller while any leg stands; while all legs swing they have the flight gains
    towards the planned angles, or towards the standing pose if no plan is wired.

    **Stance gains** are zero by default, so that the feedforward alone carries the robot. Otherwise
    ``stance_targets`` chooses their targets. With ``measured`` they are the measured angles
    and zero velocity, so that only the damping acts. With ``acceleration`` they are the whole-body
    controller's accelerations, integrated twice, with a leak towards the measured joints of the
    time constant ``leak``. With ``legs``, as in the paper, they are the inverse kinematics of the
    planned feet relative to the centre of mass.

    **Friction.** The torque that compensates ``friction_share`` of the friction and damping of the
    robot's motors, and all of ``friction`` and ``damping``, is added in the direction in which each joint moves.

    **Soft stops.** A joint nearer than ``stop_margin`` to its limit, on the ground or in the air, is
    pushed back: by ``stop_gain`` times its flight stiffness towards that margin, and by a damping
    that grows from zero at the margin to ``stop_gain`` times its flight damping at the limit.

    Gains are given by joint name or pattern. Without flight gains each joint gets default gains by
    its inertia and its motor's peak torque (``default_gains``). For a sampled drive keep
    Kd times its period below half the joint's inertia. The block limits no torques: the drives do,
    and the whole-body controller should.
    """

    Params = JointPDParams
    Constants = JointPDConstants
    Scratch = JointPDScratch
    needs = ("robot",)
    params: JointPDParams
    constants: JointPDConstants

    wbc = Input(WholeBodyCommand, text="feedforward torques and accelerations")
    legs = Input(JointTarget, text="joint targets of the legs, by default for those in the air")
    phase = Input(PhaseState, text="the phase and which points may push")
    joints = Input(JointState, text="measured joints")
    reference = Input(JumpReference, default={}, text="the planned joints, if they are known")
    command = Output(JointCommand, text="command to the drives")
    follower = State(JointFollower, text="blending and stance targets")

    def setup(self) -> None:
        robot, constants = self.robot, self.constants
        self._default_gains = default_gains(robot)
        constants.foot_of_point[:] = robot.foot_of_contact()
        constants.standing[:], constants.limits[:] = robot.standing_position, robot.joint_limits
        constants.planned = "reference" in self.context.wired
        self._find_legs()

    def _find_legs(self) -> None:
        """Find which joint belongs to which leg, is held, or is free."""
        robot, released, constants = self.robot, self.params.released, self.constants
        in_leg = np.zeros(len(robot.joints), np.bool_)
        constants.foot_of_joint[:] = -1
        for k, joint in enumerate(robot.joints):
            if joint.name in robot.held and not any(fnmatchcase(joint.name, p) for p in released):
                constants.held[k], constants.held_angle[k] = True, robot.held[joint.name]
        for number, foot in enumerate(robot.feet):
            for k in chain_to(robot, foot.link):
                in_leg[k] = True
                constants.foot_of_joint[k] = -1 if constants.held[k] else number
        constants.free[:] = ~in_leg & ~constants.held

    def prepare(self) -> None:
        p, robot, constants = self.params, self.robot, self.constants
        stiffness, damping = self._default_gains
        if p.flight_stiffness is not None:
            stiffness = p.flight_stiffness.resolve(robot)
        if p.flight_damping is not None:
            damping = p.flight_damping.resolve(robot)
        held, motors = constants.held, robot.motors
        constants.flight_stiffness[:], constants.flight_damping[:] = stiffness, damping
        constants.stance_stiffness[:] = np.where(held, stiffness, p.stance_stiffness.resolve(robot))
        constants.stance_damping[:] = np.where(held, damping, p.stance_damping.resolve(robot))
        constants.friction[:] = p.friction.resolve(robot) + p.friction_share * motors.friction
        constants.viscous_friction[:] = p.damping.resolve(robot) + p.friction_share * motors.damping
        constants.compensates = bool(constants.friction.any() or constants.viscous_friction.any())
        constants.blend_rate = self.period / p.blend if p.blend > self.period else 1.0

    @kernel
    @staticmethod
    def step(
        wbc: WholeBodyCommand,
        legs: JointTarget,
        phase: PhaseState,
        joints: JointState,
        reference: JumpReference,
        command: JointCommand,
        follower: JointFollower,
        params: JointPDParams,
        constants: JointPDConstants,
        scratch: JointPDScratch,
        period: float,
    ) -> None:
        blend_legs(phase, follower, constants, scratch.airborne)
        if params.stance_targets == "acceleration":
            n = wbc.torque.shape[0]
            acceleration = wbc.acceleration[wbc.acceleration.shape[0] - n :]
            integrate_accelerations(acceleration, joints, follower, params.leak, period)
        find_stance_targets(legs, joints, reference, follower, params, constants, scratch)
        hangs = phase.phase == Phase.HANG
        find_flight_targets(legs, reference, hangs, constants, scratch)
        command.mode = CommandMode.ACTIVE
        flies = phase.phase == Phase.FLIGHT and reference.phase == Phase.FLIGHT
        for i in range(command.torque.shape[0]):
            airborne = scratch.airborne[i]
            command.torque[i] = (1.0 - airborne) * wbc.torque[i]
            if flies:
                expected = airborne * reference.joint_torque[i] * params.flight_feedforward
                command.torque[i] = command.torque[i] + expected
        if constants.compensates:
            add_friction(joints, command, params, constants)
        blend_feedback(joints, command, constants, scratch)
        if params.stop_gain > 0.0:
            add_soft_stops(joints, command, params, constants)


# Which gains act


@kernel
def blend_legs(
    phase: PhaseState, follower: JointFollower, constants: JointPDConstants, airborne: Array1D
) -> None:
    """Change the weight of each leg's flight gains: up where no point of it is in stance.

    A joint of no leg, or one that is held, has the least weight of all legs.
    """
    rate = constants.blend_rate
    least = 1.0 if follower.airborne.shape[0] > 0 else 0.0
    for foot in range(follower.airborne.shape[0]):
        swings = phase.phase == Phase.FLIGHT or phase.phase == Phase.LANDING
        swings = swings or phase.phase == Phase.HANG
        for point in range(constants.foot_of_point.shape[0]):
            pushes = phase.stance[point] or phase.stepping[point]
            if constants.foot_of_point[point] == foot and pushes:
                swings = False
        weight = follower.airborne[foot] + (rate if swings else -rate)
        weight = min(max(weight, 0.0), 1.0)
        follower.airborne[foot] = weight
        least = min(least, weight)
    for joint in range(airborne.shape[0]):
        foot = constants.foot_of_joint[joint]
        if foot < 0:
            airborne[joint] = least
        else:
            airborne[joint] = follower.airborne[foot]


@kernel
def blend_feedback(
    joints: JointState,
    command: JointCommand,
    constants: JointPDConstants,
    scratch: JointPDScratch,
) -> None:
    """Blend flight and stance feedback into one, whose torque is the weighted mean of both torques."""
    blend_gains(
        scratch.airborne, constants.flight_stiffness, scratch.flight_position,
        constants.stance_stiffness, scratch.stance_position, joints.position,
        command.stiffness, command.position,
    )  # fmt: skip
    blend_gains(
        scratch.airborne, constants.flight_damping, scratch.flight_velocity,
        constants.stance_damping, scratch.stance_velocity, joints.velocity,
        command.damping, command.velocity,
    )  # fmt: skip


@kernel
def blend_gains(
    weight: Array1D,
    first_gain: Array1D,
    first_target: Array1D,
    second_gain: Array1D,
    second_target: Array1D,
    measured: Array1D,
    gain: Array1D,
    target: Array1D,
) -> None:
    """Blend two gains, stiffness or damping, and the targets they act towards.

    With the weights w (n,) of the first one the gain is K = w K1 + (1 - w) K2 and the target
    (w K1 x1 + (1 - w) K2 x2) / K. Where K = 0 the target is the measured value.
    """
    for i in range(gain.shape[0]):
        first = weight[i] * first_gain[i]
        second = (1.0 - weight[i]) * second_gain[i]
        total = first + second
        gain[i] = total
        if total > 0.0:
            share = first / total
            target[i] = share * first_target[i] + (1.0 - share) * second_target[i]
        else:
            target[i] = measured[i]


# Targets


@kernel
def integrate_accelerations(
    acceleration: Array1D, joints: JointState, follower: JointFollower, leak: float, period: float
) -> None:
    """Integrate accelerations [rad/s^2] (n,) to targets that leak towards the measured joints.

    x' = v + (q - x) / leak and v' = a + (q' - v) / leak, from the measured joints on. Below the
    corner frequency 1/leak the targets follow the measured joints, so the feedback vanishes; above
    it they follow the integrated accelerations.
    """
    if not follower.started:
        follower.position[:] = joints.position
        follower.velocity[:] = joints.velocity
        follower.started = True
    share = min(period / leak, 1.0)
    for i in range(acceleration.shape[0]):
        speed = follower.velocity[i]
        x = follower.position[i] + period * speed
        follower.velocity[i] = (
            speed + period * acceleration[i] + share * (joints.velocity[i] - speed)
        )
        follower.position[i] = x + share * (joints.position[i] - x)


@kernel
def find_stance_targets(
    legs: JointTarget,
    joints: JointState,
    reference: JumpReference,
    follower: JointFollower,
    params: JointPDParams,
    constants: JointPDConstants,
    scratch: JointPDScratch,
) -> None:
    """Find the stance targets: the measured joints at rest, the legs' targets, or integrated accelerations; held joints
    have the plan's."""
    position, velocity = scratch.stance_position, scratch.stance_velocity
    for i in range(constants.held.shape[0]):
        if constants.held[i] and constants.planned:
            position[i], velocity[i] = reference.joint_position[i], reference.joint_velocity[i]
        elif constants.held[i]:
            position[i], velocity[i] = constants.held_angle[i], 0.0
        elif params.stance_targets == "measured":
            position[i], velocity[i] = joints.position[i], 0.0
        elif params.stance_targets == "legs":
            position[i], velocity[i] = legs.position[i], legs.velocity[i]
        else:
            position[i], velocity[i] = follower.position[i], follower.velocity[i]


@kernel
def find_flight_targets(
    legs: JointTarget,
    reference: JumpReference,
    hangs: bool,
    constants: JointPDConstants,
    scratch: JointPDScratch,
) -> None:
    """Find the flight targets: the legs' targets, and for held joints, those of no leg, or all joints of a robot that
    hangs the plan; without a plan the held angles and the standing pose."""
    position, velocity = scratch.flight_position, scratch.flight_velocity
    for i in range(constants.held.shape[0]):
        if constants.held[i] and not constants.planned:
            position[i], velocity[i] = constants.held_angle[i], 0.0
        elif not (constants.held[i] or constants.free[i] or hangs):
            position[i], velocity[i] = legs.position[i], legs.velocity[i]
        elif constants.planned:
            position[i], velocity[i] = reference.joint_position[i], reference.joint_velocity[i]
        else:
            position[i], velocity[i] = constants.standing[i], 0.0


# Friction and soft stops


@kernel
def add_friction(
    joints: JointState,
    command: JointCommand,
    params: JointPDParams,
    constants: JointPDConstants,
) -> None:
    """Add the torque that compensates joint friction: Coulomb friction tanh(q' / speed), and viscous.

    The first term is zero at rest and has three quarters of its full value at ``friction_speed``.
    """
    torque, speed = command.torque, params.friction_speed
    torque[:] = torque + tanh(joints.velocity / speed) * constants.friction
    torque[:] = torque + joints.velocity * constants.viscous_friction


@kernel
def add_soft_stops(
    joints: JointState,
    command: JointCommand,
    params: JointPDParams,
    constants: JointPDConstants,
) -> None:
    """Add springs and dampers that begin ``stop_margin`` inside the joints' limits.

    The springs have ``stop_gain`` times the flight stiffness. The damping grows linearly from zero at
    the margin to ``stop_gain`` times the flight damping at the limit.
    """
    margin, gain = params.stop_margin, params.stop_gain
    for i in range(joints.position.shape[0]):
        angle = joints.position[i]
        edge = min(max(angle, constants.limits[i, 0] + margin), constants.limits[i, 1] - margin)
        depth = abs(angle - edge) / margin
        if depth > 0.0:
            spring = gain * constants.flight_stiffness[i]
            total = spring + command.stiffness[i]
            if total > 0.0:
                moment = spring * edge + command.stiffness[i] * command.position[i]
                command.position[i] = moment / total
            command.stiffness[i] = total
            damper = gain * min(depth, 1.0) * constants.flight_damping[i]
            total = damper + command.damping[i]
            if total > 0.0:
                command.velocity[i] = command.damping[i] * command.velocity[i] / total
            command.damping[i] = total


# Default gains


def default_gains(robot: RobotDescription) -> tuple[Array, Array]:
    """Stiffness [N m/rad] and damping [N m s/rad] of every joint, (n_joints,) each.

    Let I be the inertia of a joint in the standing pose with the base held, rotors included, and w
    the ``NATURAL_FREQUENCY``. Then K = I w^2, but at most the peak torque per ``SATURATION_ERROR``,
    and D = 2 ``DAMPING_RATIO`` sqrt(K I).
    """
    inertia = kept_arrays(
        robot.model_dump_json().encode() + code_digest("mathematics", "robots", "blocks/control"),
        lambda: {"inertia": _joint_inertia(robot)},
    )["inertia"]
    peak = product(np.abs(robot.joint_to_motor).T, robot.motors.peak_torque)
    stiffness = np.minimum(inertia * NATURAL_FREQUENCY**2, peak / SATURATION_ERROR)
    return stiffness, 2.0 * DAMPING_RATIO * np.sqrt(stiffness * inertia)


def _joint_inertia(robot: RobotDescription) -> Array:
    """Return the inertia of every joint in the standing pose [kg m^2], (n_joints,)."""
    import pinocchio

    built = build_pinocchio_model(robot)
    position = np.array(pinocchio.neutral(built.model))
    position[-len(robot.joints) :] = robot.standing_position
    matrix = pinocchio.crba(built.model, built.model.createData(), position)
    return np.diag(matrix + built.rotor_coupling)[-len(robot.joints) :]
