"""The inverse kinematics of the legs: joint positions and velocities for foot targets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.kernel_call import KernelCall
from ...robots.ball_feet import ball_feet
from ...robots.description import RobotDescription
from ...robots.five_joint_leg import Leg, find_leg
from ...robots.five_joint_reach import pitched_line
from ...robots.five_joint_track import (
    FootMotion,
    LegTargets,
    follow_foot,
    leg_geometry,
    leg_scratch,
    leg_settings,
    watch_line,
)
from ...robots.limb import FootKind, Limb, chain_to, read_limb
from ...robots.limb_error import aim, turning
from ...robots.limb_inverse import (
    REACHED,
    approach,
    limb_scratch,
    limb_velocity,
    reach,
)
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import FootTarget, JointState, JointTarget, JumpReference, Phase

Array = NDArray[np.float64]

_FASTEST = 100.0
"""Foot velocities are limited to this [m/s], so that no square overflows."""
_JUMP = 0.1
"""A target that rotates by more than this [rad] in a tick is a new target, not a motion."""
_STEPS = 24
"""The largest number of least-squares steps from each starting point."""
_LOOSE = 0.1
"""Weight of those errors that matter less for a target out of reach; the others have weight 1."""


class LegMemory(Signal):
    """The feet's targets and the joints' solution of the last tick."""

    direction = Field(("n_feet", 3), unit="", frame="body", text="heel to toe, of unit length")
    known = Field(dtype="bool", text="whether there was a last tick")
    target = Field(("n_feet", 4, 3), frame="body", text="place [m] and rows of the rotation matrix")
    position = Field("n_joints", unit="rad", text="joint positions found")


class LegInverseKinematics(Block):
    """Joint positions and velocities for foot targets relative to the base (paper, V).

    A leg is the chain of joints from the base to a foot, of any number and kind. The kind of foot
    says how much of the target's orientation counts: all of it for a flat foot, the direction of
    the contact line for a line foot, and none for a point foot, whose lowest point goes to the
    target's position.

    A leg of hip yaw, pitch and roll with intersecting axes, a knee and an ankle that ends in a
    line foot is solved in closed form (``robots/five_joint_leg``), unless ``method`` is
    ``least_squares``. Any other leg is solved by damped least squares within the joint limits
    (``robots/limb_inverse``), starting from the last tick's solution and, if that does not reach
    the target, also from the measured and from the standing joints. Within reach both methods agree
    to 1e-9 rad. ``reachable`` says whether the foot reaches its target.

    For a target out of reach the solution is the nearest pose within reach. With ``beyond: slide``
    errors in the plane of the sole are allowed first, so the foot keeps its height above the ground
    and lands flat, though not where it should; with ``beyond: turn`` errors of orientation are
    allowed first. (The closed form does this strictly, the least squares by a lower weight.) Every
    joint stays ``margin`` inside its limits. A leg solved in closed form slows down within
    ``softness`` of a full stretch.

    Velocities follow by damped least squares from those rows J of the foot's Jacobian that count;
    rows of rotation are multiplied by ``turn_length``::

        q' = (J'J + damping^2 I)^-1 J'(p', turn_length w),   w from the targets of two ticks

    They are limited to ``speed_limit``, and are zero for a joint held at its limit. A target that
    rotates by more than 0.1 rad in one tick is a new target, not a motion.

    With ``follow: pitch`` the soles have the pitch they have in the plan, so that heels that rose
    before lift-off come down as planned and not at once. With ``follow: plan`` the targets are the
    plan's joints while the plan is in flight, and the landing law has no effect: the rate of a
    somersault depends on how far the legs are tucked, so its rotation is right only if all joints
    follow the plan.

    Where a thigh is level, hip yaw and roll turn about one axis: a foot a few millimetres beside its
    planned place would ask for any yaw. The closed form keeps the yaw of the plan there, or straight
    ahead if there is no plan: below ``level``, the cosine of the hip's pitch, it goes over to it.

    Joints that the description holds have their held position as the target; other joints that
    belong to no leg have their measured position. The block does not avoid collisions between the
    legs. The load report names every joint that carries two feet and is not held.
    """

    class Params(Parameters):
        method: Literal["auto", "least_squares"] = parameter(
            "auto", text="the closed form where it applies, or always the damped least squares"
        )
        margin: float = parameter(
            0.05, unit="rad", ge=0.0, le=0.2, text="distance kept from joint limits"
        )
        damping: float = live_parameter(
            3e-4, unit="m", gt=0.0, text="damping of the least squares for velocity"
        )
        turn_length: float = live_parameter(
            0.3, unit="m", gt=0.0, text="the distance that a foot's rotation by 1 rad is equal to"
        )
        speed_limit: float = live_parameter(
            30.0, unit="rad/s", gt=0.0, text="largest joint velocity"
        )
        softness: float = live_parameter(
            0.005,
            unit="m",
            ge=0.0,
            le=0.05,
            text="distance from full stretch over which a leg slows down",
        )
        level: float = live_parameter(
            0.3, ge=0.001, le=1.0,
            text="cosine of the hip's pitch below which the hip's yaw goes over to the plan's",
        )  # fmt: skip
        follow: Literal["feet", "pitch", "plan"] = parameter(
            "feet", text="the feet's targets; those with the soles' planned pitch; or the plan's "
            "joints as long as the plan flies"
        )  # fmt: skip
        beyond: Literal["turn", "slide"] = live_parameter(
            "turn", text="where errors are allowed first for a target out of reach"
        )

    needs = ("feet",)
    params: Params

    feet = Input(FootTarget, text="where the feet should be, relative to the base")
    joints = Input(JointState, text="measured joints, where the least squares begin")
    reference = Input(
        JumpReference, default={},
        text="the plan: its joints, where they are followed, and its hip yaw where a thigh is level",
    )  # fmt: skip
    target = Output(JointTarget, text="joint angles and velocities to track")
    memory = State(LegMemory, text="the last targets and the last solution")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Report joints that two legs share."""
        assert robot is not None
        uses = Counter(joint for foot in robot.feet for joint in chain_to(robot, foot.link))
        for joint, count in uses.items():
            name = robot.joints[joint].name
            if count > 1 and name not in robot.held:
                yield Misfit(
                    f"joint {name} of {robot.name} carries {count} feet; the inverse kinematics "
                    "solves every leg by itself, so it can only hold such a joint",
                    fix=f"in the robot's description: held: {{{name}: 0.0}}",
                )

    def setup(self) -> None:
        robot, p = self.robot, self.params
        self.leg_settings = leg_settings()
        self.on_parameters()
        self._legs: list[_ClosedForm | _LeastSquares] = []
        for foot in range(len(robot.feet)):
            leg = find_leg(robot, foot) if p.method == "auto" else None
            if leg is None:
                self._legs.append(_LeastSquares(self, foot, read_limb(robot, foot, p.margin)))
            else:
                self._legs.append(_ClosedForm(self, foot, leg))
        self._held = [
            (k, robot.held[joint.name])
            for k, joint in enumerate(robot.joints)
            if joint.name in robot.held
        ]

    def on_parameters(self) -> None:
        p, settings = self.params, self.leg_settings
        settings.softness[0], settings.turn_length[0] = p.softness, p.turn_length
        settings.damping[0], settings.speed_limit[0] = p.damping, p.speed_limit
        settings.level[0] = p.level
        settings.slides[0] = p.beyond == "slide"

    def step(self) -> None:
        target = self.target
        follows_plan = self.params.follow == "plan" and int(self.reference.phase) == Phase.FLIGHT
        if not follows_plan:
            target.position[...] = self.joints.position
            target.velocity[...] = 0.0
            for joint, angle in self._held:
                target.position[joint] = angle
        for leg in self._legs:
            leg.note()
            if not follows_plan:
                leg.solve()
        if follows_plan:
            target.position[...] = self.reference.joint_position
            target.velocity[...] = self.reference.joint_velocity
            target.reachable[...] = True
        self.memory.position[...] = target.position
        self.memory.known[()] = True


class _ClosedForm:
    """One five-joint leg of the block, solved in closed form."""

    def __init__(self, block: LegInverseKinematics, foot: int, leg: Leg) -> None:
        feet, target, scratch = block.feet, block.target, leg_scratch()
        self._watch = KernelCall(
            watch_line, feet.rotation[foot], block.params.follow == "pitch",
            block.reference.foot_pitch[foot : foot + 1].reshape(()), block.period,
            block.memory.known, block.memory.direction[foot], scratch,
        )  # fmt: skip
        self._follow = KernelCall(
            follow_foot, leg_geometry(leg, block.params.margin), foot,
            FootMotion(feet.position[foot], feet.velocity[foot], feet.rotation[foot]),
            block.reference.joint_position, block.reference.joint_velocity, block.leg_settings,
            scratch,
            LegTargets(target.position, target.velocity, target.reachable),
        )  # fmt: skip

    def note(self) -> None:
        """Take the line that is wanted, and how fast it turns."""
        self._watch.run()

    def solve(self) -> None:
        """The joints' positions and velocities."""
        self._follow.run()


class _LeastSquares:
    """One leg of any number of joints, solved by damped least squares."""

    def __init__(self, block: LegInverseKinematics, foot: int, limb: Limb) -> None:
        self.block, self.foot, self.limb = block, foot, limb
        n = len(limb.joints)
        self._radius, self._place = 0.0, np.zeros(3)
        for ball in ball_feet(block.robot):
            if ball.foot == foot:
                self._radius = ball.radius
                limb.tip[:3] = ball.centre
        self._standing = block.robot.standing_position[list(limb.joints)]
        self._starts, self._work = np.zeros((3, n + 1)), limb_scratch(n)
        self._angles, self._speeds = np.zeros(n), np.zeros(n)
        self._target, self._rotation = np.zeros((4, 3)), np.zeros((3, 3))
        self._line, self._twist = np.zeros(3), np.zeros(6)
        self._weights = np.ones(3)

    def note(self) -> None:
        """Take the target, and how fast it turns."""
        block, foot = self.block, self.foot
        self._rotation[...] = block.feet.rotation[foot]
        if block.params.follow == "pitch":
            pitched_line(self._rotation, float(block.reference.foot_pitch[foot]), self._line)
            self._rotation[:, 0] = self._line
        # A ball's centre is its radius above the ground, whichever way the leg comes.
        np.multiply(block.feet.rotation[foot, :, 2], self._radius, out=self._place)
        self._place += block.feet.position[foot]
        aim(self._place, self._rotation, self._target)
        self._twist[3:] = 0.0
        if block.memory.known[()]:
            last = block.memory.target[foot]
            turning(self.limb.tip, last, self._target, block.period, _JUMP, self._twist[3:])
        block.memory.target[foot] = self._target

    def solve(self) -> None:
        """The joints' positions and velocities."""
        block, limb, p = self.block, self.limb, self.block.params
        n, angles, weights = len(limb.joints), self._angles, self._weights
        known = bool(block.memory.known[()])
        for i, joint in enumerate(limb.joints):
            measured = min(max(float(block.joints.position[joint]), -_FASTEST), _FASTEST)
            self._starts[0, i] = block.memory.position[joint] if known else measured
            self._starts[1, i] = measured
            self._starts[2, i] = self._standing[i]
        weights[0], weights[1], weights[2] = 1.0, 1.0, p.turn_length
        square = reach(
            limb.links, limb.tip, limb.limits, self._target, weights, self._starts, 3, _STEPS,
            self._work, angles,
        )  # fmt: skip
        block.target.reachable[self.foot] = reached = square <= REACHED
        if not reached and (p.beyond == "slide" or limb.kind != FootKind.POINT):
            weights[0 if p.beyond == "slide" else 2] *= _LOOSE
            approach(
                limb.links, limb.tip, limb.limits, self._target, weights, _STEPS, self._work, angles
            )
        np.clip(block.feet.velocity[self.foot], -_FASTEST, _FASTEST, out=self._twist[:3])
        limb_velocity(
            limb.links, limb.tip, limb.limits, self._target, weights, angles, self._twist,
            p.damping, self._work, self._speeds,
        )  # fmt: skip
        limit = p.speed_limit
        for i in range(n):
            block.target.position[limb.joints[i]] = angles[i]
            speed = float(self._speeds[i])
            block.target.velocity[limb.joints[i]] = min(max(speed, -limit), limit)
