"""Steps after touchdown, where the feet no longer support the robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...mathematics.capture_step import (
    capture_point,
    choose_foothold,
    farthest_foot,
    limit_foothold,
    spread_to_feet,
    swing_points,
)
from ...mathematics.rotations import mean_heading
from ...mathematics.support_margin import support_margin
from ...robots.standing_feet import foot_sides, standing_feet
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JumpReference, Phase, PhaseState

Array = NDArray[np.float64]

_EARLIEST, _LATEST = 0.6, 1.5
"""The share of a step's duration after which a contact ends it, and that at which it ends anyway."""
_AIMED = 0.25
"""The last share of a step in which the foothold stays as it is."""
_NEARER = 0.005
"""A foot is preferred if it comes nearer to its foothold by more than this [m]."""


class StepMemory(Signal):
    """The state of ``CaptureStep``."""

    foot = Field(dtype="int64", text="the foot that steps, counted from 1; 0 for none")
    elapsed = Field(unit="s", text="how long it has stepped")
    taken = Field(dtype="int64", text="steps taken so far")
    outside = Field(unit="s", text="how long the capture point has been outside the support")
    last = Field(unit="s", text="time after touchdown at which the last step ended")
    ground = Field(unit="m", frame="world", text="height of the ground under the stepping foot")
    heading = Field(
        unit="rad", frame="world", text="mean heading of the feet before the first step"
    )
    foothold = Field(("n_feet", 3), unit="m", frame="world", text="where each foot last went")


class CaptureStep(Block):
    """Takes a step after touchdown, or several, where the feet can no longer hold the robot.

    It passes the phase on unchanged unless a foot steps. After the last planned touchdown it
    computes in every tick the capture point xi of the linear inverted pendulum
    (``mathematics/capture_step``)::

        xi = c + c' / w + turn (k_y, -k_x) w / (m g),    w^2 = g / (c_z - ground)

    A foot steps where xi has been outside the support polygon by more than ``margin`` for
    ``confirmation``, at the earliest ``after`` touchdown, while all feet stand, and ``steps`` times
    at most. The support polygon is that of all points of the feet.

    **Where.** While the foot is in the air the others push at p, where they are nearest to xi, and
    xi runs away from there. The foot goes to where xi will be as it lands, and a share farther::

        foothold = p + (1 + beyond) (xi - p) exp(w left)

    It stays within ``reach`` ahead of and behind the other feet and, in multiples of their distance
    in standing, within ``apart`` to its own side of them, so that the legs do not cross. The
    foothold is computed anew in every tick until the last quarter of the step. The foot that steps
    is the one for which these limits change the foothold least, so in a fall sideways the foot on
    that side, though it carries the robot; of equals it is the one farther from xi.

    **How.** The points of the foot leave the stance and get an acceleration, which is that of the
    motion of least mean square acceleration from where they are to their place, with a flat sole
    and the heading that the feet had before the first step. The whole-body controller follows it as
    a task and computes the torques of both legs (``ContactPoints``), so the leg's reaction on the
    body is taken into account. The step ends with the first contact after 0.6 of ``duration``, or
    after 1.5 of it. The robot stays in LANDING, low, until ``settle`` after the last step, and then
    recovers.

    The block plans one step at a time, on level ground, and does not return the feet to where they
    stood. A robot with a single foot takes none.
    """

    class Params(Parameters):
        steps: int = live_parameter(
            0, ge=0, le=20, text="the most steps it takes; 0: it only stands"
        )
        margin: float = live_parameter(
            0.015, unit="m", ge=0.0, text="how far outside the support the capture point must be"
        )
        confirmation: float = live_parameter(
            0.006, unit="s", ge=0.0, text="how long it must be there"
        )
        after: float = live_parameter(
            0.08, unit="s", ge=0.0, text="time after touchdown before which no foot steps"
        )
        turn: float = live_parameter(
            1.0, ge=0.0, le=1.0, text="share of the angular momentum that counts"
        )
        duration: float = live_parameter(0.13, unit="s", gt=0.04, le=1.0, text="of a step")
        height: float = live_parameter(
            0.015, unit="m", gt=0.0, le=0.2, text="how high the foot is lifted"
        )
        beyond: float = live_parameter(
            0.1, ge=0.0, le=1.0, text="how much farther the foot goes than the capture point"
        )
        reach: float = live_parameter(
            0.2, unit="m", gt=0.0, text="farthest place ahead of or behind the other feet"
        )
        apart: tuple[float, float] = live_parameter(
            (0.6, 1.8), text="least and largest distance aside, in distances of the standing feet"
        )
        settle: float = live_parameter(
            0.35, unit="s", ge=0.0, text="time from a step until the robot rises again"
        )

    needs = ("feet",)
    params: Params
    before = Input(PhaseState, text="the phase and the stance points by plan and contacts")
    reference = Input(JumpReference, text="the plan, for whether another jump follows")
    terms = Input(DynamicsTerms, text="the present state")
    phase = Output(PhaseState, text="the same, with the steps")
    memory = State(StepMemory, text="the step under way, and those taken")

    def setup(self) -> None:
        robot = self.robot
        stance = standing_feet(robot)
        self._n_feet = len(robot.feet)
        self._mass = robot.total_mass
        self._foot_of_point = np.array(robot.foot_of_contact(), dtype=np.int64)
        self._sides = foot_sides(stance)
        self._apart = np.zeros(self._n_feet)
        for foot, place in enumerate(stance):
            others = np.delete(stance, foot, axis=0)
            if len(others):
                self._apart[foot] = abs(float(place[1]) - float(others[:, 1].mean()))
        self._offset = np.array(
            [
                np.array(point.position) - np.array(robot.feet[foot].sole)
                for point, foot in zip(robot.contacts, self._foot_of_point, strict=True)
            ]
        )
        self._capture, self._nearest, self._scratch = np.zeros(2), np.zeros(2), np.zeros(2)
        self._middle, self._all = np.zeros(3), np.ones(self._n_feet, bool)
        self._standing = np.zeros(len(robot.contacts), bool)

    def step(self) -> None:
        before, out, memory = self.before, self.phase, self.memory
        for name in (
            "phase",
            "time_in_phase",
            "time_to_touchdown",
            "time_since_touchdown",
            "stance",
        ):
            getattr(out, name)[...] = getattr(before, name)
        out.stepping[...] = False
        out.step_acceleration[...] = 0.0
        phase = int(before.phase)
        lands = phase in (Phase.LANDING, Phase.RECOVER)
        goes_on = float(self.reference.lift_off_time) > float(self.reference.time)
        if not lands or goes_on or self._n_feet < 2:
            memory.foot[()] = memory.taken[()] = 0
            memory.outside[()] = 0.0
            return
        rate = self._find_capture_point()
        if int(memory.foot) == 0:
            self._judge(rate)
        if int(memory.foot) > 0:
            self._swing(rate)
        self._hold_low(phase)

    def _find_capture_point(self) -> float:
        terms, stance = self.terms, self.before.stance
        any_stance = bool(np.any(stance))
        ground, count = 0.0, 0
        for i in range(len(self._foot_of_point)):
            if stance[i] or not any_stance:
                ground += float(terms.contact_position[i, 2])
                count += 1
        ground /= count
        if int(self.memory.foot) == 0:
            self.memory.ground[()] = ground
        mass = float(terms.mass_matrix[0, 0]) or self._mass
        return capture_point(
            terms.com, terms.com_velocity, terms.angular_momentum, mass,
            float(terms.com[2]) - ground, self.params.turn, self._capture,
        )  # fmt: skip

    def _judge(self, rate: float) -> None:
        p, memory, terms = self.params, self.memory, self.terms
        stands = spread_to_feet(
            self.before.stance, self._foot_of_point, self._n_feet, self._standing
        )
        margin = support_margin(
            terms.contact_position, self._standing, float(self._capture[0]), float(self._capture[1])
        )
        since = float(self.before.time_since_touchdown)
        if stands < self._n_feet or since < p.after or margin > -p.margin:
            memory.outside[()] = 0.0
            return
        memory.outside[()] += self.period
        if int(memory.taken) >= p.steps or float(memory.outside) < p.confirmation:
            return
        if int(memory.taken) == 0:
            memory.heading[()] = mean_heading(terms.foot_rotation, self._all)
        foot = self._best_foot(rate)
        memory.foot[()] = foot + 1
        memory.elapsed[()] = 0.0
        memory.outside[()] = 0.0

    def _best_foot(self, rate: float) -> int:
        """The foot that comes nearest to its foothold; of equals the one that carries least."""
        terms, best, least = self.terms, 0, math.inf
        first = farthest_foot(
            terms.contact_position, self._foot_of_point, self._n_feet, self._capture, self._scratch
        )
        for number in range(self._n_feet):
            foot = (first + number) % self._n_feet
            missing = self._choose(foot, rate, self.params.duration, self.memory.foothold[foot])
            if missing < least - _NEARER:
                best, least = foot, missing
        return best

    def _swing(self, rate: float) -> None:
        p, memory, terms, out = self.params, self.memory, self.terms, self.phase
        foot = int(memory.foot) - 1
        memory.elapsed[()] += self.period
        elapsed = float(memory.elapsed)
        left = p.duration - elapsed
        touched = False
        for i, owner in enumerate(self._foot_of_point):
            if owner == foot and self.before.stance[i]:
                touched = True
        if (touched and elapsed > _EARLIEST * p.duration) or elapsed > _LATEST * p.duration:
            memory.foot[()] = 0
            memory.taken[()] += 1
            memory.last[()] = self.before.time_since_touchdown
            return
        place = memory.foothold[foot]
        if left > _AIMED * p.duration:
            self._choose(foot, rate, left, place)
        place[2] = memory.ground
        swing_points(
            foot, self._foot_of_point, self._offset, place, float(memory.heading), elapsed,
            p.duration, p.height, terms.contact_position, terms.contact_velocity, out.stance,
            out.stepping, out.step_acceleration,
        )  # fmt: skip

    def _choose(self, foot: int, rate: float, left: float, place: Array) -> float:
        """Choose the foothold; returns how far it is from where it should be [m]."""
        p, terms = self.params, self.terms
        choose_foothold(
            self._capture, rate, left, p.beyond, terms.contact_position, self._foot_of_point, foot,
            self._n_feet, self._nearest, self._scratch, place,
        )  # fmt: skip
        wanted_x, wanted_y = float(place[0]), float(place[1])
        middle, others = self._middle, self._n_feet - 1
        middle[:] = 0.0
        for other in range(self._n_feet):
            if other != foot:
                for k in range(3):
                    middle[k] += float(terms.foot_position[other, k]) / others
        apart = float(self._apart[foot])
        limit_foothold(
            middle, float(self.memory.heading), self._sides[foot], p.reach, p.apart[0] * apart,
            p.apart[1] * apart, place,
        )  # fmt: skip
        return math.hypot(float(place[0]) - wanted_x, float(place[1]) - wanted_y)

    def _hold_low(self, phase: int) -> None:
        """Stay in LANDING while it steps and until it has settled."""
        memory, out = self.memory, self.phase
        if (int(memory.foot) == 0 and int(memory.taken) == 0) or phase != Phase.RECOVER:
            return
        since = float(self.before.time_since_touchdown)
        risen = since - float(memory.last) - self.params.settle
        if int(memory.foot) > 0 or risen < 0.0:
            out.phase[()] = int(Phase.LANDING)
            out.time_in_phase[()] = since
        else:
            out.time_in_phase[()] = min(float(self.before.time_in_phase), risen)
