"""The joint controller: feedforward torque on the ground, joint feedback in the air."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Literal

import numpy as np

from ...mathematics.arrays import Array, Array1D
from ...mathematics.joint_feedback import (
    Feedback,
    Motion,
    SoftStops,
    add_friction,
    add_soft_stops,
    blend_feedback,
    integrate_accelerations,
)
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


class JointFollower(Signal):
    """Each leg's blend between the gains of stance and flight, and the stance targets."""

    airborne = Field("n_feet", unit="", text="0: stance gains, 1: flight gains")
    position = Field("n_joints", unit="rad", text="integrated stance targets")
    velocity = Field("n_joints", unit="rad/s", text="their velocities")
    started = Field(dtype="bool", text="whether the targets have begun at the measured joints")


class JointPDConstants(Signal):
    """What follows from the parameters and the robot."""

    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    foot_of_joint = Field(
        "n_joints", dtype="int64", text="the foot of each joint; -1: it is held, or in no leg"
    )
    held = Field("n_joints", dtype="bool", text="whether each joint is held")
    held_angle = Field("n_joints", unit="rad", text="the angle at which it is held")
    free = Field("n_joints", dtype="bool", text="whether it is neither held nor in a leg")
    blend_rate = Field(text="the largest change of a leg's weight in a tick")
    friction = Field("n_joints", unit="N m", text="friction to compensate")
    viscous_friction = Field("n_joints", unit="N m s/rad", text="damping to compensate")
    compensates = Field(dtype="bool", text="whether there is any of the two")


class JointWeights(Signal):
    """Room for a step of ``JointPD``."""

    airborne = Field("n_joints", text="weight of the flight gains of each joint")


class JointPDParameters(Parameters):
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
        PerJoint(0.0), unit="N m", ge=0.0, text="further joint friction to compensate"
    )
    friction_share: float = live_parameter(
        0.0, ge=0.0, le=1.0, text="share of the motors' friction and damping to compensate"
    )
    friction_speed: float = live_parameter(
        0.3, unit="rad/s", gt=0.0, text="joint speed at which most of it is compensated"
    )


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

    **Other joints.** Joints that the robot's description holds always have tau_ff and the flight
    gains towards their held angle. Joints that belong to no leg and are not held, or that are
    ``released``, follow the whole-body controller while any leg stands; while all legs swing they have the flight gains
    towards the planned angles, or towards the standing pose if no plan is wired.

    **Stance gains** are zero by default, so that the feedforward alone carries the robot. Otherwise
    ``stance_targets`` says what their targets are. With ``measured`` they are the measured angles
    and zero velocity, so that only the damping acts. With ``acceleration`` they are the whole-body
    controller's accelerations, integrated twice, with a leak towards the measured joints of the
    time constant ``leak``. With ``legs``, as in the paper, they are the inverse kinematics of the
    planned feet relative to the centre of mass.

    **Friction.** The torque that compensates ``friction_share`` of the friction and damping of the
    robot's motors, and all of ``friction``, is added in the direction in which each joint moves.

    **Soft stops.** A joint nearer than ``stop_margin`` to its limit, on the ground or in the air, is
    pushed back: by ``stop_gain`` times its flight stiffness towards that margin, and by a damping
    that grows from zero at the margin to ``stop_gain`` times its flight damping at the limit.

    Gains are given by joint name or pattern. Without flight gains each joint gets default gains by
    its inertia and its motor's peak torque (``default_gains``). For a sampled drive keep
    Kd times its period below half the joint's inertia. The block limits no torques: the drives do,
    and the whole-body controller should.
    """

    needs = ("robot",)
    Params = JointPDParameters
    Constants = JointPDConstants
    Scratch = JointWeights
    params: JointPDParameters

    wbc = Input(WholeBodyCommand, text="feedforward torques and accelerations")
    legs = Input(JointTarget, text="joint targets of the legs, by default for those in the air")
    phase = Input(PhaseState, text="the phase and which points may push")
    joints = Input(JointState, text="measured joints")
    reference = Input(JumpReference, default={}, text="the planned joints, if they are known")
    command = Output(JointCommand, text="what the drives execute")
    follower = State(JointFollower, text="blending and stance targets")

    def setup(self) -> None:
        robot, n = self.robot, len(self.robot.joints)
        self._default_gains = default_gains(robot)
        self._find_legs()
        reference, command, follower = self.reference, self.command, self.follower
        self.measured = Motion(self.joints.position, self.joints.velocity)
        self.planned = Motion(reference.joint_position, reference.joint_velocity)
        if "reference" not in self.context.wired:
            self.planned = Motion(robot.standing_position.copy(), np.zeros(n))
        self.integrated = Motion(follower.position, follower.velocity)
        self.flight, self.stance = Feedback(*np.zeros((4, n))), Feedback(*np.zeros((4, n)))
        self.feedback = Feedback(
            command.stiffness, command.position, command.damping, command.velocity
        )
        self.stops = SoftStops(
            robot.joint_limits, np.zeros(1), np.zeros(1), self.flight.stiffness, self.flight.damping
        )

    def _find_legs(self) -> None:
        """Find which joint belongs to which leg, is held, or is free."""
        robot, released, constants = self.robot, self.params.released, self.constants
        in_leg = np.zeros(len(robot.joints), np.bool_)
        constants.foot_of_joint[:], constants.foot_of_point[:] = -1, robot.foot_of_contact()
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
        flight, stance, held = self.flight, self.stance, constants.held
        given = p.flight_stiffness, p.flight_damping
        flight.stiffness[:] = stiffness if given[0] is None else given[0].resolve(robot)
        flight.damping[:] = damping if given[1] is None else given[1].resolve(robot)
        stance.stiffness[:] = np.where(held, flight.stiffness, p.stance_stiffness.resolve(robot))
        stance.damping[:] = np.where(held, flight.damping, p.stance_damping.resolve(robot))
        motors = robot.motors
        constants.friction[:] = p.friction.resolve(robot) + p.friction_share * motors.friction
        constants.viscous_friction[:] = p.friction_share * motors.damping
        constants.compensates = bool(constants.friction.any() or constants.viscous_friction.any())
        constants.blend_rate = self.period / p.blend if p.blend > self.period else 1.0
        self.stops.margin[0], self.stops.gain[0] = p.stop_margin, p.stop_gain

    @kernel
    @staticmethod
    def step(
        wbc: WholeBodyCommand,
        legs: JointTarget,
        phase: PhaseState,
        reference: JumpReference,
        measured: Motion,
        planned: Motion,
        integrated: Motion,
        flight: Feedback,
        stance: Feedback,
        stops: SoftStops,
        feedback: Feedback,
        command: JointCommand,
        follower: JointFollower,
        constants: JointPDConstants,
        scratch: JointWeights,
        params: JointPDParameters,
        period: float,
    ) -> None:
        blend_legs(phase, follower, constants, scratch.airborne)
        if params.stance_targets == "acceleration":
            joints = wbc.acceleration[wbc.acceleration.shape[0] - wbc.torque.shape[0] :]
            integrate_stance_targets(joints, measured, follower, integrated, params.leak, period)
        find_stance_targets(legs, measured, integrated, constants, params, stance)
        find_flight_targets(legs, planned, constants, flight)
        command.mode = CommandMode.ACTIVE
        flies = phase.phase == Phase.FLIGHT and reference.phase == Phase.FLIGHT
        for i in range(command.torque.shape[0]):
            airborne = scratch.airborne[i]
            command.torque[i] = (1.0 - airborne) * wbc.torque[i]
            if flies:
                expected = airborne * reference.joint_torque[i] * params.flight_feedforward
                command.torque[i] = command.torque[i] + expected
        if constants.compensates:
            add_friction(
                measured.velocity, constants.friction, constants.viscous_friction,
                params.friction_speed, command.torque,
            )  # fmt: skip
        blend_feedback(scratch.airborne, flight, stance, measured, feedback)
        if params.stop_gain > 0.0:
            add_soft_stops(measured.position, stops, feedback)


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
def integrate_stance_targets(
    acceleration: Array1D,
    measured: Motion,
    follower: JointFollower,
    integrated: Motion,
    leak: float,
    period: float,
) -> None:
    """Integrate the accelerations, from the measured joints on."""
    if not follower.started:
        integrated.position[:] = measured.position
        integrated.velocity[:] = measured.velocity
        follower.started = True
    integrate_accelerations(period, leak, acceleration, measured, integrated)


@kernel
def find_stance_targets(
    legs: JointTarget,
    measured: Motion,
    integrated: Motion,
    constants: JointPDConstants,
    params: JointPDParameters,
    stance: Feedback,
) -> None:
    """The measured joints at rest, the legs' targets, or integrated accelerations."""
    for i in range(constants.held.shape[0]):
        if constants.held[i]:
            stance.position[i], stance.velocity[i] = constants.held_angle[i], 0.0
        elif params.stance_targets == "measured":
            stance.position[i], stance.velocity[i] = measured.position[i], 0.0
        elif params.stance_targets == "legs":
            stance.position[i], stance.velocity[i] = legs.position[i], legs.velocity[i]
        else:
            stance.position[i] = integrated.position[i]
            stance.velocity[i] = integrated.velocity[i]


@kernel
def find_flight_targets(
    legs: JointTarget, planned: Motion, constants: JointPDConstants, flight: Feedback
) -> None:
    """The legs' targets, the held angles, and the plan for joints that belong to no leg."""
    for i in range(constants.held.shape[0]):
        if constants.held[i]:
            flight.position[i], flight.velocity[i] = constants.held_angle[i], 0.0
        elif constants.free[i]:
            flight.position[i], flight.velocity[i] = planned.position[i], planned.velocity[i]
        else:
            flight.position[i], flight.velocity[i] = legs.position[i], legs.velocity[i]


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
    """The inertia of every joint in the standing pose [kg m^2], (n_joints,)."""
    import pinocchio

    built = build_pinocchio_model(robot)
    position = np.array(pinocchio.neutral(built.model))
    position[-len(robot.joints) :] = robot.standing_position
    matrix = pinocchio.crba(built.model, built.model.createData(), position)
    return np.diag(matrix + built.rotor_coupling)[-len(robot.joints) :]
