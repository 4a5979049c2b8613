"""The joint controller: feedforward torque on the ground, joint feedback in the air."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Literal

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.joint_feedback import Feedback, Motion, SoftStops
from ...robots.description import RobotDescription
from ...robots.limb import chain_to
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import (
    JointCommand,
    JointState,
    JointTarget,
    JumpReference,
    PhaseState,
    WholeBodyCommand,
)
from .joint_command import (
    ACCELERATION,
    LEGS,
    MEASURED,
    Following,
    Inputs,
    Joints,
    Legs,
    Numbers,
    command_joints,
)
from .joint_gains import default_gains

_KINDS = {"measured": MEASURED, "acceleration": ACCELERATION, "legs": LEGS}


class JointFollower(Signal):
    """Each leg's blend between the gains of stance and flight, and the stance targets."""

    airborne = Field("n_feet", unit="", text="0: stance gains, 1: flight gains")
    position = Field("n_joints", unit="rad", text="integrated stance targets")
    velocity = Field("n_joints", unit="rad/s", text="their velocities")
    started = Field(dtype="bool", text="whether the targets have begun at the measured joints")


class JointPD(KernelBlock):
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
    its inertia and its motor's peak torque (``joint_gains.default_gains``). For a sampled drive keep
    Kd times its period below half the joint's inertia. The block limits no torques: the drives do,
    and the whole-body controller should.
    """

    class Params(Parameters):
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

    needs = ("robot",)
    params: Params

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
        self._legs = _legs(robot, self.params.released)
        reference, command, follower = self.reference, self.command, self.follower
        planned = Motion(reference.joint_position, reference.joint_velocity)
        if "reference" not in self.context.wired:
            planned = Motion(robot.standing_position.copy(), np.zeros(n))
        self._joints = Joints(np.zeros(n), Feedback(*np.zeros((4, n))), Feedback(*np.zeros((4, n))))
        self._numbers = Numbers(
            np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(n), np.zeros(n), np.zeros(1),
            np.zeros(1, np.bool_),
        )  # fmt: skip
        flight = self._joints.flight
        self._stops = SoftStops(
            robot.joint_limits, np.zeros(1), np.zeros(1), flight.stiffness, flight.damping
        )
        self.on_parameters()
        commanding = KernelCall(
            command_joints,
            self.period,
            _KINDS[self.params.stance_targets],
            self._legs,
            Inputs(
                self.phase.phase, self.phase.stance, self.phase.stepping, self.wbc.torque,
                self.wbc.acceleration[-n:], Motion(self.joints.position, self.joints.velocity),
                Motion(self.legs.position, self.legs.velocity), planned, reference.phase,
                reference.joint_torque,
            ),
            self._numbers,
            self._stops,
            Following(
                follower.airborne, Motion(follower.position, follower.velocity), follower.started
            ),
            self._joints,
            command.mode,
            command.torque,
            Feedback(command.stiffness, command.position, command.damping, command.velocity),
        )  # fmt: skip
        self.kernel_calls = (commanding,)

    def on_parameters(self) -> None:
        p, robot, numbers = self.params, self.robot, self._numbers
        stiffness, damping = self._default_gains
        flight, stance = self._joints.flight, self._joints.stance
        given = p.flight_stiffness, p.flight_damping
        flight.stiffness[:] = stiffness if given[0] is None else given[0].resolve(robot)
        flight.damping[:] = damping if given[1] is None else given[1].resolve(robot)
        held = self._legs.held
        stance.stiffness[:] = np.where(held, flight.stiffness, p.stance_stiffness.resolve(robot))
        stance.damping[:] = np.where(held, flight.damping, p.stance_damping.resolve(robot))
        motors = robot.motors
        numbers.friction[:] = p.friction.resolve(robot) + p.friction_share * motors.friction
        numbers.damping[:] = p.friction_share * motors.damping
        numbers.compensates[0] = bool(numbers.friction.any() or numbers.damping.any())
        numbers.speed[0] = p.friction_speed
        numbers.rate[0] = self.period / p.blend if p.blend > self.period else 1.0
        numbers.feedforward[0], numbers.leak[0] = p.flight_feedforward, p.leak
        self._stops.margin[0], self._stops.gain[0] = p.stop_margin, p.stop_gain


def _legs(robot: RobotDescription, released: list[str]) -> Legs:
    """Which joint belongs to which leg, is held, or is free."""
    n = len(robot.joints)
    foot_of_joint, in_leg = np.full(n, -1), np.zeros(n, np.bool_)
    held, angle = np.zeros(n, np.bool_), np.zeros(n)
    for k, joint in enumerate(robot.joints):
        if joint.name in robot.held and not any(fnmatchcase(joint.name, p) for p in released):
            held[k], angle[k] = True, robot.held[joint.name]
    for foot in range(len(robot.feet)):
        for k in chain_to(robot, robot.feet[foot].link):
            in_leg[k] = True
            foot_of_joint[k] = -1 if held[k] else foot
    foot_of_point = np.array(robot.foot_of_contact(), np.int64)
    return Legs(foot_of_point, foot_of_joint, held, angle, ~in_leg & ~held)
