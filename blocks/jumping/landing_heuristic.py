"""Where the feet should land, from the momentum in flight."""

from __future__ import annotations

import math
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
)
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Output, State
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
    """What the landing heuristic remembers of lift-off."""

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

    All places are relative to the centre of mass, in world axes. The law, for foot i (0 left,
    1 right), with p_nom the planned foot:

        p^x = p_nom^x + W_l^x l^x + W_k^x k^y
        p^y = p_nom^y + W_l^y l^y + W_k^y k^x
        Delta y = W_c |l^y|
        p_des^x = p^x                       where |p^x| <= p_max^x, else p_max^x sgn(p^x)
        p_des^y = p^y + (-1)^i Delta y      likewise, of the sum, with p_max^y

    With ``law: paper`` l and k are the measured momenta. With ``law: deviation`` they are what
    the measured ones deviate from the plan's: the plan's footholds already fit its own momentum,
    so a forward jump is not answered twice.

    The foot goes there from where it was at lift-off, along x and y with least jerk over
    ``reach_share`` of the predicted flight; z follows the plan (paper, V), and near touchdown
    moves at ``retraction`` upwards, to land softly.

    The target turns into the body's frame by R_ref Exp(alpha Log(R_ref' R)): with ``alpha`` 1 it
    is fixed in the world, whatever the torso does; with 0 it is fixed in the planned body, as the
    paper has it. The sole's target is flat, heading as planned.

    With z up a push along +x gives l^x > 0 and k^y > 0, and along +y l^y > 0 and k^x < 0: so the
    helpful signs are W_l > 0, W_k^x > 0 and W_k^y < 0. In LANDING a foot that is still in the air
    goes on to where it last aimed, at the height of the lowest sole; else the target is the plan.
    A flight longer than planned goes on with the plan's last instant before touchdown.
    Does not ask whether a leg can reach the target (its inverse kinematics does).
    """

    class Params(Parameters):
        law: Literal["paper", "deviation"] = parameter(
            "deviation", text="which momentum is fed back: all of it, or what was not planned"
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
        alpha: Shares = live_parameter(
            (1.0, 1.0, 1.0),
            text="share of the torso's rotation about x, y and z that the legs make up for",
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

    def setup(self) -> None:
        robot = self.robot
        self._mass = robot.total_mass
        self._sides = foot_sides(robot)
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
        for foot in range(len(self._sides)):
            planned, place = memory.planned[foot], self.feet.landing[foot]
            landing_place(
                planned, self._sides[foot], self._linear, self._angular,
                self._w_l, self._w_k, p.w_c, self._p_max, place,
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
        """The plan of this instant, for as long as it is not past its touchdown."""
        reference, memory = self.reference, self.memory
        np.subtract(reference.foot_position, reference.com, out=memory.planned)
        np.multiply(reference.com_velocity, self._mass, out=memory.linear)
        memory.angular[...] = reference.angular_momentum
        memory.orientation[...] = reference.orientation

    def _feed_back(self) -> None:
        """The momenta that the law answers."""
        self._linear[:] = self.terms.linear_momentum
        self._angular[:] = self.terms.angular_momentum
        if self.params.law == "deviation":
            np.subtract(self._linear, self.memory.linear, out=self._linear)
            np.subtract(self._angular, self.memory.angular, out=self._angular)

    def _turn_frame(self, overdue: bool) -> None:
        """The frame the targets are fixed in, its rate, and the centre of mass in the body's."""
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
        """Place and speed relative to the centre of mass, seen from the moving base."""
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


def foot_sides(robot: RobotDescription) -> tuple[float, ...]:
    """For every foot (-1)^i: 1 on the left of the base, -1 on the right."""
    sides = []
    for foot in robot.feet:
        link, aside = foot.link, foot.sole[1]
        while link != robot.base:
            joint = next(j for j in robot.joints if j.child == link)
            aside += joint.origin[1]
            link = joint.parent
        sides.append(1.0 if aside >= 0.0 else -1.0)
    return tuple(sides)


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
    out: Array,
) -> None:
    """The paper's law: the place (3,) from the nominal one (3,); z stays.

    Args:
        side: (-1)^i, 1 for the left foot.
        linear, angular: the momenta l and k fed back.
    """
    x = float(nominal[0]) + float(w_l[0]) * float(linear[0]) + float(w_k[0]) * float(angular[1])
    y = float(nominal[1]) + float(w_l[1]) * float(linear[1]) + float(w_k[1]) * float(angular[0])
    y += side * w_c * abs(float(linear[1]))
    far_x, far_y = float(p_max[0]), float(p_max[1])
    out[0] = x if abs(x) <= far_x else math.copysign(far_x, x)
    out[1] = y if abs(y) <= far_y else math.copysign(far_y, y)
    out[2] = nominal[2]


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
    """The foot on its way: the plan, the offset of lift-off fading, the correction growing.

    Args:
        planned, place: relative to the centre of mass, without and with the correction.
        share, rate: of the way, from 0 to 1, and its time derivative [1/s].
        out: the foot's place; speed: in, the plan's; out, the foot's.
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
def heading_matrix(yaw: float, out: Array) -> None:
    """The rotation about the vertical by ``yaw`` (3, 3)."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    out[:, :] = 0.0
    out[0, 0] = out[1, 1] = cosine
    out[0, 1], out[1, 0], out[2, 2] = -sine, sine, 1.0
