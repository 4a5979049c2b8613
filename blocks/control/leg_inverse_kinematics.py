"""The inverse kinematics of the legs: joint positions and velocities for foot targets."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from typing import Literal

from ...mathematics.arrays import Array1D, Matrix3
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.elementary import atan2
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...mathematics.rotations import pitch_angle, wrap
from ...robots.five_joint_leg import Leg, find_leg
from ...robots.limb import chain_to
from ...runtime.language.block import Context, Input, Output, State, UnmetRequirement
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ...runtime.language.steps import call_of, parameter_record, signal_call
from ..signals import FootTarget, JointState, JointTarget, JumpReference, Phase
from .leg_tracking import (
    LegMemory,
    LegSettings,
    follow_foot,
    follow_limb,
    leg_scratch,
    limb_geometry,
    limb_memory,
    watch_foot,
    watch_line,
    with_margin,
)

LATERAL = 0.9
"""Component along the base's y axis from which on a joint's axis is taken for lateral."""
LOOKAHEAD = 0.006
"""The plan's accelerations are read this far [s] ahead, so just before touchdown they are the landing's."""


class LegParams(Parameters):
    """The parameters of ``LegInverseKinematics``."""

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
    speed_limit: float = live_parameter(30.0, unit="rad/s", gt=0.0, text="largest joint velocity")
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
        text="lead of the joints over the plan's that they follow, from the middle of the flight on",
    )  # fmt: skip
    level_time: float = live_parameter(
        0.0, unit="s", ge=0.0, le=0.2,
        text="time before touchdown at which the soles of a plan that is followed begin to become level; never with 0",
    )  # fmt: skip
    late_time: float = live_parameter(
        0.0, unit="s", ge=0.0, le=0.03,
        text="time after the planned touchdown for which legs that follow a plan go on as in its flight",
    )  # fmt: skip
    beyond: Literal["turn", "slide"] = live_parameter(
        "turn", text="place of the errors that are allowed first for a target out of reach"
    )


class LegConstants(Signal):
    """Held joints, and for each foot the joint that levels its sole."""

    held = Field("n_joints", dtype="bool", text="the description holds the joint")
    held_position = Field("n_joints", unit="rad", text="the position at which it is held")
    sole_joint = Field("n_feet", dtype="int64", text="the last joint about the lateral axis")
    sole_axis = Field("n_feet", unit="", text="the sign of its axis along y; 0: no such joint")
    sole_lowest = Field("n_feet", unit="rad", text="its lowest position")
    sole_highest = Field("n_feet", unit="rad", text="its highest position")


class LegKinematicsScratch(Signal):
    """Scratch memory of one step of ``LegInverseKinematics``."""

    slides = Field(dtype="bool", text="a foot out of reach slides in its sole's plane")


class LegInverseKinematics(KernelBlock):
    """Joint positions and velocities for foot targets relative to the base (paper, V).

    A leg is the chain of joints from the base to a foot, of any number and kind. The kind of foot
    decides how much of the target's orientation counts: all of it for a flat foot, the direction of
    the contact line for a line foot, and none for a point foot, whose lowest point goes to the
    target's position.

    A leg of hip yaw, pitch and roll with intersecting axes, a knee and an ankle that ends in a
    line foot is solved in closed form (``robots/five_joint_leg``), unless ``method`` is
    ``least_squares``. Any other leg is solved by damped least squares within the joint limits
    (``robots/limb_inverse``), starting from the last tick's solution and, if that does not reach
    the target, also from the measured and from the standing joints. Within reach both methods agree
    to 1e-9 rad, and 59 of 60 jumps land with either (18 cm up, 38 cm ahead, 20 cm aside; 20 seeds each).
    The closed form stays for its time: of both legs out of reach 6.4 us in place of 86 us, and within
    reach 6.0 us in place of 7.6 us. ``reachable`` is true where the foot reaches its target.

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
    robot never turns exactly as planned: let e be the angle that the base has turned further about its
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

    Params = LegParams
    Constants = LegConstants
    Scratch = LegKinematicsScratch
    needs = ("feet",)
    params: LegParams
    constants: LegConstants
    scratch: LegKinematicsScratch

    feet = Input(FootTarget, text="targets of the feet, relative to the base")
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
        robot, constants = self.robot, self.constants
        for k, joint in enumerate(robot.joints):
            if joint.name in robot.held:
                constants.held[k], constants.held_position[k] = True, robot.held[joint.name]
        self._find_sole_joints()
        live = parameter_record(
            self, {"softness", "turn_length", "damping", "level", "speed_limit"}
        )
        self._settings = LegSettings(
            live.softness, live.turn_length, live.damping, live.level, live.speed_limit,
            self.scratch.slides,
        )  # fmt: skip
        legs: list[KernelCall] = []
        for foot in range(len(robot.feet)):
            leg = find_leg(robot, foot) if self.params.method == "auto" else None
            legs += self._least_squares(foot) if leg is None else self._closed_form(foot, leg)
        self.kernel_calls = (call_of(self, begin_targets), *legs, call_of(self, finish_targets))

    def _find_sole_joints(self) -> None:
        """Find the last joint of each leg about the lateral axis, where the sole has an extent."""
        robot, margin, constants = self.robot, self.params.margin, self.constants
        for foot in range(len(robot.feet)):
            chain = chain_to(robot, robot.feet[foot].link)
            lateral = [joint for joint in chain if abs(robot.joints[joint].axis[1]) > LATERAL]
            joint = lateral[-1] if lateral else chain[-1]
            if lateral and robot.foot_of_contact().count(foot) > 1:
                constants.sole_axis[foot] = math.copysign(1.0, robot.joints[joint].axis[1])
            constants.sole_joint[foot] = joint
            lowest, highest = robot.joint_limits[joint]
            constants.sole_lowest[foot] = lowest + margin
            constants.sole_highest[foot] = highest - margin

    def _closed_form(self, foot: int, leg: Leg) -> tuple[KernelCall, KernelCall]:
        """Return the calls for a five-joint leg."""
        scratch, pitched = leg_scratch(), self.params.follow == "pitch"
        watch = signal_call(
            watch_line, foot, self.feet, self.reference, pitched, self.period, self.memory, scratch
        )
        follow = signal_call(
            follow_foot, with_margin(leg, self.params.margin), foot, self.feet, self.reference,
            self._settings, scratch, self.target,
        )  # fmt: skip
        return watch, follow

    def _least_squares(self, foot: int) -> tuple[KernelCall, KernelCall]:
        """Return the calls for a leg of any number of joints."""
        limb = limb_geometry(self.robot, foot, self.params.margin)
        scratch, pitched = limb_memory(len(limb.joints)), self.params.follow == "pitch"
        watch = signal_call(
            watch_foot, limb, foot, self.feet, self.reference, pitched, self.period, self.memory,
            scratch,
        )  # fmt: skip
        follow = signal_call(
            follow_limb, limb, foot, self.feet, self.joints, self.memory, self._settings, scratch,
            self.target,
        )  # fmt: skip
        return watch, follow


# Before and after the legs


@kernel
def begin_targets(
    joints: JointState,
    reference: JumpReference,
    target: JointTarget,
    params: LegParams,
    constants: LegConstants,
    scratch: LegKinematicsScratch,
) -> None:
    """Set held joints to their position and all others to the measured one.

    Where the plan lands on the toes first no foot slides: a sole laid flat would land on all its points.
    """
    scratch.slides = params.beyond == "slide" and not reference.toes_first
    target.position[:] = joints.position
    target.velocity[:] = 0.0
    for joint in range(constants.held.shape[0]):
        if constants.held[joint]:
            target.position[joint] = constants.held_position[joint]


@kernel
def finish_targets(
    feet: FootTarget,
    reference: JumpReference,
    target: JointTarget,
    params: LegParams,
    constants: LegConstants,
    memory: LegMemory,
) -> None:
    """Replace the solution by the plan's joints where they are followed, and remember it."""
    if params.follow == "plan":
        if reference.phase == Phase.FLIGHT:
            follow_plan(feet, reference, target, params, constants, memory)
        else:
            continue_flight(reference, target, params, memory)
    memory.position[:] = target.position
    memory.known = True


# Following the plan's joints


@kernel
def follow_plan(
    feet: FootTarget,
    reference: JumpReference,
    target: JointTarget,
    params: LegParams,
    constants: LegConstants,
    memory: LegMemory,
) -> None:
    """Set the plan's joints, ahead of time and with level soles, and remember them for a late landing."""
    ahead = params.plan_lead * lead_share(reference)
    pitch = pitch_angle(reference.orientation)
    if not keeps_acceleration(reference, params, memory):
        memory.flown_acceleration[:] = reference.joint_acceleration
    extrapolate(
        reference.joint_position, reference.joint_velocity, memory.flown_acceleration, ahead, target
    )
    for foot in range(target.reachable.shape[0]):
        target.reachable[foot] = True
        if params.level_time > 0.0 and constants.sole_axis[foot] != 0.0:
            level_sole(foot, feet, reference, target, params, constants, pitch)
    memory.flew = True
    memory.flown_time = reference.time
    memory.flown_position[:] = target.position
    memory.flown_velocity[:] = target.velocity


@kernel
def continue_flight(
    reference: JumpReference, target: JointTarget, params: LegParams, memory: LegMemory
) -> None:
    """Let the joints move on as in the plan's flight for ``late_time`` after the planned touchdown.

    So the feet of a robot that lands late keep slowing down.
    """
    since = reference.time - memory.flown_time
    if memory.flew and since < params.late_time:
        extrapolate(
            memory.flown_position, memory.flown_velocity, memory.flown_acceleration, since, target
        )


@kernel
def extrapolate(
    position: Array1D, velocity: Array1D, acceleration: Array1D, duration: float, out: JointTarget
) -> None:
    """Joint positions and velocities after ``duration`` [s] with constant acceleration."""
    for joint in range(position.shape[0]):
        change = acceleration[joint] * duration
        out.position[joint] = position[joint] + duration * (velocity[joint] + 0.5 * change)
        out.velocity[joint] = velocity[joint] + change


@kernel
def keeps_acceleration(reference: JumpReference, params: LegParams, memory: LegMemory) -> bool:
    """Check whether the last accelerations stay, because the plan's may be the landing's already.

    A ``touchdown_time`` that has long passed is that of the flight before.
    """
    if params.late_time == 0.0 or not memory.flew:
        return False
    return bool(abs(reference.touchdown_time - reference.time) <= LOOKAHEAD)


@kernel
def lead_share(reference: JumpReference) -> float:
    """Return the share of the lead that counts: it grows from 0 at lift-off to 1 in the middle of the flight.

    From its middle on the plan may name the times of the next flight already.
    """
    since = reference.time - reference.lift_off_time
    duration = reference.touchdown_time - reference.lift_off_time
    if since < 0.0 or duration <= 0.0:
        return 1.0
    return float(min(2.0 * since / duration, 1.0))


@kernel
def excess_pitch(level: Matrix3, pitch: float) -> float:
    """Return the angle [rad] that the base has turned further about its y axis than the plan's ``pitch`` [rad].

    Args:
        level: the rotation of a level sole in the base's axes.
    """
    return wrap(atan2(level[2, 0], level[0, 0]) - pitch)


@kernel
def level_sole(
    foot: int,
    feet: FootTarget,
    reference: JumpReference,
    target: JointTarget,
    params: LegParams,
    constants: LegConstants,
    pitch: float,
) -> None:
    """Turn a sole against the base's excess pitch, by the last joint of its leg."""
    since = reference.time - reference.touchdown_time + params.level_time
    share, _, _ = minimum_jerk(2.0 * since / params.level_time)
    joint, error = constants.sole_joint[foot], excess_pitch(feet.rotation[foot], pitch)
    angle = target.position[joint] - share * constants.sole_axis[foot] * error
    target.position[joint] = min(
        max(angle, constants.sole_lowest[foot]), constants.sole_highest[foot]
    )
