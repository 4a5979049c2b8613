"""Computes from the momentum in flight where the feet should land."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.landing_law import (
    hasten,
    heading_matrix,
    keep_within,
    landing_place,
    lowest_height,
    retraction,
    swing,
    turn_places,
)
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
from ...robots.standing_feet import foot_sides, standing_feet
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, FootTarget, JumpReference, Phase, PhaseState
from .landing_prediction import LandingPrediction, PredictionGains

Array = NDArray[np.float64]


def _three(value: object) -> object:
    """One number stands for all three axes."""
    return (value,) * 3 if isinstance(value, int | float) else value


_SLOWEST = 0.3
"""The least speed of descent [m/s] by which a change of the legs' length changes the time."""
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
    swing = Field(("n_feet", 3), unit="m/s", frame="world", text="their planned speed from the com")
    linear = Field(3, unit="kg m/s", frame="world", text="planned linear momentum")
    angular = Field(3, unit="N m s", frame="world", text="planned angular momentum")
    orientation = Field(4, unit="", text="planned base quaternion x, y, z, w")
    shift = Field(4, unit="m", frame="world", text="chosen: ahead, to the left, apart, upwards")
    started = Field(dtype="bool", text="whether the plan's place in the world is known")
    origin = Field(3, unit="m", frame="world", text="position of the plan's origin")
    lift_off_time = Field(unit="s", text="planned lift-off of the flight under way or next")
    wished = Field(3, unit="m", frame="world", text="planned place of the com at touchdown")


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

    With ``law: predicted`` the landing place is chosen anew in every tick, from the momenta that
    were not planned, by what it does to the torso. Feet that keep their place in the world turn a
    torso that tilts even further; drawn up they turn BRUCE's forward, by 5 to 8 deg per cm
    (``mathematics/flight_prediction``). All feet are shifted ahead, to the left, apart and upwards
    by the s that costs least::

        (s_x - g_x)^2 + (s_y - g_y)^2 + (apart_cost (s_a - g_a))^2 + (height_cost s_z)^2
            + sum over roll and pitch of (tilt_cost h (tilt - free))^2

    where tilt is the deviation from the planned orientation at touchdown, linear in s, of which up
    to ``free_tilt`` costs nothing. s_z is within ``height_range`` h, but drawn up legs must keep
    the stroke in which ``stop_acceleration`` g stops the fall. The goal g is the capture point of
    the linear inverted pendulum of the standing height h, w^2 = g / h, times the gains::

        g_x = capture l^x / (m w) + capture_turn k^y w / (m g),
        g_y = capture l^y / (m w) - capture_turn k^x w / (m g),    g_a = clearance |l^y| / (m w)

    These gains have no unit, so they are the same for robots of any size. p_max applies as above.

    A robot that lifts off with a slightly wrong velocity lands beside its place, and feet that go to
    the capture point land even further off. Let e be by how much unshifted feet would miss their
    planned place in the world, by the measured motion, and d = g + e the way from that place to the
    capture point, both horizontal. Then g is replaced by

        g - place_gain / (1 + (|d| / (place_range h))^4) d

    so a small miss, within which standing feet keep the balance, is partly made good; after a push
    the feet go to the capture point. Touchdown comes some milliseconds before its prediction, and in
    a long jump the feet still swing then. So they are ahead of their planned way by ``lead_time``.

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

    class Params(PredictionGains):
        law: Literal["paper", "deviation", "predicted"] = parameter(
            "deviation",
            text="feed back the measured momentum, or its deviation from the plan; or predict",
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
        self._prediction = LandingPrediction(robot, -float(stance[:, 2].mean()), self._sides)
        self._predicts = self.params.law == "predicted"
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
        self._scratch, self._miss = np.zeros(3), np.zeros(3)

    def on_parameters(self) -> None:
        p = self.params
        self._w_l, self._w_k, self._p_max = np.array(p.w_l), np.array(p.w_k), np.array(p.p_max)
        self._alpha = np.array(p.alpha)
        self._beta = 1.0 - self._alpha
        if self._predicts:
            self._prediction.prepare(p)

    def step(self) -> None:
        p, reference, terms, memory = self.params, self.reference, self.terms, self.memory
        phase = int(self.phase.phase)
        flying, landing = phase == Phase.FLIGHT, phase == Phase.LANDING
        if not memory.started:
            self._find_origin()
        self._remember_landing(flying)
        overdue = flying and int(reference.phase) > Phase.FLIGHT
        if not overdue:
            self._remember_plan()
        self._feed_back()
        if flying and not memory.flying:
            memory.shift[...] = 0.0
            np.subtract(terms.foot_position, terms.com, out=memory.offset)
            np.subtract(memory.offset, memory.planned, out=memory.offset)
        memory.flying[()] = flying
        elapsed, left = float(self.phase.time_in_phase), float(self.phase.time_to_touchdown)
        if self._predicts and flying:
            left = self._predict(left)
        reach = p.reach_share * max(elapsed + left, self.period)
        share, rate, _ = minimum_jerk(elapsed / reach)
        lift, lift_rate = retraction(left, p.retraction, p.retraction_time)
        lowest = lowest_height(terms.foot_position)
        self._turn_frame(overdue)
        if self._turned:
            turn_places(self._stance, yaw(memory.orientation), self._centres)
        for foot in range(len(self._sides)):
            planned, place = memory.planned[foot], self.feet.landing[foot]
            self._choose_place(foot, planned, place)
            np.subtract(reference.foot_velocity[foot], reference.com_velocity, out=self._speed)
            if overdue:
                self._speed[:] = 0.0
            else:
                memory.swing[foot] = self._speed
            if flying:
                swing(
                    planned, place, memory.offset[foot], share, rate / reach,
                    self._place[foot], self._speed,
                )  # fmt: skip
                if self._predicts:
                    hasten(
                        memory.swing[foot], p.lead_time * share, p.lead_time * rate / reach,
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
        mass = float(self.terms.mass_matrix[0, 0]) or self._mass
        np.multiply(reference.com_velocity, mass, out=memory.linear)
        np.multiply(reference.angular_momentum, mass / self._mass, out=memory.angular)
        memory.orientation[...] = reference.orientation

    def _find_origin(self) -> None:
        """Note the place of the plan in the world, by the middle of the feet."""
        memory, n = self.memory, len(self._sides)
        for k in range(3):
            for foot in range(n):
                memory.origin[k] += (
                    float(self.terms.foot_position[foot, k])
                    - float(self.reference.foot_position[foot, k])
                ) / n
        memory.started[()] = True

    def _remember_landing(self, flying: bool) -> None:
        """Keep where the centre of mass should touch down, before the plan names the next jump."""
        reference, memory = self.reference, self.memory
        if not flying:
            memory.lift_off_time[()] = reference.lift_off_time
        elif reference.lift_off_time != memory.lift_off_time:
            return
        fall = float(reference.touchdown_time) - float(reference.time)
        if flying and fall < 0.0:
            return
        np.multiply(reference.com_velocity, fall, out=memory.wished)
        memory.wished += reference.com
        memory.wished += memory.origin

    def _predict(self, left: float) -> float:
        """Choose the shift; returns the time [s] to a touchdown with the legs that much shorter."""
        memory, terms, miss = self.memory, self.terms, self._miss
        np.multiply(terms.com_velocity, left, out=miss)
        miss += terms.com
        miss -= memory.wished
        self._prediction.choose(
            terms, self.reference, memory.planned, memory.orientation, self._linear, self._angular,
            miss, left, memory.shift,
        )  # fmt: skip
        speed = max(GRAVITY * left - float(terms.com_velocity[2]), _SLOWEST)
        return max(left + float(memory.shift[3]) / speed, 0.0)

    def _choose_place(self, foot: int, planned: Array, place: Array) -> None:
        """The landing place of a foot from the centre of mass, by the law."""
        p, side, centre = self.params, self._sides[foot], self._centres[foot]
        if self._predicts:
            shift = self.memory.shift
            place[...] = planned
            place[0] += shift[0]
            place[1] += shift[1] + side * shift[2]
            place[2] += shift[3]
            keep_within(self._p_max, centre, place)
            return
        landing_place(
            planned, side, self._linear, self._angular, self._w_l, self._w_k, p.w_c, self._p_max,
            centre, place,
        )  # fmt: skip

    def _feed_back(self) -> None:
        """Compute the momenta that the law feeds back."""
        self._linear[:] = self.terms.linear_momentum
        self._angular[:] = self.terms.angular_momentum
        if self.params.law != "paper":
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
