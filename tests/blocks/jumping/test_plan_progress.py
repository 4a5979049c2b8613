"""What a thrust lacks in speed and height, and how much later it should end for that."""

from __future__ import annotations

import pytest

from aloft.blocks.jumping.plan_progress import delay_change, speed_error
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
