"""The joint controller: feedforward torque on the ground, joint feedback in the air."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...mathematics.joint_feedback import (
    Feedback,
    Motion,
    SoftStops,
    add_friction,
    add_soft_stops,
    blend_feedback,
    integrate_accelerations,
)
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
from .joint_gains import default_gains
from .tasks.foot_joints import leg_joints


class JointFollower(Signal):
    """Each leg's blend between the gains of stance and flight, and the stance targets."""

    airborne = Field("n_feet", unit="", text="0: stance gains, 1: flight gains")
    position = Field("n_joints", unit="rad", text="integrated stance targets")
    velocity = Field("n_joints", unit="rad/s", text="their velocities")
    started = Field(dtype="bool", text="whether the targets have begun at the measured joints")


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
    gains towards their held angle. Joints that belong to no leg and are not held follow the
    whole-body controller while any leg stands; while all legs swing they have the flight gains
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
        robot = self.robot
        n = len(robot.joints)
        self._chains = [leg_joints(robot, foot) for foot in range(len(robot.feet))]
        in_legs = {joint for chain in self._chains for joint in chain}
        names = [joint.name for joint in robot.joints]
        self._held = [(k, robot.held[name]) for k, name in enumerate(names) if name in robot.held]
        self._free = [
            k for k, name in enumerate(names) if k not in in_legs and name not in robot.held
        ]
        self._standing = robot.standing_position
        self._planned = "reference" in self.context.wired
        self._foot_of_point = robot.foot_of_contact()
        self._default_gains = default_gains(robot)
        self._airborne, self._grounded, self._part = np.zeros(n), np.zeros(n), np.zeros(n)
        self._measured = Motion(self.joints.position, self.joints.velocity)
        self._integrated = Motion(self.follower.position, self.follower.velocity)
        self._flight = Feedback(*(np.zeros(n) for _ in range(4)))
        self._stance = Feedback(*(np.zeros(n) for _ in range(4)))
        command = self.command
        self._out = Feedback(command.stiffness, command.position, command.damping, command.velocity)
        self.on_parameters()

    def on_parameters(self) -> None:
        p, robot = self.params, self.robot
        stiffness, damping = self._default_gains
        flight, stance = self._flight, self._stance
        given = p.flight_stiffness, p.flight_damping
        flight.stiffness[:] = stiffness if given[0] is None else given[0].resolve(robot)
        flight.damping[:] = damping if given[1] is None else given[1].resolve(robot)
        stance.stiffness[:] = p.stance_stiffness.resolve(robot)
        stance.damping[:] = p.stance_damping.resolve(robot)
        for joint, _ in self._held:
            stance.stiffness[joint] = flight.stiffness[joint]
            stance.damping[joint] = flight.damping[joint]
        motors = robot.motors
        self._friction = p.friction.resolve(robot) + p.friction_share * motors.friction
        self._damping = p.friction_share * motors.damping
        self._has_friction = bool(self._friction.any() or self._damping.any())
        self._stops = SoftStops(
            robot.joint_limits, p.stop_margin, p.stop_gain, flight.stiffness, flight.damping
        )

    def step(self) -> None:
        self._blend()
        self._find_stance_targets()
        self._find_flight_targets()
        p, command = self.params, self.command
        command.mode[()] = CommandMode.ACTIVE
        np.multiply(self._grounded, self.wbc.torque, out=command.torque)
        if int(self.phase.phase[()]) == int(self.reference.phase[()]) == Phase.FLIGHT:
            np.multiply(self._airborne, self.reference.joint_torque, out=self._part)
            self._part *= p.flight_feedforward
            command.torque += self._part
        if self._has_friction:
            add_friction(
                self.joints.velocity, self._friction, self._damping, p.friction_speed, self._part,
                command.torque,
            )  # fmt: skip
        blend_feedback(self._airborne, self._flight, self._stance, self._measured, self._out)
        if p.stop_gain > 0.0:
            add_soft_stops(self.joints.position, self._stops, self._out)

    def _blend(self) -> None:
        """Change the weight of each leg's flight gains: up where no point of it is in stance."""
        airborne, phase = self.follower.airborne, int(self.phase.phase[()])
        rate = self.period / self.params.blend if self.params.blend > self.period else 1.0
        least = 1.0 if self._chains else 0.0
        for foot, chain in enumerate(self._chains):
            swings = phase in (Phase.FLIGHT, Phase.LANDING)
            for point, owner in enumerate(self._foot_of_point):
                held = self.phase.stance[point] or self.phase.stepping[point]
                if owner == foot and held:
                    swings = False
            weight = float(airborne[foot]) + (rate if swings else -rate)
            airborne[foot] = weight = min(max(weight, 0.0), 1.0)
            least = min(least, weight)
            for joint in chain:
                self._airborne[joint] = weight
        for joint, _ in self._held:
            self._airborne[joint] = least
        for joint in self._free:
            self._airborne[joint] = least
        np.subtract(1.0, self._airborne, out=self._grounded)

    def _find_stance_targets(self) -> None:
        """The measured joints at rest, the legs' targets, or integrated accelerations."""
        follower, joints, kind = self.follower, self.joints, self.params.stance_targets
        stance = self._stance
        if kind == "measured":
            stance.position[...] = joints.position
            stance.velocity[...] = 0.0
        elif kind == "legs":
            stance.position[...] = self.legs.position
            stance.velocity[...] = self.legs.velocity
        else:
            if not follower.started[()]:
                follower.position[...] = joints.position
                follower.velocity[...] = joints.velocity
                follower.started[()] = True
            n = joints.position.shape[0]
            integrate_accelerations(
                self.period, self.params.leak, self.wbc.acceleration[-n:], self._measured,
                self._integrated,
            )  # fmt: skip
            stance.position[...] = follower.position
            stance.velocity[...] = follower.velocity
        for joint, angle in self._held:
            stance.position[joint] = angle
            stance.velocity[joint] = 0.0

    def _find_flight_targets(self) -> None:
        """The legs' targets, the held angles, and the plan for joints that belong to no leg."""
        flight, reference = self._flight, self.reference
        flight.position[...] = self.legs.position
        flight.velocity[...] = self.legs.velocity
        for joint, angle in self._held:
            flight.position[joint] = angle
            flight.velocity[joint] = 0.0
        for joint in self._free:
            if self._planned:
                flight.position[joint] = reference.joint_position[joint]
                flight.velocity[joint] = reference.joint_velocity[joint]
            else:
                flight.position[joint] = self._standing[joint]
                flight.velocity[joint] = 0.0
