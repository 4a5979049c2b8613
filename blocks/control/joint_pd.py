"""The joint controller: feedforward torque on the ground, joint feedback in the air."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
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

Array = NDArray[np.float64]

_GAINS = ("flight_stiffness", "flight_damping", "stance_stiffness", "stance_damping")


class JointFollower(Signal):
    """How far each leg's gains have moved to those of flight, and the stance targets."""

    airborne = Field("n_feet", unit="", text="0: stance gains, 1: flight gains")
    position = Field("n_joints", unit="rad", text="integrated stance targets")
    velocity = Field("n_joints", unit="rad/s", text="their velocities")
    started = Field(dtype="bool", text="whether the targets have begun at the measured joints")


class JointPD(Block):
    """The joint command of every tick (paper, V, first equation)::

        tau = tau_ff + Kp (q_d - q) + Kd (q_d' - q')

    The drives evaluate it at their own rate with the command's targets and gains. A leg with a
    stance point gets the whole-body controller's tau_ff and the stance gains; a leg without one
    during FLIGHT or LANDING gets the flight gains, the targets of its inverse kinematics and, as
    tau_ff, ``flight_feedforward`` times the planned torques while the plan flies too, so that it
    need not lag behind by what moves it; a leg that lands late keeps swinging while the other already stands. Between the
    two everything moves linearly within ``blend``.

    Stance gains are zero by default: the feedforward alone carries the robot. Where they are not,
    ``stance_targets`` says towards what they act: ``measured`` are the measured joints, so that only
    the damping acts, towards zero velocity; ``acceleration`` the whole-body controller's
    accelerations integrated twice, pulled back to the measured joints with time constant ``leak``;
    ``legs``, the paper's, the inverse kinematics of the planned feet seen from the centre of mass.
    ``friction`` adds that torque in the direction each joint moves.

    A joint nearer than ``stop_margin`` to its limit, on the ground or in the air, is also held
    back by a soft stop: ``stop_gain`` times its flight stiffness towards that margin and, growing
    from none there to ``stop_gain`` times its flight damping at the limit, towards rest.

    Gains are per leg joint from the hip outwards, the same for every leg. For a sampled drive keep
    Kd times its period below half the joint's inertia (ankle: 1.8e-3 kg m^2). Limits no torque:
    the drives do, and the whole-body controller should. The load report has a problem where
    a list of gains does not fit a leg.
    """

    class Params(Parameters):
        flight_stiffness: list[float] = live_parameter(
            [40.0, 60.0, 60.0, 60.0, 15.0], unit="N m/rad", text="Kp in the air, per leg joint"
        )
        flight_damping: list[float] = live_parameter(
            [1.0, 1.5, 1.5, 1.2, 0.3], unit="N m s/rad", text="Kd in the air, per leg joint"
        )
        flight_feedforward: float = live_parameter(
            1.0, ge=0.0, le=1.0, text="share of the planned torques that is fed forward in the air"
        )
        stance_stiffness: list[float] = live_parameter(
            [0.0] * 5, unit="N m/rad", text="Kp on the ground, per leg joint"
        )
        stance_damping: list[float] = live_parameter(
            [0.0] * 5, unit="N m s/rad", text="Kd on the ground, per leg joint"
        )
        blend: float = live_parameter(
            0.004, unit="s", ge=0.0, text="from one set of gains to another"
        )
        stance_targets: Literal["measured", "acceleration", "legs"] = parameter(
            "measured", text="what the stance gains act towards"
        )
        leak: float = live_parameter(0.02, unit="s", gt=0.0, text="how fast those forget")
        stop_margin: float = live_parameter(
            0.05, unit="rad", gt=0.0, le=0.3, text="distance from a joint's limit of its soft stop"
        )
        stop_gain: float = live_parameter(
            0.0, ge=0.0, le=20.0, text="gains of the soft stops, in those of flight; zero: none"
        )
        friction: float = live_parameter(
            0.0, unit="N m", ge=0.0, text="joint friction to compensate"
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
    reference = Input(JumpReference, default={}, text="the planned torques, if they are known")
    command = Output(JointCommand, text="what the drives execute")
    follower = State(JointFollower, text="blending and stance targets")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """One gain for every joint of a leg."""
        assert robot is not None
        for name in _GAINS:
            values: list[float] = getattr(params, name)
            for number, foot in enumerate(robot.feet):
                joints = [robot.joints[j].name for j in leg_joints(robot, number)]
                if len(values) != len(joints):
                    yield Misfit(
                        f"{name} has {len(values)} gains, and the leg of {foot.name} has "
                        f"{len(joints)} joints",
                        parameter=name,
                        expected=f"one gain each for {', '.join(joints)}",
                        found=f"{len(values)} gains",
                    )
                    break

    def setup(self) -> None:
        robot = self.robot
        self._chains = [leg_joints(robot, foot) for foot in range(len(robot.feet))]
        self._foot_of_point = robot.foot_of_contact()
        self.on_parameters()
        self._limits = robot.joint_limits
        n = len(robot.joints)
        self._airborne = np.zeros(n)
        self._grounded = np.zeros(n)
        self._part = np.zeros(n)
        self._stance_position = np.zeros(n)
        self._stance_velocity = np.zeros(n)

    def on_parameters(self) -> None:
        robot = self.robot
        gains = np.zeros((4, len(robot.joints)))
        for row, name in enumerate(_GAINS):
            values: list[float] = getattr(self.params, name)
            for chain in self._chains:
                gains[row, list(chain)] = values
        self._flight_stiffness, self._flight_damping = gains[0], gains[1]
        self._stance_stiffness, self._stance_damping = gains[2], gains[3]

    def step(self) -> None:
        self._blend()
        self._follow()
        command, legs, joints = self.command, self.legs, self.joints
        command.mode[()] = CommandMode.ACTIVE
        np.multiply(self._grounded, self.wbc.torque, out=command.torque)
        if int(self.phase.phase[()]) == int(self.reference.phase[()]) == Phase.FLIGHT:
            np.multiply(self._airborne, self.reference.joint_torque, out=self._part)
            self._part *= self.params.flight_feedforward
            command.torque += self._part
        if self.params.friction > 0.0:
            np.divide(joints.velocity, self.params.friction_speed, out=self._part)
            np.tanh(self._part, out=self._part)
            self._part *= self.params.friction
            command.torque += self._part
        superpose(
            self._airborne, self._flight_stiffness, self._stance_stiffness,
            legs.position, self._stance_position, joints.position,
            command.stiffness, command.position,
        )  # fmt: skip
        superpose(
            self._airborne, self._flight_damping, self._stance_damping,
            legs.velocity, self._stance_velocity, joints.velocity,
            command.damping, command.velocity,
        )  # fmt: skip
        if self.params.stop_gain > 0.0:
            stop(
                joints.position, self._limits, self.params.stop_margin, self.params.stop_gain,
                self._flight_stiffness, self._flight_damping,
                command.stiffness, command.position, command.damping, command.velocity,
            )  # fmt: skip

    def _blend(self) -> None:
        """Move every leg's weight towards flight where none of its points may push."""
        airborne, phase = self.follower.airborne, int(self.phase.phase[()])
        rate = self.period / self.params.blend if self.params.blend > self.period else 1.0
        for foot, chain in enumerate(self._chains):
            swings = phase in (Phase.FLIGHT, Phase.LANDING)
            for point, owner in enumerate(self._foot_of_point):
                if owner == foot and self.phase.stance[point]:
                    swings = False
            weight = float(airborne[foot]) + (rate if swings else -rate)
            airborne[foot] = weight = min(max(weight, 0.0), 1.0)
            for joint in chain:
                self._airborne[joint] = weight
        np.subtract(1.0, self._airborne, out=self._grounded)

    def _follow(self) -> None:
        """The stance targets: the measured joints at rest, the legs', or integrated accelerations."""
        follower, joints, kind = self.follower, self.joints, self.params.stance_targets
        if kind == "measured":
            self._stance_position[...] = joints.position
            self._stance_velocity[...] = 0.0
            return
        if kind == "legs":
            self._stance_position[...] = self.legs.position
            self._stance_velocity[...] = self.legs.velocity
            return
        if not follower.started[()]:
            follower.position[...] = joints.position
            follower.velocity[...] = joints.velocity
            follower.started[()] = True
        n = joints.position.shape[0]
        follow(
            self.period, self.params.leak, self.wbc.acceleration[-n:], joints.position,
            joints.velocity, follower.position, follower.velocity,
        )  # fmt: skip
        self._stance_position[...] = follower.position
        self._stance_velocity[...] = follower.velocity


def leg_joints(robot: RobotDescription, foot: int) -> tuple[int, ...]:
    """The joints between the base and a foot, from the base outwards."""
    chain: list[int] = []
    link = robot.feet[foot].link
    carrier = {joint.child: index for index, joint in enumerate(robot.joints)}
    while link in carrier:
        chain.insert(0, carrier[link])
        link = robot.joints[chain[0]].parent
    return tuple(chain)


@kernel
def superpose(
    weight: Array,
    first_gain: Array,
    second_gain: Array,
    first_target: Array,
    second_target: Array,
    measured: Array,
    gain: Array,
    target: Array,
) -> None:
    """One feedback that equals ``weight`` of the first plus the rest of the second.

    K = w K1 + (1 - w) K2 towards (w K1 x1 + (1 - w) K2 x2) / K; the measured value where K = 0.
    """
    for i in range(gain.shape[0]):
        first = float(weight[i]) * float(first_gain[i])
        second = (1.0 - float(weight[i])) * float(second_gain[i])
        total = first + second
        gain[i] = total
        if total > 0.0:
            share = first / total
            target[i] = share * float(first_target[i]) + (1.0 - share) * float(second_target[i])
        else:
            target[i] = measured[i]


@kernel
def stop(
    measured: Array,
    limits: Array,
    margin: float,
    gain: float,
    stop_stiffness: Array,
    stop_damping: Array,
    stiffness: Array,
    position: Array,
    damping: Array,
    velocity: Array,
) -> None:
    """Add soft stops to a feedback of ``stiffness`` to ``position`` and ``damping`` to ``velocity``.

    Springs of ``gain`` times ``stop_stiffness`` begin ``margin`` inside the ``limits`` (n, 2);
    dampers of ``gain`` times ``stop_damping`` grow from none there to all at the limit.
    """
    for i in range(measured.shape[0]):
        angle = float(measured[i])
        edge = min(max(angle, float(limits[i, 0]) + margin), float(limits[i, 1]) - margin)
        depth = abs(angle - edge) / margin
        if depth > 0.0:
            spring = gain * float(stop_stiffness[i])
            total = spring + float(stiffness[i])
            if total > 0.0:
                position[i] = (spring * edge + float(stiffness[i]) * float(position[i])) / total
            stiffness[i] = total
            damper = gain * min(depth, 1.0) * float(stop_damping[i])
            total = damper + float(damping[i])
            if total > 0.0:
                velocity[i] = float(damping[i]) * float(velocity[i]) / total
            damping[i] = total


@kernel
def follow(
    period: float,
    leak: float,
    acceleration: Array,
    measured_position: Array,
    measured_velocity: Array,
    position: Array,
    velocity: Array,
) -> None:
    """Integrate accelerations to ``velocity`` and ``position``, drawn to the measured joints.

    x' = v + (q - x) / leak, v' = a + (q' - v) / leak: below the corner 1/leak the targets are
    the measurements and the feedback vanishes; above it they are the controller's intention.
    """
    share = min(period / leak, 1.0)
    for i in range(position.shape[0]):
        speed = float(velocity[i])
        x = float(position[i]) + period * speed
        velocity[i] = (
            speed + period * float(acceleration[i]) + share * (float(measured_velocity[i]) - speed)
        )
        position[i] = x + share * (float(measured_position[i]) - x)
