"""Chooses the landing place by what it does to the torso: the law ``predicted``, as kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from ...mathematics.arrays import Array1D
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
    pull_to_position,
)
from ...mathematics.rotations import conjugate, from_matrix, logarithm, multiply
from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JumpReference

MOST_LEAD = 0.03
"""Largest lead from the fall [s]."""
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
        (0.3, 0.3),
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
        text="largest share of the flight by which stretched legs touch down early",
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
        text="lead of the feet on their planned way, ahead and aside",
    )
    lead_by: Literal["time", "fall"] = parameter(
        "time",
        text="the lead is `lead_time` alone, or with the lead of the soles over their planned touchdown added",
    )
    stretch_damping: float = live_parameter(
        0.06, gt=0.0, text="damping where a leg is nearly stretched, in standing heights"
    )


class PredictionConstants(Signal):
    """Data of the robot that the law depends on, and ``PredictionGains`` for its size."""

    mass = Field(unit="kg", text="that of the description")
    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    point_side = Field(
        "n_contacts", unit="", text="1: its foot is on the left, -1: right, 0: middle"
    )
    point_offset = Field(("n_contacts", 3), unit="m", frame="body", text="from its foot's sole")
    per_linear = Field(2, unit="s/kg", text="way of the feet ahead and aside per linear momentum")
    per_angular = Field(2, unit="s/(kg m)", text="the way per angular momentum about y and x")
    apart = Field(unit="s/kg", text="way apart per lateral momentum")
    lowest = Field(unit="m", text="shift downwards that is never exceeded")
    highest = Field(unit="m", text="shift upwards that is never exceeded")
    stroke = Field(unit="s^2/m", text="stroke of the legs per square of the speed of the fall")
    damping = Field(unit="m", text="damping where a leg is nearly stretched")
    place_range = Field(unit="m", text="way at which half of a missed place is corrected")


class PredictionMemory(Signal):
    """Memory of the law."""

    planned = Field(("n_feet", 3), unit="m", frame="world", text="planned feet from the com")
    orientation = Field(4, unit="", text="planned base quaternion x, y, z, w")
    shift = Field(4, unit="m", frame="world", text="chosen: ahead, to the left, apart, upwards")
    planned_touchdown = Field(3, unit="m", frame="world", text="planned com at touchdown")
    flight_time = Field(unit="s", text="lift-off to touchdown with the planned length of the legs")
    early = Field(unit="s", text="lead of the soles over their planned touchdown")


class PredictionScratch(Signal):
    """Intermediate values of the law."""

    linear = Field(3, unit="kg m/s", frame="world", text="the linear momentum that is fed back")
    angular = Field(3, unit="N m s", frame="world", text="the angular momentum that is fed back")
    miss = Field(3, unit="m", frame="world", text="miss of unshifted feet")
    heading = Field((3, 3), unit="", text="of a sole")
    vector = Field(3, text="for a moment")
    fall_speed = Field(
        unit="m/s", text="at touchdown; its inverse is the delay per shorter leg [s/m]"
    )
    quaternion = Field(4, unit="", text="the base's orientation")
    turned = Field(4, unit="", text="the base's orientation from the planned one")
    tilt = Field(2, unit="rad", text="roll and pitch at touchdown without a shift")
    tilt_per_shift = Field((2, 4), unit="rad/m", text="their derivatives by the shift")
    matrix = Field((4, 4), text="for a moment")


class PredictionProgram(NamedTuple):
    """The robot's flight as a linear map, the cost of a shift, and how far every contact point is from
    its planned place, (3 n_contacts,) [m]."""

    flight: FlightMap
    cost: LandingCost
    way: Array1D


def prediction_program(robot: RobotDescription) -> PredictionProgram:
    """Allocate the memory of the program for a robot with feet."""
    n = len(robot.contacts)
    cost = LandingCost(np.zeros(3), np.zeros(6), np.zeros((2, 2)), np.zeros(2))
    return PredictionProgram(flight_map(len(robot.joints), n), cost, np.zeros(3 * n))


def describe_soles(
    robot: RobotDescription, sides: Sequence[float], constants: PredictionConstants
) -> None:
    """Write what the law knows of the robot; ``sides`` are 1, -1 or 0 for every foot."""
    feet = robot.foot_of_contact()
    constants.mass, constants.foot_of_point[:] = robot.total_mass, feet
    for k, (point, foot) in enumerate(zip(robot.contacts, feet, strict=True)):
        constants.point_side[k] = sides[foot]
        constants.point_offset[k] = np.array(point.position) - np.array(robot.feet[foot].sole)


def scale_gains(
    p: PredictionGains, height: float, constants: PredictionConstants, cost: LandingCost
) -> None:
    """Write the parameters for a robot of the mass in ``constants`` and the standing ``height`` [m]."""
    mass = float(constants.mass)
    rate = math.sqrt(GRAVITY / height)
    capture, capture_turn = 1.0 / (mass * rate), rate / (mass * GRAVITY)
    aside, back, ahead = p.free_tilt
    cost.weight[:] = (
        1.0, 1.0, p.apart_cost**2, p.height_cost**2,
        (height * p.tilt_cost[0]) ** 2, (height * p.tilt_cost[1]) ** 2,
    )  # fmt: skip
    cost.free[:] = (-aside, aside), (-back, ahead)
    constants.per_linear[:] = capture * p.capture[0], capture * p.capture[1]
    constants.per_angular[:] = capture_turn * p.capture_turn[0], capture_turn * p.capture_turn[1]
    constants.apart = capture * p.clearance
    constants.lowest, constants.highest = height * p.height_range[0], height * p.height_range[1]
    constants.stroke = 0.5 / (GRAVITY * p.stop_acceleration)
    constants.damping = height * p.stretch_damping
    constants.place_range = height * p.place_range


@kernel
def choose_shift_of_feet(
    plan: JumpReference,
    terms: DynamicsTerms,
    left: float,
    memory: PredictionMemory,
    params: PredictionGains,
    constants: PredictionConstants,
    scratch: PredictionScratch,
    program: PredictionProgram,
) -> None:
    """Choose the shift of all feet.

    ``left`` is the time until touchdown with the planned length of the legs [s]; shorter legs may fall
    on when it is over.
    """
    cost, linear, angular = program.cost, scratch.linear, scratch.angular
    speed = scratch.fall_speed
    map_flight(
        terms.centroidal_matrix, terms.contact_jacobian, terms.base_rotation, constants.mass,
        constants.damping, program.flight,
    )  # fmt: skip
    find_ways(plan, terms, memory, constants, scratch, program.way)
    from_matrix(terms.base_rotation, scratch.quaternion)
    conjugate(memory.orientation, scratch.turned)
    multiply(scratch.quaternion, scratch.turned, scratch.turned)
    logarithm(scratch.turned, scratch.vector)
    predict_tilt(
        program.flight, scratch.vector, angular, program.way, left, 1.0 / speed,
        constants.point_side, scratch.tilt, scratch.tilt_per_shift,
    )  # fmt: skip
    cost.bounds[0] = max(constants.lowest, -params.early * memory.flight_time * speed)
    cost.bounds[1] = max(constants.highest - speed * speed * constants.stroke, 0.0)
    ahead = constants.per_linear[0] * linear[0]
    cost.goal[0] = ahead + constants.per_angular[0] * angular[1]
    aside = constants.per_linear[1] * linear[1]
    cost.goal[1] = aside - constants.per_angular[1] * angular[0]
    cost.goal[2] = constants.apart * abs(linear[1])
    pull_to_position(cost.goal, scratch.miss, params.place_gain, constants.place_range)
    choose_shift(scratch.tilt, scratch.tilt_per_shift, cost, scratch.matrix, memory.shift)


@kernel
def find_ways(
    plan: JumpReference,
    terms: DynamicsTerms,
    memory: PredictionMemory,
    constants: PredictionConstants,
    scratch: PredictionScratch,
    way: Array1D,
) -> None:
    """Compute the ``way`` of every contact point to its planned place, with flat soles."""
    for point in range(constants.foot_of_point.shape[0]):
        foot = constants.foot_of_point[point]
        heading_matrix(plan.foot_yaw[foot], scratch.heading)
        scratch.vector[:] = scratch.heading @ constants.point_offset[point]
        way[3 * point : 3 * point + 3] = (
            scratch.vector + memory.planned[foot] + terms.com - terms.contact_position[point]
        )
