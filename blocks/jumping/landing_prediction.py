"""Chooses the landing place by what it does to the torso: the law ``predicted``."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.flight_prediction import (
    LandingCost,
    choose_shift,
    flight_map,
    map_flight,
    predict_tilt,
)
from ...mathematics.landing_law import heading_matrix, pull_to_place
from ...mathematics.rotations import conjugate, from_matrix, logarithm, multiply
from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters, live_parameter
from ..signals import DynamicsTerms, JumpReference

Array = NDArray[np.float64]

LAST = 0.02
"""Nearer to touchdown than this [s] the choice stands."""


class PredictionGains(Parameters):
    """The gains of the law; the block's docstring has the equations."""

    capture: tuple[float, float] = live_parameter(
        (1.0, 1.0), text="way per linear momentum ahead and aside, in units of 1/(m w)"
    )
    capture_turn: tuple[float, float] = live_parameter(
        (1.0, 1.0), text="way per angular momentum about y and x, in units of w/(m g)"
    )
    clearance: float = live_parameter(
        0.5, ge=0.0, text="feet apart per lateral momentum, in units of 1/(m w)"
    )
    tilt_cost: tuple[float, float] = live_parameter(
        (0.1, 0.5),
        text="cost of a rad of roll and pitch at touchdown, in standing heights off the best place",
    )
    free_tilt: tuple[float, float, float] = live_parameter(
        (0.35, 0.1, 0.6),
        unit="rad",
        text="tilt that costs nothing: to either side, back and ahead",
    )
    height_cost: float = live_parameter(
        0.25, gt=0.0, text="cost of landing with longer or shorter legs, per way off the place"
    )
    height_range: tuple[float, float] = live_parameter(
        (-0.01, 0.25), text="shift of the feet down and up, in standing heights"
    )
    stop_acceleration: float = live_parameter(
        3.0, gt=0.0, text="stops the fall in the stroke that drawn up legs must keep, in g"
    )
    apart_cost: float = live_parameter(
        1.0, gt=0.0, text="cost of another distance between the feet, per way off the place"
    )
    place_gain: float = live_parameter(
        0.5, ge=0.0, le=1.0, text="share of a small miss of the planned place that is corrected"
    )
    place_range: float = live_parameter(
        0.12,
        gt=0.0,
        text="way from the planned place to the capture point at which half of that is corrected, "
        "in standing heights",
    )
    lead_time: float = live_parameter(
        0.01,
        unit="s",
        ge=0.0,
        le=0.05,
        text="by how much the feet are ahead of their planned way, ahead and aside",
    )
    stretch_damping: float = live_parameter(
        0.06, gt=0.0, text="damping where a leg is nearly stretched, in standing heights"
    )


class LandingPrediction:
    """The shift of the landing place that costs least; see ``LandingHeuristic``.

    Args:
        robot: with feet and contact points.
        standing: height of its centre of mass above its feet as it stands [m].
        sides: 1, -1 or 0 for every foot.
    """

    def __init__(self, robot: RobotDescription, standing: float, sides: tuple[float, ...]) -> None:
        self._mass, self._standing = robot.total_mass, standing
        rate = math.sqrt(GRAVITY / standing)
        self._capture = 1.0 / (self._mass * rate)
        self._capture_turn = rate / (self._mass * GRAVITY)
        self._foot_of_point = robot.foot_of_contact()
        soles = [np.array(robot.feet[foot].sole) for foot in self._foot_of_point]
        self._from_sole = [
            np.array(point.position) - sole
            for point, sole in zip(robot.contacts, soles, strict=True)
        ]
        self._side = np.array([sides[foot] for foot in self._foot_of_point])
        self._flight = flight_map(len(robot.joints), len(robot.contacts))
        self._way = np.zeros((len(robot.contacts), 3))
        self._flat_way = self._way.reshape(-1)
        self._heading, self._vector = np.zeros((3, 3)), np.zeros(3)
        self._quaternion, self._other = np.zeros(4), np.zeros(4)
        self._tilt, self._turn, self._matrix = np.zeros(2), np.zeros((2, 4)), np.zeros((4, 4))
        self._cost = LandingCost(np.zeros(3), np.zeros(6), np.zeros((2, 2)), np.zeros(2))

    def prepare(self, p: PredictionGains) -> None:
        """Take over the parameters."""
        height = self._standing
        aside, back, ahead = p.free_tilt
        self._cost = LandingCost(
            np.zeros(3),
            np.array([
                1.0, 1.0, p.apart_cost**2, p.height_cost**2,
                (height * p.tilt_cost[0]) ** 2, (height * p.tilt_cost[1]) ** 2,
            ]),
            np.array([[-aside, aside], [-back, ahead]]),
            np.array([height * p.height_range[0], 0.0]),
        )  # fmt: skip
        self._highest = height * p.height_range[1]
        self._stroke = 0.5 / (GRAVITY * p.stop_acceleration)
        self._damping = height * p.stretch_damping
        self._per_linear = self._capture * p.capture[0], self._capture * p.capture[1]
        self._per_angular = (
            self._capture_turn * p.capture_turn[0],
            self._capture_turn * p.capture_turn[1],
        )
        self._clearance = self._capture * p.clearance
        self._place_gain, self._place_range = p.place_gain, height * p.place_range

    def choose(
        self,
        terms: DynamicsTerms,
        reference: JumpReference,
        planned: Array,
        orientation: Array,
        linear: Array,
        angular: Array,
        miss: Array,
        left: float,
        shift: Array,
    ) -> None:
        """Choose the ``shift`` (4,) [m] of all feet: ahead, to the left, apart, upwards.

        Args:
            planned: places of the feet from the centre of mass, (n_feet, 3).
            orientation: the planned one, quaternion x, y, z, w.
            linear, angular: the momenta that were not planned.
            miss: by how much unshifted feet will miss their planned place in the world [m], (3,).
            left: time until touchdown [s].
        """
        if left < LAST:
            return
        flight, cost = self._flight, self._cost
        map_flight(
            terms.centroidal_matrix, terms.contact_jacobian, terms.base_rotation, self._mass,
            self._damping, flight,
        )  # fmt: skip
        self._find_ways(terms, reference, planned)
        from_matrix(terms.base_rotation, self._quaternion)
        conjugate(orientation, self._other)
        multiply(self._quaternion, self._other, self._other)
        logarithm(self._other, self._vector)
        predict_tilt(
            flight, self._vector, angular, self._flat_way, left, self._side, self._tilt, self._turn
        )
        fall = GRAVITY * left - float(terms.com_velocity[2])
        cost.bounds[1] = max(self._highest - fall * fall * self._stroke, 0.0)
        cost.goal[0] = self._per_linear[0] * linear[0] + self._per_angular[0] * angular[1]
        cost.goal[1] = self._per_linear[1] * linear[1] - self._per_angular[1] * angular[0]
        cost.goal[2] = self._clearance * abs(linear[1])
        pull_to_place(cost.goal, miss, self._place_gain, self._place_range)
        choose_shift(self._tilt, self._turn, cost, self._matrix, shift)

    def _find_ways(self, terms: DynamicsTerms, reference: JumpReference, planned: Array) -> None:
        """How far every contact point is from its planned place, with flat soles."""
        for point, foot in enumerate(self._foot_of_point):
            heading_matrix(float(reference.foot_yaw[foot]), self._heading)
            way = self._way[point]
            np.dot(self._heading, self._from_sole[point], way)
            way += planned[foot]
            way += terms.com
            way -= terms.contact_position[point]
