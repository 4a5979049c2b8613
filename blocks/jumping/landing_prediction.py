"""Chooses the landing place by what it does to the torso: the law ``predicted``, as kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import (
    Array1D,
    Array2D,
    Indices1D,
    Matrix3,
    Rows3,
    Vector3,
)
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.landing_law import (
    FlightMap,
    LandingCost,
    choose_shift,
    flight_map,
    heading_matrix,
    map_flight,
    predict_tilt,
    pull_to_place,
)
from ...mathematics.rotations import conjugate, from_matrix, logarithm, multiply
from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters, live_parameter
from ..signals import DynamicsTerms

LAST = 0.02
"""Nearer to touchdown than this [s] the choice stands."""


class PredictionGains(Parameters):
    """The gains of the law; the block's docstring has the equations."""

    capture: tuple[float, float] = live_parameter(
        (0.75, 0.5), text="way per linear momentum ahead and aside, in units of 1/(m w)"
    )
    capture_turn: tuple[float, float] = live_parameter(
        (0.75, 0.5), text="way per angular momentum about y and x, in units of w/(m g)"
    )
    clearance: float = live_parameter(
        0.5, ge=0.0, text="feet apart per lateral momentum, in units of 1/(m w)"
    )
    tilt_cost: tuple[float, float] = live_parameter(
        (0.1, 0.3),
        text="cost of a rad of roll and pitch at touchdown, in standing heights off the best place",
    )
    free_tilt: tuple[float, float, float] = live_parameter(
        (0.35, 0.1, 0.5),
        unit="rad",
        text="tilt that costs nothing: to either side, back and ahead",
    )
    height_cost: float = live_parameter(
        0.25, gt=0.0, text="cost of landing with longer or shorter legs, per way off the place"
    )
    height_range: tuple[float, float] = live_parameter(
        (-0.05, 0.2), text="shift of the feet down and up, in standing heights"
    )
    early: float = live_parameter(
        0.03,
        ge=0.0,
        text="by how much of the flight, at most, stretched legs touch down early, as a share",
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


class Soles(NamedTuple):
    """Of the robot: its ``mass`` [kg], and for every contact point the number of its foot, the foot's
    side (1, -1 or 0), (n_contacts,) both, and its place from the sole's, (n_contacts, 3) [m]."""

    mass: float
    foot_of_point: Indices1D
    side: Array1D
    offset: Rows3


class Gains(NamedTuple):
    """``PredictionGains`` for a robot of some size: arrays of one element, or of more where said.

    Attributes:
        cost: what the shift is judged by; its goal and its bounds are computed in every tick.
        per_linear, per_angular: way of the feet ahead and aside per momentum, (2,).
        clearance: way apart per lateral momentum [s/kg].
        lowest, highest: shifts downwards and upwards that are never exceeded [m].
        early: share of the flight by which stretched legs may touch down early.
        stroke: of the legs per square of the speed of the fall [s^2/m].
        damping: where a leg is nearly stretched [m].
        place_gain: share of a small miss of the planned place that is corrected.
        place_range: way at which half of it is [m].
    """

    cost: LandingCost
    per_linear: Array1D
    per_angular: Array1D
    clearance: Array1D
    lowest: Array1D
    highest: Array1D
    early: Array1D
    stroke: Array1D
    damping: Array1D
    place_gain: Array1D
    place_range: Array1D


class PredictionScratch(NamedTuple):
    """``way`` (3 n_contacts,), ``heading`` (3, 3), ``vector`` (3,), ``quaternion`` and ``turned`` (4,),
    ``tilt`` (2,), ``turn`` (2, 4), ``matrix`` (4, 4)."""

    flight: FlightMap
    way: Array1D
    heading: Matrix3
    vector: Vector3
    quaternion: Array1D
    turned: Array1D
    tilt: Array1D
    turn: Array2D
    matrix: Array2D


class Prediction(NamedTuple):
    """What ``choose_shift_of_feet`` needs beside the present state."""

    soles: Soles
    gains: Gains
    scratch: PredictionScratch


def landing_prediction(robot: RobotDescription, sides: Sequence[float]) -> Prediction:
    """The memory of the law for a robot with feet; its gains are zero.

    Args:
        sides: 1, -1 or 0 for every foot.
    """
    foot_of_point = robot.foot_of_contact()
    offset = [
        np.array(point.position) - np.array(robot.feet[foot].sole)
        for point, foot in zip(robot.contacts, foot_of_point, strict=True)
    ]
    n = len(robot.contacts)
    soles = Soles(
        robot.total_mass, np.array(foot_of_point, dtype=np.int64),
        np.array([sides[foot] for foot in foot_of_point]), np.array(offset),
    )  # fmt: skip
    cost = LandingCost(np.zeros(3), np.zeros(6), np.zeros((2, 2)), np.zeros(2))
    gains = Gains(cost, np.zeros(2), np.zeros(2), *np.zeros((8, 1)))
    shapes = 3 * n, (3, 3), 3, 4, 4, 2, (2, 4), (4, 4)
    flight = flight_map(len(robot.joints), n)
    return Prediction(
        soles, gains, PredictionScratch(flight, *(np.zeros(shape) for shape in shapes))
    )


def scale_gains(p: PredictionGains, mass: float, height: float, gains: Gains) -> None:
    """Write the parameters for a robot of a ``mass`` [kg] and standing ``height`` [m] to ``gains``."""
    rate = math.sqrt(GRAVITY / height)
    capture, capture_turn = 1.0 / (mass * rate), rate / (mass * GRAVITY)
    aside, back, ahead = p.free_tilt
    gains.cost.weight[:] = (
        1.0, 1.0, p.apart_cost**2, p.height_cost**2,
        (height * p.tilt_cost[0]) ** 2, (height * p.tilt_cost[1]) ** 2,
    )  # fmt: skip
    gains.cost.free[:] = (-aside, aside), (-back, ahead)
    gains.per_linear[:] = capture * p.capture[0], capture * p.capture[1]
    gains.per_angular[:] = capture_turn * p.capture_turn[0], capture_turn * p.capture_turn[1]
    gains.clearance[0] = capture * p.clearance
    gains.lowest[0], gains.highest[0] = height * p.height_range[0], height * p.height_range[1]
    gains.early[0] = p.early
    gains.stroke[0] = 0.5 / (GRAVITY * p.stop_acceleration)
    gains.damping[0] = height * p.stretch_damping
    gains.place_gain[0], gains.place_range[0] = p.place_gain, height * p.place_range


@kernel
def choose_shift_of_feet(
    terms: DynamicsTerms,
    foot_yaw: Array1D,
    planned: Array2D,
    orientation: Array1D,
    linear: Array1D,
    angular: Array1D,
    miss: Array1D,
    left: float,
    duration: float,
    speed: float,
    prediction: Prediction,
    shift: Array1D,
) -> None:
    """Choose the ``shift`` (4,) [m] of all feet: ahead, to the left, apart, upwards.

    Args:
        foot_yaw: the planned heading of every foot [rad], (n_feet,).
        planned: places of the feet from the centre of mass, (n_feet, 3).
        orientation: the planned one, quaternion x, y, z, w.
        linear, angular: the momenta that were not planned.
        miss: by how much unshifted feet will miss their planned place in the world [m], (3,).
        left: time until touchdown with the planned length of the legs [s]; shorter legs may fall on
            when it is over.
        speed: of the fall then [m/s]; by 1 / speed does every metre of shorter legs delay touchdown.
    """
    soles, gains, scratch = prediction.soles, prediction.gains, prediction.scratch
    cost = gains.cost
    map_flight(
        terms.centroidal_matrix, terms.contact_jacobian, terms.base_rotation, soles.mass,
        gains.damping[0], scratch.flight,
    )  # fmt: skip
    find_ways(terms, foot_yaw, planned, soles, scratch)
    from_matrix(terms.base_rotation, scratch.quaternion)
    conjugate(orientation, scratch.turned)
    multiply(scratch.quaternion, scratch.turned, scratch.turned)
    logarithm(scratch.turned, scratch.vector)
    predict_tilt(
        scratch.flight, scratch.vector, angular, scratch.way, left, 1.0 / speed, soles.side,
        scratch.tilt, scratch.turn,
    )  # fmt: skip
    cost.bounds[0] = max(gains.lowest[0], -gains.early[0] * duration * speed)
    cost.bounds[1] = max(gains.highest[0] - speed * speed * gains.stroke[0], 0.0)
    ahead = gains.per_linear[0] * linear[0]
    cost.goal[0] = ahead + gains.per_angular[0] * angular[1]
    aside = gains.per_linear[1] * linear[1]
    cost.goal[1] = aside - gains.per_angular[1] * angular[0]
    cost.goal[2] = gains.clearance[0] * abs(linear[1])
    pull_to_place(cost.goal, miss, gains.place_gain[0], gains.place_range[0])
    choose_shift(scratch.tilt, scratch.turn, cost, scratch.matrix, shift)


@kernel
def find_ways(
    terms: DynamicsTerms,
    foot_yaw: Array1D,
    planned: Rows3,
    soles: Soles,
    scratch: PredictionScratch,
) -> None:
    """How far every contact point is from its planned place, with flat soles."""
    for point in range(soles.foot_of_point.shape[0]):
        foot = soles.foot_of_point[point]
        heading_matrix(foot_yaw[foot], scratch.heading)
        scratch.vector[:] = scratch.heading @ soles.offset[point]
        scratch.way[3 * point : 3 * point + 3] = (
            scratch.vector + planned[foot] + terms.com - terms.contact_position[point]
        )
