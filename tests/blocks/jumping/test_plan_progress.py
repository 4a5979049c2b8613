"""When a plan is read: thrusts that are too slow, falls onto the toes, and somersaults.

The rotation of a somersault at touchdown is simulated with the law's own physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.jumping.plan_progress import (
    PlanProgress,
    ProgressConstants,
    delay_change,
    follow_fall,
    follow_turn,
    speed_error,
    time_to_fall,
    turned_beyond,
    value_at,
)
from aloft.blocks.signals import DynamicsTerms, JumpReference, Phase
from aloft.mathematics.constants import GRAVITY
from aloft.planner.library.jump_table import FlightRotation
from aloft.robots.description import find_robot

SIZES = find_robot("bruce").dimensions


def constants(**values):
    written = ProgressConstants.allocate(SIZES)
    written.foot_of_point[:] = find_robot("bruce").foot_of_contact()
    for name, value in {"period": PERIOD, **values}.items():
        setattr(written, name, value)
    return written


def apex(height, speed):
    return height + speed**2 / (2.0 * GRAVITY)


def test_no_error_on_the_plan():
    assert speed_error(0.3, 1.8, 0.3, 1.8) == 0.0


@pytest.mark.parametrize("lower", [0.001, -0.002])
def test_a_height_counts_as_the_speed_that_makes_up_for_it(lower):
    """Lower by so much and faster by what makes up for it, the apex is the planned one."""
    faster = GRAVITY * lower / 1.8
    assert speed_error(0.3 - lower, 1.8 + faster, 0.3, 1.8) == pytest.approx(0.0, abs=1e-12)
    assert apex(0.3 - lower, 1.8 + faster) == pytest.approx(apex(0.3, 1.8), abs=1e-5)


def test_while_slow_only_the_speed_counts():
    assert speed_error(0.25, 0.3, 0.3, 0.4) == pytest.approx(-0.1)


def test_who_is_too_slow_thrusts_longer():
    assert delay_change(-0.02, 20.0, 40.0, 0.5, 0.002) == pytest.approx(8e-5)
    assert delay_change(0.02, 20.0, 40.0, 0.5, 0.002) == pytest.approx(-8e-5)


def test_the_error_is_gone_after_a_few_time_constants():
    """A robot that is 0.05 m/s too slow, while the plan waits for it at 20 m/s^2."""
    error = -0.05
    for _ in range(100):
        error += 20.0 * delay_change(error, 20.0, 40.0, 0.5, 0.002)
    assert abs(error) < 1e-4


@pytest.mark.parametrize("error", [-3.0, 3.0])
def test_the_rate_is_limited(error):
    assert abs(delay_change(error, 20.0, 40.0, 0.5, 0.002)) == pytest.approx(0.001)


def test_without_a_push_the_change_stays_finite():
    assert delay_change(-0.01, -9.8, 40.0, 0.9, 0.002) == pytest.approx(1e-4)


PERIOD, LASTS, SPEED = 0.002, 0.39, 1.05
"""s, s and m/s: the period, the planned flight and its speed at lift-off."""


def ballistic(since, lower, slower):
    """Height and speed."""
    height = 0.4 - lower + (SPEED - slower) * since - 0.5 * GRAVITY * since**2
    return height, SPEED - slower - GRAVITY * since


def fly(lower=0.0, slower=0.0, gain=20.0, phase=Phase.FLIGHT, toes_first=True):
    """By how much later the plan is read in the end [s], and when a robot comes down that flies off
    ``lower`` [m] and ``slower`` [m/s] than in the plan, after its planned touchdown [s]."""
    progress, params = PlanProgress.allocate(), SimpleNamespace(toes_gain=np.array(gain))
    terms, reference = DynamicsTerms.allocate(SIZES), JumpReference.allocate(SIZES)
    reference.phase, reference.touchdown_time, reference.toes_first = phase, LASTS, toes_first
    for tick in range(round(0.97 * LASTS / PERIOD)):
        present = tick * PERIOD
        read = present - float(progress.late)
        terms.com[2], terms.com_velocity[2] = ballistic(present, lower, slower)
        reference.com[2], reference.com_velocity[2] = ballistic(read, 0.0, 0.0)
        follow_fall(read, terms, reference, progress, params, constants())
    lowest = ballistic(LASTS, 0.0, 0.0)[0]
    return float(progress.late), time_to_fall(0.4 - lower - lowest, SPEED - slower) - LASTS


def test_a_fall_takes_its_time():
    assert time_to_fall(0.0, 1.0) == pytest.approx(2.0 / GRAVITY)
    assert time_to_fall(0.5 * GRAVITY, 0.0) == pytest.approx(1.0)
    assert time_to_fall(-0.1, -1.0) == 0.0, "it is down already"


@pytest.mark.parametrize(("lower", "slower"), [(0.01, 0.0), (0.0, 0.05), (-0.01, -0.03)])
def test_toes_land_in_the_plan_when_the_robot_does(lower, slower):
    late, due = fly(lower, slower)
    assert abs(due) > 0.003
    assert late == pytest.approx(due, abs=2e-4)


@pytest.mark.parametrize(
    "other",
    [{"phase": Phase.THRUST}, {"phase": Phase.LANDING}, {"toes_first": False}, {"gain": 0.0}],
)
def test_other_parts_of_a_plan_keep_their_time(other):
    assert fly(0.01, 0.05, **other)[0] == 0.0


# Somersaults

FLIGHT = 0.36
SLOW, FAST = 10.0, 20.0
"""Rates of rotation with the legs out and tucked [rad/s]."""
TIMES = np.linspace(0.0, FLIGHT, 181)
RATES = np.interp(TIMES, [0.0, 0.08, 0.25, 0.31, FLIGHT], [SLOW, FAST, FAST, SLOW, SLOW])
LEFT = np.concatenate(
    [np.cumsum((0.5 * np.diff(TIMES) * (RATES[1:] + RATES[:-1]))[::-1])[::-1], [0]]
)
TURN_SPEED, HEIGHT = 1.7, 0.4
"""Of the planned lift-off [m/s, m]."""


def about_y(angle):
    return np.array([0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)])


@dataclass
class Flight:
    """A robot whose joints follow the plan at once, with ``spin`` times its momentum, ahead of its rotation
    by ``ahead`` [rad] at lift-off, and ``faster`` upwards [m/s]. ``sign`` is -1 backwards."""

    spin: float = 1.0
    ahead: float = 0.0
    faster: float = 0.0
    sign: float = 1.0
    early: float = 0.04
    late: float = 0.03
    aim: float = 0.0
    rates: np.ndarray = field(default_factory=lambda: RATES)
    delays: list[float] = field(default_factory=list)

    def fly(self) -> tuple[float, float]:
        """By how much it has turned further than the plan [rad], and how late the plan is [s]; both when it
        lands."""
        terms, reference = DynamicsTerms.allocate(SIZES), JumpReference.allocate(SIZES)
        reference.phase, reference.touchdown_time = Phase.FLIGHT, FLIGHT
        terms.base_rotation[:] = np.eye(3)
        marks = np.array([0.075, 0.295, FAST, self.sign])
        rotation = FlightRotation(TIMES, self.rates, LEFT, marks)
        progress = PlanProgress.allocate()
        written = constants(gain=50.0, early=self.early, late=self.late, aim=self.aim)
        momentum = 0.05 * FAST
        goal = HEIGHT + FLIGHT * (TURN_SPEED - 0.5 * GRAVITY * FLIGHT)
        turned, time = self.ahead, 0.0
        while True:
            speed = TURN_SPEED + self.faster
            height = HEIGHT + time * (speed - 0.5 * GRAVITY * time)
            at = time - float(progress.late)
            if height <= goal and time > 0.1:
                planned = LEFT[0] - value_at(TIMES, LEFT, at)
                return turned - planned, float(progress.late)
            rate = value_at(TIMES, RATES, at)
            terms.centroidal_matrix[4, 4] = momentum / rate
            terms.angular_momentum[1] = self.sign * self.spin * momentum
            terms.com[2], terms.com_velocity[2] = height, speed - GRAVITY * time
            reference.com[2] = HEIGHT + at * (TURN_SPEED - 0.5 * GRAVITY * at)
            reference.com_velocity[2] = TURN_SPEED - GRAVITY * at
            reference.orientation[:] = about_y(self.sign * (LEFT[0] - value_at(TIMES, LEFT, at)))
            angle = self.sign * turned
            terms.base_rotation[0, 0] = terms.base_rotation[2, 2] = math.cos(angle)
            terms.base_rotation[0, 2], terms.base_rotation[2, 0] = math.sin(angle), -math.sin(angle)
            follow_turn(at, terms, reference, rotation, progress, written)
            self.delays.append(float(progress.late))
            turned += self.spin * rate * PERIOD
            time += PERIOD


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("spin", "ahead"), [(1.0, 0.15), (1.0, -0.1), (1.04, 0.0), (0.98, 0.0), (1.05, -0.1)]
)
def test_it_has_turned_as_planned_when_it_lands(spin, ahead, sign):
    left, late = Flight(spin=spin, ahead=ahead, sign=sign).fly()
    without = abs(ahead + (spin - 1.0) * LEFT[0])
    assert abs(left) < 0.03
    assert abs(left) < 0.3 * without
    assert abs(late) < 0.003


def test_the_plan_is_on_time_for_a_robot_that_falls_sooner_or_later():
    for faster in (-0.025, 0.05):
        left, late = Flight(faster=faster).fly()
        flies = (
            TURN_SPEED
            + faster
            + math.sqrt(
                (TURN_SPEED + faster) ** 2 - TURN_SPEED**2 + (TURN_SPEED - GRAVITY * FLIGHT) ** 2
            )
        ) / GRAVITY
        assert late == pytest.approx(flies - FLIGHT, abs=0.004)
        assert abs(left) < 0.03


def test_a_robot_on_the_plan_is_left_alone():
    flight = Flight()
    flight.fly()
    assert np.abs(flight.delays).max() < 0.002


def test_a_plan_that_turns_no_faster_in_the_tuck_is_read_by_the_clock():
    flight = Flight(ahead=0.2, rates=np.full_like(RATES, FAST))
    flight.fly()
    before_the_legs_are_out = flight.delays[: int(0.29 / PERIOD)]
    assert before_the_legs_are_out == [0.0] * len(before_the_legs_are_out)


def test_who_turns_too_far_leaves_the_tuck_earlier_and_else_later_within_the_limits():
    for ahead, sign in ((0.2, -1.0), (-0.2, 1.0)):
        flight = Flight(ahead=ahead, early=0.006, late=0.004)
        flight.fly()
        most = sign * max(sign * delay for delay in flight.delays)
        assert most == pytest.approx(-0.006 if ahead > 0.0 else 0.004, abs=6e-4)


def test_the_aim_is_where_it_ends():
    left, _ = Flight(ahead=0.1, aim=-0.06).fly()
    assert left == pytest.approx(-0.06, abs=0.02)


@pytest.mark.parametrize("turned", [0.3, -0.2])
def test_the_angle_beyond_the_plan_has_no_jump_at_half_a_turn(turned):
    for planned in (0.0, 3.1, 6.2):
        angle = planned + turned
        rotation = np.array(
            [
                [math.cos(angle), 0, math.sin(angle)],
                [0, 1, 0],
                [-math.sin(angle), 0, math.cos(angle)],
            ]
        )
        assert turned_beyond(rotation, about_y(planned)) == pytest.approx(turned)
