"""Computes from the momentum in flight where the feet should land."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...mathematics.polynomials import minimum_jerk
from ...mathematics.rotations import (
    conjugate,
    cross,
    exponential,
    from_matrix,
    logarithm,
    multiply,
    to_matrix,
    yaw,
)
from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, FootTarget, JumpReference, Phase, PhaseState

Array = NDArray[np.float64]


def _three(value: object) -> object:
    """One number stands for all three axes."""
    return (value,) * 3 if isinstance(value, int | float) else value


Share = Annotated[float, pydantic.Field(ge=0.0, le=1.0)]
Shares = Annotated[tuple[Share, Share, Share], pydantic.BeforeValidator(_three)]


class LandingMemory(Signal):
    """The state of ``LandingHeuristic``."""

    flying = Field(dtype="bool", text="whether the robot flew at the last tick")
    offset = Field(
        ("n_feet", 3), unit="m", frame="world", text="feet at lift-off, measured minus planned"
    )
    goal = Field(("n_feet", 3), unit="m", frame="world", text="where the feet last aimed")
    planned = Field(("n_feet", 3), unit="m", frame="world", text="planned feet from the com")
    linear = Field(3, unit="kg m/s", frame="world", text="planned linear momentum")
    angular = Field(3, unit="N m s", frame="world", text="planned angular momentum")
    orientation = Field(4, unit="", text="planned base quaternion x, y, z, w")


class LandingHeuristic(Block):
    """Foot targets in flight from momentum feedback (paper, IV).

    All places are relative to the centre of mass, in world axes. The law, for each of any number
    of feet, with p_nom the planned foot and its side s = 1 on the left of the base, -1 on the
    right and 0 in the middle (the paper's (-1)^i):

        p^x = p_nom^x + W_l^x l^x + W_k^x k^y
        p^y = p_nom^y + W_l^y l^y + W_k^y k^x
        Delta y = W_c |l^y|
        p_des^x = p^x                   where |p^x - c^x| <= p_max^x, else at that limit
        p_des^y = p^y + s Delta y       likewise, of the sum, with p_max^y

    The limits are centred at c: the centre of mass with ``limits_about: com``, as in the paper;
    the foot's place below a standing robot with ``limits_about: stance``, for robots whose feet
    stand far from the centre of mass, such as quadrupeds.

    With ``law: paper`` l and k are the measured momenta. With ``law: deviation`` they are the
    measured momenta minus the planned ones: the planned footholds already fit the planned momentum,
    so feeding back the whole momentum of a forward jump would count it twice.

    The foot moves there from its position at lift-off, along x and y with minimum jerk over
    ``reach_share`` of the predicted flight. Its height follows the plan (paper, V), and near
    touchdown the foot moves upwards at the speed ``retraction``, to land softly.

    The target is rotated into the body's frame by R_ref Exp(alpha Log(R_ref' R)). With ``alpha`` 1
    it is fixed in the world, whatever the torso does; with 0 it is fixed in the planned body, as in
    the paper. The target of the sole is flat, with the planned heading.

    With z up a push along +x gives l^x > 0 and k^y > 0, and along +y l^y > 0 and k^x < 0, so the
    stabilising signs are W_l > 0, W_k^x > 0 and W_k^y < 0. In LANDING a foot that is still in the
    air moves on to its last target, at the height of the lowest sole; otherwise the target is the
    plan. In a flight that is longer than planned the plan stays at its last instant before
    touchdown. Whether a leg can reach the target is left to its inverse kinematics.
    """

    class Params(Parameters):
        law: Literal["paper", "deviation"] = parameter(
            "deviation",
            text="the momentum fed back: the measured one, or its deviation from the plan",
        )
        w_l: tuple[float, float] = live_parameter(
            (0.03, 0.04), unit="s/kg", text="W_l: metres per linear momentum along x and y"
        )
        w_k: tuple[float, float] = live_parameter(
            (0.0, 0.0), unit="s/(kg m)", text="W_k: metres per angular momentum about y and x"
        )
        w_c: float = live_parameter(
            0.04, unit="s/kg", ge=0.0, text="W_c: sideways clearance per lateral momentum"
        )
        p_max: tuple[float, float] = live_parameter(
            (0.15, 0.16), unit="m", text="farthest places ahead and aside the leg can reach"
        )
        limits_about: Literal["com", "stance"] = parameter(
            "com", text="the centre of the limits p_max: the centre of mass, or each foot's stance"
        )
        alpha: Shares = live_parameter(
            (1.0, 1.0, 1.0),
            text="share of the torso's rotation about x, y and z that the legs compensate",
        )
        reach_share: float = live_parameter(
            0.7, gt=0.0, le=1.0, text="share of the predicted flight by which the feet are there"
        )
        retraction: float = live_parameter(
            0.3, unit="m/s", ge=0.0, le=2.0, text="upward speed of the feet at touchdown"
        )
        retraction_time: float = live_parameter(
            0.06, unit="s", gt=0.0, text="how long before touchdown it begins"
        )

    needs = ("feet",)
    params: Params
    reference = Input(JumpReference, text="the plan")
    phase = Input(PhaseState, text="the phase and the time to touchdown")
    terms = Input(DynamicsTerms, text="the present state")
    feet = Output(FootTarget, text="where the feet should be, and where they should land")
    memory = State(LandingMemory, text="lift-off, and the plan as long as it lasts")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Report limits within which the robot cannot stand."""
        assert isinstance(params, cls.Params) and robot is not None
        if params.limits_about == "stance":
            return
        for foot, place in zip(robot.feet, standing_feet(robot), strict=True):
            x, y = abs(float(place[0])), abs(float(place[1]))
            if x > params.p_max[0] or y > params.p_max[1]:
                yield Misfit(
                    f"{foot.name} of {robot.name} stands {x:.3f} m ahead or behind and {y:.3f} m "
                    "beside the centre of mass, which is beyond p_max",
                    parameter="p_max",
                    expected="limits within which every foot stands",
                    found=f"({params.p_max[0]} m, {params.p_max[1]} m)",
                    fix="limits_about: stance",
                )
                return

    def setup(self) -> None:
        robot = self.robot
        self._mass = robot.total_mass
        stance = standing_feet(robot)
        self._sides = foot_sides(stance)
        self._turned = self.params.limits_about == "stance"
        self._stance = stance if self._turned else np.zeros_like(stance)
        self._centres = np.zeros_like(stance)
        self.on_parameters()
        n = len(robot.feet)
        self._place, self._speed = np.zeros((n, 3)), np.zeros(3)
        self._linear, self._angular = np.zeros(3), np.zeros(3)
        self._quaternion, self._other = np.zeros(4), np.zeros(4)
        self._rotation, self._heading = np.zeros((3, 3)), np.zeros((3, 3))
        self._vector, self._com_body, self._rate = np.zeros(3), np.zeros(3), np.zeros(3)
        self._scratch = np.zeros(3)

    def on_parameters(self) -> None:
        p = self.params
        self._w_l, self._w_k, self._p_max = np.array(p.w_l), np.array(p.w_k), np.array(p.p_max)
        self._alpha = np.array(p.alpha)
        self._beta = 1.0 - self._alpha

    def step(self) -> None:
        p, reference, terms, memory = self.params, self.reference, self.terms, self.memory
        phase = int(self.phase.phase)
        flying, landing = phase == Phase.FLIGHT, phase == Phase.LANDING
        overdue = flying and int(reference.phase) > Phase.FLIGHT
        if not overdue:
            self._remember_plan()
        self._feed_back()
        if flying and not memory.flying:
            np.subtract(terms.foot_position, terms.com, out=memory.offset)
            np.subtract(memory.offset, memory.planned, out=memory.offset)
        memory.flying[()] = flying
        elapsed, left = float(self.phase.time_in_phase), float(self.phase.time_to_touchdown)
        reach = p.reach_share * max(elapsed + left, self.period)
        share, rate, _ = minimum_jerk(elapsed / reach)
        lift, lift_rate = retraction(left, p.retraction, p.retraction_time)
        lowest = lowest_height(terms.foot_position)
        self._turn_frame(overdue)
        if self._turned:
            turn_places(self._stance, yaw(memory.orientation), self._centres)
        for foot in range(len(self._sides)):
            planned, place = memory.planned[foot], self.feet.landing[foot]
            landing_place(
                planned, self._sides[foot], self._linear, self._angular,
                self._w_l, self._w_k, p.w_c, self._p_max, self._centres[foot], place,
            )  # fmt: skip
            np.subtract(reference.foot_velocity[foot], reference.com_velocity, out=self._speed)
            if overdue:
                self._speed[:] = 0.0
            if flying:
                swing(
                    planned, place, memory.offset[foot], share, rate / reach,
                    self._place[foot], self._speed,
                )  # fmt: skip
                self._place[foot, 2] += lift
                self._speed[2] += lift_rate
                np.add(terms.com, place, out=memory.goal[foot])
            elif landing:
                np.subtract(memory.goal[foot], terms.com, out=self._place[foot])
                self._place[foot, 2] = lowest - float(terms.com[2])
                np.negative(terms.com_velocity, out=self._speed)
            else:
                self._place[foot] = planned
            self._to_body(foot)

    def _remember_plan(self) -> None:
        """Keep the plan of this instant, unless it is past its touchdown."""
        reference, memory = self.reference, self.memory
        np.subtract(reference.foot_position, reference.com, out=memory.planned)
        np.multiply(reference.com_velocity, self._mass, out=memory.linear)
        memory.angular[...] = reference.angular_momentum
        memory.orientation[...] = reference.orientation

    def _feed_back(self) -> None:
        """Compute the momenta that the law feeds back."""
        self._linear[:] = self.terms.linear_momentum
        self._angular[:] = self.terms.angular_momentum
        if self.params.law == "deviation":
            np.subtract(self._linear, self.memory.linear, out=self._linear)
            np.subtract(self._angular, self.memory.angular, out=self._angular)

    def _turn_frame(self, overdue: bool) -> None:
        """Compute the frame that the targets are fixed in, its rate, and the CoM in the body."""
        terms, planned, turn = self.terms, self.memory.orientation, self._other
        from_matrix(terms.base_rotation, self._quaternion)
        conjugate(planned, turn)
        multiply(turn, self._quaternion, turn)
        logarithm(turn, self._vector)
        np.multiply(self._vector, self._alpha, out=self._vector)
        exponential(self._vector, turn)
        multiply(planned, turn, turn)
        to_matrix(turn, self._rotation)
        np.multiply(terms.velocity[3:6], self._alpha, out=self._rate)
        if not overdue:
            np.multiply(self.reference.angular_velocity, self._beta, out=self._vector)
            np.add(self._rate, self._vector, out=self._rate)
        np.subtract(terms.com, terms.base_position, out=self._vector)
        np.dot(terms.base_rotation.T, self._vector, self._com_body)

    def _to_body(self, foot: int) -> None:
        """Convert position and velocity relative to the CoM into those relative to the base."""
        terms, feet, vector, scratch = self.terms, self.feet, self._vector, self._scratch
        turn = self._rotation.T
        np.dot(turn, self._place[foot], vector)
        np.add(self._com_body, vector, out=feet.position[foot])
        velocity = feet.velocity[foot]
        np.dot(turn, self._speed, velocity)
        cross(self._rate, vector, scratch)
        np.subtract(velocity, scratch, out=velocity)
        np.dot(terms.base_rotation.T, terms.com_velocity, scratch)
        np.add(velocity, scratch, out=velocity)
        np.subtract(velocity, terms.velocity[0:3], out=velocity)
        cross(terms.velocity[3:6], self._com_body, scratch)
        np.subtract(velocity, scratch, out=velocity)
        heading_matrix(float(self.reference.foot_yaw[foot]), self._heading)
        np.dot(turn, self._heading, feet.rotation[foot])


def standing_feet(robot: RobotDescription) -> Array:
    """The sole centres (n_feet, 3) [m] from the centre of mass, of a robot in its standing pose."""
    level = np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = link_poses(robot, np.zeros((1, 3)), level, robot.standing_position[None])
    com, feet = np.zeros(3), np.zeros((len(robot.feet), 3))
    for link in robot.links:
        place, turn = poses.of(link.name)
        com += link.mass / robot.total_mass * (place[0] + turn[0] @ np.array(link.com))
    for number, foot in enumerate(robot.feet):
        place, turn = poses.of(foot.link)
        feet[number] = place[0] + turn[0] @ np.array(foot.sole) - com
    return feet


def foot_sides(feet: Array) -> tuple[float, ...]:
    """For every foot 1 on the left of the base, -1 on the right, 0 in the middle (1 mm)."""
    return tuple(math.copysign(1.0, y) if abs(y) > 1e-3 else 0.0 for y in feet[:, 1].tolist())


@kernel
def landing_place(
    nominal: Array,
    side: float,
    linear: Array,
    angular: Array,
    w_l: Array,
    w_k: Array,
    w_c: float,
    p_max: Array,
    centre: Array,
    out: Array,
) -> None:
    """The paper's law (IV): the landing place (3,) from the nominal one (3,); z is unchanged.

    Args:
        side: 1 for a foot on the left, -1 on the right, 0 in the middle.
        linear, angular: the momenta l and k fed back.
        p_max: the largest distance of the place from ``centre`` (3,), ahead and aside [m].
    """
    x = float(nominal[0]) + float(w_l[0]) * float(linear[0]) + float(w_k[0]) * float(angular[1])
    y = float(nominal[1]) + float(w_l[1]) * float(linear[1]) + float(w_k[1]) * float(angular[0])
    y += side * w_c * abs(float(linear[1]))
    far_x, far_y = float(p_max[0]), float(p_max[1])
    dx, dy = x - float(centre[0]), y - float(centre[1])
    out[0] = x if abs(dx) <= far_x else float(centre[0]) + math.copysign(far_x, dx)
    out[1] = y if abs(dy) <= far_y else float(centre[1]) + math.copysign(far_y, dy)
    out[2] = nominal[2]


@kernel
def turn_places(places: Array, angle: float, out: Array) -> None:
    """Rotate places (n, 3) about the vertical by ``angle`` [rad]."""
    cosine, sine = math.cos(angle), math.sin(angle)
    for i in range(places.shape[0]):
        x, y = float(places[i, 0]), float(places[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = cosine * x - sine * y, sine * x + cosine * y, places[i, 2]


@kernel
def lowest_height(points: Array) -> float:
    """The least z of points (n, 3)."""
    lowest = float(points[0, 2])
    for i in range(1, points.shape[0]):
        lowest = min(lowest, float(points[i, 2]))
    return lowest


@kernel
def swing(
    planned: Array, place: Array, offset: Array, share: float, rate: float, out: Array, speed: Array
) -> None:
    """The motion of a foot from its offset at lift-off to its corrected landing place.

    Args:
        planned, place: the positions relative to the centre of mass [m, world] without and with the
            correction, (3,).
        offset: the measured minus the planned position at lift-off [m, world], (3,).
        share, rate: the share of the way, from 0 to 1, and its time derivative [1/s].
        out: becomes the foot's position.
        speed: the planned velocity [m/s], which becomes the foot's.
    """
    for k in range(3):
        goal = float(place[k]) - float(planned[k])
        start = float(offset[k])
        out[k] = float(planned[k]) + start + share * (goal - start)
        speed[k] += rate * (goal - start)


@kernel
def retraction(left: float, speed: float, duration: float) -> tuple[float, float]:
    """Height added to the foot and its rate, ``left`` seconds before touchdown.

    It first reaches down, then comes up, so that at touchdown it is zero and its rate ``speed``.
    """
    x = min(max(left / duration, 0.0), 1.0)
    return -speed * duration * x * (1.0 - x) ** 2, speed * (1.0 - x) * (1.0 - 3.0 * x)


@kernel
def heading_matrix(angle: float, out: Array) -> None:
    """The rotation about the vertical by ``angle`` [rad], (3, 3)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    out[:, :] = 0.0
    out[0, 0] = out[1, 1] = cosine
    out[0, 1], out[1, 0], out[2, 2] = -sine, sine, 1.0
