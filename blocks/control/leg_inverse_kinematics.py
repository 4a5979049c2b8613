"""From where the feet should be to the joint angles that put them there."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...robots.leg_kinematics import forward, inverse, inverse_velocity, jacobian, read_leg
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import FootTarget, JointState, JointTarget, JumpReference, Phase

Array = NDArray[np.float64]

_FASTEST = 100.0
"""Foot velocities [m/s] are brought within this, so that no square overflows."""
_LEVEL = 0.3
"""A sole whose normal leans farther than this cosine from the base's z axis does not slide."""
_HALVINGS = 8
"""The place in reach is found to within a 256th of the way."""
_FARTHEST = 10.0
"""Places [m] are brought within this to slide from."""
_JUMP = 0.1
"""A line that turns by more than this [rad] in a tick has been given anew."""


class FootLines(Signal):
    """The feet's target lines at the last tick, to difference."""

    direction = Field(("n_feet", 3), unit="", frame="body", text="heel to toe, of unit length")
    known = Field(dtype="bool", text="whether there was a last tick")


class LegInverseKinematics(Block):
    """Joint positions and velocities for foot targets seen from the base (paper, V).

    Five joints reach a sole position and a direction of the foot's line, that is pitch and yaw;
    the target's roll about the line is ignored. Positions are in closed form
    (``leg_kinematics.inverse``), exact where the leg reaches. Elsewhere, with ``beyond: slide``, the
    foot slides in the plane of its sole towards the place below the hip, as far as it must: it keeps its height above the ground and lands flat, though not where it should. With
    ``beyond: turn``, and where sliding does not help, the foot's pitch is given up first, then the
    distance. Every angle stays ``margin`` inside the joint limits, and within ``softness`` of a
    full stretch the leg slows down. ``reachable`` says whether the foot is where it should be.
    Velocities solve the 5 x 5 Jacobian by damped least squares::

        q' = (A'A + damping^2 I)^-1 A'(p', u'),   u' = (u - u_last) / period

    with u the target's line. They are limited to ``speed_limit``, and are zero for a joint held at
    its limit. A line that turns by more than 0.1 rad in one tick is a new target, not a motion.

    With ``follow: pitch`` the soles have the pitch they have in the plan, so that heels that rose
    before lift-off come down as planned and not at once. With ``follow: plan`` the targets are the
    plan's joints while the plan flies, and the landing law has no say: a somersault turns as fast
    as its legs are tucked, so its rotation is right only if all joints are where they should be.

    Joints that belong to no leg keep their measured angle. Does not avoid collisions between the
    legs. The load report has a problem for every leg that is not a hip yaw, pitch and roll with
    intersecting axes, a knee and an ankle.
    """

    class Params(Parameters):
        margin: float = parameter(0.05, unit="rad", ge=0.0, le=0.2, text="kept from joint limits")
        damping: float = live_parameter(
            3e-4, unit="m", gt=0.0, text="of the least squares for velocity"
        )
        speed_limit: float = live_parameter(
            30.0, unit="rad/s", gt=0.0, text="largest joint velocity"
        )

        softness: float = live_parameter(
            0.005, unit="m", ge=0.0, le=0.05, text="over which a stretching leg slows down"
        )

        follow: Literal["feet", "pitch", "plan"] = parameter(
            "feet", text="the feet's targets; those with the soles' planned pitch; or the plan's "
            "joints as long as the plan flies"
        )  # fmt: skip

        beyond: Literal["turn", "slide"] = live_parameter(
            "turn", text="what is given up first for a target out of reach"
        )

    needs = ("feet",)
    params: Params

    feet = Input(FootTarget, text="where the feet should be, from the base")
    joints = Input(JointState, text="measured joints: where to stay where any angle will do")
    reference = Input(JumpReference, default={}, text="the plan, where its joints are followed")
    target = Output(JointTarget, text="joint angles and velocities to track")
    lines = State(FootLines, text="to difference the lines")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Legs that the closed form can solve."""
        assert robot is not None
        for foot in range(len(robot.feet)):
            try:
                read_leg(robot, foot)
            except BlockError as error:
                yield Misfit(str(error))

    def setup(self) -> None:
        robot = self.robot
        self._legs = [read_leg(robot, foot) for foot in range(len(robot.feet))]
        margin = self.params.margin
        for leg in self._legs:
            leg.limits[:, 0] += margin
            leg.limits[:, 1] -= margin
        self._angles = np.zeros(5)
        self._speeds = np.zeros(5)
        self._sole = np.zeros(3)
        self._turn = np.zeros((3, 3))
        self._velocity, self._place = np.zeros(3), np.zeros(3)
        self._line = np.zeros(3)
        self._rate = np.zeros(3)
        self._jacobian = np.zeros((6, 5))
        self._rows = np.zeros((5, 5))
        self._turns = np.zeros((3, 5))
        self._normal = np.zeros((5, 5))

    def step(self) -> None:
        self._reach()
        if self.params.follow == "plan" and int(self.reference.phase) == Phase.FLIGHT:
            self.target.position[...] = self.reference.joint_position
            self.target.velocity[...] = self.reference.joint_velocity
            self.target.reachable[...] = True

    def _reach(self) -> None:
        """Joint angles and velocities for the feet's targets."""
        feet, target, lines = self.feet, self.target, self.lines
        angles, speeds, turn = self._angles, self._speeds, self._turn
        target.position[...] = self.joints.position
        target.velocity[...] = 0.0
        known = bool(lines.known[()])
        limit = self.params.speed_limit
        for foot, leg in enumerate(self._legs):
            wanted = feet.rotation[foot, :, 0]
            if self.params.follow == "pitch":
                pitched_line(
                    feet.rotation[foot], float(self.reference.foot_pitch[foot]), self._line
                )
                wanted = self._line
            yaw = float(self.joints.position[leg.joints[0]])
            inside, share = inverse(
                leg.hip, leg.plane, leg.signs, leg.limits, feet.position[foot], wanted,
                self.params.softness, yaw, angles,
            )  # fmt: skip
            target.reachable[foot] = inside
            np.clip(feet.velocity[foot], -_FASTEST, _FASTEST, out=self._velocity)
            if not inside and self.params.beyond == "slide":
                slid, kept = slide(
                    leg.hip, leg.plane, leg.signs, leg.limits, feet.position[foot],
                    feet.rotation[foot], self.params.softness, yaw, self._place, angles,
                )  # fmt: skip
                if slid:
                    share = kept
                    keep_along(feet.rotation[foot, :, 2], self._velocity)
            forward(leg.hip, leg.plane, leg.signs, angles, self._sole, turn)
            jacobian(leg.plane, leg.signs, angles, self._jacobian)
            line_rate(wanted, lines.direction[foot], self.period, known, self._rate)
            slow_stretch(leg.hip, leg.plane, self._sole, turn, share, self._velocity)
            inverse_velocity(
                self._jacobian, turn, self._velocity, self._rate, self.params.damping,
                self._rows, self._turns, self._normal, speeds,
            )  # fmt: skip
            for i, joint in enumerate(leg.joints):
                angle, speed = float(angles[i]), float(speeds[i])
                held = angle <= leg.limits[i, 0] or angle >= leg.limits[i, 1]
                target.position[joint] = angle
                target.velocity[joint] = 0.0 if held else min(max(speed, -limit), limit)
        lines.known[()] = True


@kernel
def pitched_line(rotation: Array, pitch: float, out: Array) -> None:
    """The x axis of ``rotation`` (3, 3), turned by ``pitch`` [rad] about its y axis."""
    cosine, sine = math.cos(pitch), math.sin(pitch)
    for i in range(3):
        out[i] = cosine * float(rotation[i, 0]) - sine * float(rotation[i, 2])


@kernel
def slide(
    hip: Array,
    plane: Array,
    signs: Array,
    limits: Array,
    sole: Array,
    rotation: Array,
    softness: float,
    present_yaw: float,
    place: Array,
    angles: Array,
) -> tuple[bool, float]:
    """Draw a ``sole`` out of reach, in its own plane, towards a place that is in reach.

    That is the one straight below the hip, seen from the sole, or where even that is out of reach
    the one on the base's z axis through the hip, where every angle of the hip is small. The place
    in reach that is nearest to the target on this way is found by bisection, to within a 256th
    of the way.

    Args:
        hip, plane, signs, limits, softness, present_yaw: as for ``inverse``.
        sole, rotation: the target's place and axes, of which the third is normal to the sole.
        place: scratch (3,).
        angles: out, the joint angles (5,) for that place; as they were where there is none.

    Returns:
        Whether there is such a place, and the second result of ``inverse`` for it.
    """
    nx, ny, nz = float(rotation[0, 2]), float(rotation[1, 2]), float(rotation[2, 2])
    if nz < _LEVEL or not abs(nx * nx + ny * ny + nz * nz - 1.0) < 0.1:
        return False, 1.0
    hx, hy, hz = float(hip[0]), float(hip[1]), float(hip[2])
    sx = min(max(float(sole[0]), -_FARTHEST), _FARTHEST)
    sy = min(max(float(sole[1]), -_FARTHEST), _FARTHEST)
    sz = min(max(float(sole[2]), -_FARTHEST), _FARTHEST)
    depth = nx * (hx - sx) + ny * (hy - sy) + nz * (hz - sz)
    line = rotation[:, 0]
    for axis in range(2):
        ax, ay, az = hx - depth * nx, hy - depth * ny, hz - depth * nz
        if axis == 1:
            ax, ay, az = hx, hy, hz - depth / nz
        near, far, share = 0.0, 1.0, 1.0
        for step in range(_HALVINGS + 2):
            # First the end of the way, whether it is in reach; halves of it; the answer again.
            last = step == _HALVINGS + 1
            part = near if step == 0 or last else 0.5 * (near + far)
            place[0] = ax + part * (sx - ax)
            place[1] = ay + part * (sy - ay)
            place[2] = az + part * (sz - az)
            inside, kept = inverse(
                hip, plane, signs, limits, place, line, softness, present_yaw, angles
            )
            if inside:
                near, share = part, kept
            elif step == 0:
                break
            else:
                far = part
            if last:
                return True, share
    inverse(hip, plane, signs, limits, sole, line, softness, present_yaw, angles)
    return False, 1.0


@kernel
def keep_along(axis: Array, vector: Array) -> None:
    """Keep of ``vector`` (3,) only its part along ``axis`` (3,), of unit length."""
    part = 0.0
    for i in range(3):
        part += float(axis[i]) * float(vector[i])
    for i in range(3):
        vector[i] = part * float(axis[i])


@kernel
def slow_stretch(
    hip: Array, plane: Array, sole: Array, rotation: Array, share: float, velocity: Array
) -> None:
    """Keep only a ``share`` of the velocity [m/s] that leads the ankle away from the hip.

    Args:
        hip, plane: of the ``Leg``.
        sole, rotation: of the foot, from ``leg_kinematics.forward``.
    """
    if share == 1.0:
        return
    square, along = 1e-9, 0.0
    for i in range(3):
        lever = float(plane[2, 0]) * float(rotation[i, 0]) + float(plane[2, 1]) * float(
            rotation[i, 2]
        )
        reach = float(sole[i]) - lever - float(hip[i])
        square += reach * reach
        along += reach * float(velocity[i])
    scale = (1.0 - share) * along / square
    for i in range(3):
        lever = float(plane[2, 0]) * float(rotation[i, 0]) + float(plane[2, 1]) * float(
            rotation[i, 2]
        )
        velocity[i] -= scale * (float(sole[i]) - lever - float(hip[i]))


@kernel
def line_rate(line: Array, last: Array, period: float, known: bool, out: Array) -> None:
    """How fast the direction of ``line`` turns [1/s]; ``last`` becomes its direction now."""
    x, y, z = float(line[0]), float(line[1]), float(line[2])
    largest = max(abs(x), abs(y), abs(z))
    if largest < 1e-300:
        x, y, z = 1.0, 0.0, 0.0
    else:
        x, y, z = x / largest, y / largest, z / largest
    size = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    dx, dy, dz = x - float(last[0]), y - float(last[1]), z - float(last[2])
    jumped = dx * dx + dy * dy + dz * dz > _JUMP * _JUMP
    scale = 0.0 if jumped or not known else 1.0 / period
    out[0], out[1], out[2] = scale * dx, scale * dy, scale * dz
    last[0], last[1], last[2] = x, y, z
