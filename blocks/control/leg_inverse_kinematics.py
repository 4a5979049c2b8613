"""The inverse kinematics of the legs: joint positions and velocities for foot targets."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from typing import Literal

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...robots.five_joint_leg import Leg, find_leg
from ...robots.five_joint_track import (
    FootMotion,
    LegTargets,
    follow_foot,
    leg_geometry,
    leg_scratch,
    leg_settings,
    watch_line,
)
from ...robots.limb import chain_to
from ...robots.limb_inverse import follow_limb, limb_geometry, limb_memory, watch_foot
from ...runtime.language.block import Context, Input, Output, State, UnmetRequirement
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import FootTarget, JointState, JointTarget, JumpReference
from .followed_plan import Flown, Following, PlannedJoints, Soles
from .leg_targets import begin_targets, end_targets

LATERAL = 0.9
"""Component along the base's y axis from which on a joint's axis is taken for lateral."""


class LegMemory(Signal):
    """The feet's targets and the joints' solution of the last tick."""

    direction = Field(("n_feet", 3), unit="", frame="body", text="heel to toe, of unit length")
    known = Field(dtype="bool", text="whether there was a last tick")
    target = Field(("n_feet", 4, 3), frame="body", text="place [m] and rows of the rotation matrix")
    position = Field("n_joints", unit="rad", text="joint positions found")
    flew = Field(dtype="bool", text="whether the plan has flown and was followed")
    flown_time = Field(unit="s", text="the plan's time in the last tick of its flight")
    flown_position = Field("n_joints", unit="rad", text="the joints' targets then")
    flown_velocity = Field("n_joints", unit="rad/s", text="their velocities")
    flown_acceleration = Field("n_joints", unit="rad/s^2", text="their planned accelerations")


class LegInverseKinematics(KernelBlock):
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
    allowed first, and also where the plan lands on the toes first (``reference.toes_first``). (The
    closed form does this strictly, the least squares by a lower weight.) Every
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

    The plan can be followed in two other ways, both off by default. The joints are ahead of the plan by
    ``plan_lead``, which makes up for what drives lag behind, and grows until the middle of the flight. A
    robot never turns exactly as planned: let e be by how much the base has turned further about its
    lateral axis, from the targets of feet whose soles are level in the world (``landing.alpha`` 1). From
    ``level_time`` before touchdown on the last joint of each leg about the lateral axis turns the sole by
    -e, so that heel and toe touch down together. It reaches that in half of the time.

    A robot may land later than planned. For ``late_time`` after the planned touchdown the joints of a leg
    that is still in the air keep their last acceleration of the flight, so that its feet slow down further.
    Then the accelerations of the last 6 ms before touchdown are not the plan's either: they are read ahead
    of time, so they would be those of the landing. With 0, the default, the plan's flight ends on time.

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
        plan_lead: float = live_parameter(
            0.0, unit="s", ge=0.0, le=0.03,
            text="by how much the joints are ahead of the plan's that they follow, from the middle of "
            "the flight on",
        )  # fmt: skip
        level_time: float = live_parameter(
            0.0, unit="s", ge=0.0, le=0.2,
            text="how long before touchdown the soles of a plan that is followed begin to become "
            "level; never with 0",
        )  # fmt: skip
        late_time: float = live_parameter(
            0.0, unit="s", ge=0.0, le=0.03,
            text="how long after the planned touchdown legs that follow a plan go on as in its flight",
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
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report joints that two legs share."""
        robot = context.robot
        assert robot is not None
        uses = Counter(joint for foot in robot.feet for joint in chain_to(robot, foot.link))
        for joint, count in uses.items():
            name = robot.joints[joint].name
            if count > 1 and name not in robot.held:
                yield UnmetRequirement(
                    f"joint {name} of {robot.name} carries {count} feet; the inverse kinematics "
                    "solves every leg by itself, so it can only hold such a joint",
                    fix=f"in the robot's description: held: {{{name}: 0.0}}",
                )

    def setup(self) -> None:
        robot, p, memory = self.robot, self.params, self.memory
        self._settings, self._may_slide = leg_settings(), np.zeros(1, np.bool_)
        self._following = Following(*(np.zeros(1) for _ in Following._fields))
        self.on_parameters()
        self._target = LegTargets(*(getattr(self.target, name) for name in LegTargets._fields))
        held = {
            k: robot.held[joint.name]
            for k, joint in enumerate(robot.joints)
            if joint.name in robot.held
        }
        begin = KernelCall(
            begin_targets, self.joints.position, np.array(list(held), np.int64),
            np.array(list(held.values()), np.float64), self._may_slide,
            self.reference.toes_first, self._settings.slides, self._target,
        )  # fmt: skip
        legs: list[KernelCall] = []
        for foot in range(len(robot.feet)):
            leg = find_leg(robot, foot) if p.method == "auto" else None
            legs += self._least_squares(foot) if leg is None else self._closed_form(foot, leg)
        plan = PlannedJoints(*(getattr(self.reference, name) for name in PlannedJoints._fields))
        end = KernelCall(
            end_targets, p.follow == "plan", self._following, self._soles(), plan,
            Flown(
                memory.flew, memory.flown_time, memory.flown_position, memory.flown_velocity,
                memory.flown_acceleration,
            ),
            self._target, memory.known, memory.position,
        )  # fmt: skip
        self.kernel_calls = (begin, *legs, end)

    def on_parameters(self) -> None:
        p, settings = self.params, self._settings
        settings.softness[0], settings.turn_length[0] = p.softness, p.turn_length
        settings.damping[0], settings.speed_limit[0] = p.damping, p.speed_limit
        settings.level[0] = p.level
        self._may_slide[0] = p.beyond == "slide"
        for name in Following._fields:
            getattr(self._following, name)[0] = getattr(p, name)

    def _soles(self) -> Soles:
        """The last joint of every leg that turns a sole with an extent about the lateral axis."""
        robot, margin = self.robot, self.params.margin
        joints, axes = [], []
        for number, foot in enumerate(robot.feet):
            chain = chain_to(robot, foot.link)
            turning = [joint for joint in chain if abs(robot.joints[joint].axis[1]) > LATERAL]
            if robot.foot_of_contact().count(number) < 2 or not turning:
                turning, axis = [chain[-1]], 0.0
            else:
                axis = math.copysign(1.0, robot.joints[turning[-1]].axis[1])
            joints.append(turning[-1])
            axes.append(axis)
        limits = robot.joint_limits[joints]
        return Soles(
            self.feet.rotation, np.array(joints, np.int64), np.array(axes), limits[:, 0] + margin,
            limits[:, 1] - margin,
        )  # fmt: skip

    def _closed_form(self, foot: int, leg: Leg) -> tuple[KernelCall, KernelCall]:
        """The calls for a five-joint leg."""
        motion, scratch = self._motion(foot), leg_scratch()
        watch = KernelCall(
            watch_line, motion.rotation, self.params.follow == "pitch",
            self.reference.foot_pitch[foot : foot + 1].reshape(()), self.period, self.memory.known,
            self.memory.direction[foot], scratch,
        )  # fmt: skip
        follow = KernelCall(
            follow_foot, leg_geometry(leg, self.params.margin), foot, motion,
            self.reference.joint_position, self.reference.joint_velocity, self._settings, scratch,
            self._target,
        )  # fmt: skip
        return watch, follow

    def _least_squares(self, foot: int) -> tuple[KernelCall, KernelCall]:
        """The calls for a leg of any number of joints."""
        limb, motion = limb_geometry(self.robot, foot, self.params.margin), self._motion(foot)
        scratch, memory = limb_memory(len(limb.joints)), self.memory
        watch = KernelCall(
            watch_foot, limb, motion, self.params.follow == "pitch",
            self.reference.foot_pitch[foot : foot + 1].reshape(()), self.period, memory.known,
            memory.target[foot], scratch,
        )  # fmt: skip
        follow = KernelCall(
            follow_limb, limb, foot, motion, self.joints.position, memory.known, memory.position,
            self._settings, scratch, self._target,
        )  # fmt: skip
        return watch, follow

    def _motion(self, foot: int) -> FootMotion:
        """The target of one foot."""
        feet = self.feet
        return FootMotion(feet.position[foot], feet.velocity[foot], feet.rotation[foot])
