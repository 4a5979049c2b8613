"""What a thrust lacks in speed and height, and how much later it should end for that."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.jumping.plan_progress import (
    FallSettings,
    Flight,
    Motion,
    Progress,
    delay_change,
    follow_fall,
    speed_error,
    time_to_fall,
)
from aloft.blocks.signals import Phase
from aloft.mathematics.constants import GRAVITY


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
    height = 0.4 - lower + (SPEED - slower) * since - 0.5 * GRAVITY * since**2
    speed = SPEED - slower - GRAVITY * since
    return Motion(np.array([0.0, 0.0, height]), np.array([0.0, 0.0, speed]), np.zeros((2, 3)))


def fly(lower=0.0, slower=0.0, gain=20.0, phase=Phase.FLIGHT, toes_first=True):
    """By how much later the plan is read in the end [s], and when a robot comes down that flies off
    ``lower`` [m] and ``slower`` [m/s] than in the plan, after its planned touchdown [s]."""
    progress = Progress(np.array(0.0), np.array(0.0))
    planned = Flight(np.array(int(phase)), np.array(LASTS), np.array(toes_first))
    settings = FallSettings(gain, 0.5, PERIOD)
    for tick in range(round(0.97 * LASTS / PERIOD)):
        present = tick * PERIOD
        read = np.array([present - float(progress.late), 0.0, 0.0])
        follow_fall(
            read, ballistic(present, lower, slower), ballistic(read[0], 0.0, 0.0), planned,
            settings, progress,
        )  # fmt: skip
    lowest = float(ballistic(LASTS, 0.0, 0.0).com[2])
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
