"""The capture point against the pendulum's motion, the limits of a foothold, and the support."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics.capture_step import (
    approach,
    capture_point,
    farthest_foot,
    limit_foothold,
    nearest_in_foot,
    spread_to_feet,
    support_margin,
)

POINTS = np.array([[0.05, -0.08, 0.0], [-0.04, -0.08, 0.0], [0.05, 0.08, 0.0], [-0.04, 0.08, 0.0]])
FOOT = np.array([0, 0, 1, 1])
SIDE = st.floats(-0.3, 0.3)


def test_the_pendulum_over_its_capture_point_comes_to_rest_there():
    height, velocity, xi = 0.3, np.array([0.4, -0.2, 0.0]), np.zeros(2)
    rate = capture_point(np.zeros(3), velocity, np.zeros(3), 5.0, height, 1.0, xi)
    assert rate == pytest.approx(math.sqrt(9.81 / height), rel=1e-3)
    place, speed, dt = np.zeros(2), velocity[:2].copy(), 1e-4
    for _ in range(4000):
        speed += dt * rate**2 * (place - xi)
        place += dt * speed
    assert place == pytest.approx(xi * (1.0 - math.exp(-0.4 * rate)), abs=1e-3)


def test_angular_momentum_moves_it_by_what_the_weight_can_remove():
    still, turning, xi = np.zeros(3), np.array([0.1, 0.2, 0.3]), np.zeros(2)
    rate = capture_point(still, still, turning, 5.0, 0.3, 1.0, xi)
    assert xi == pytest.approx(rate / (5.0 * 9.80665) * np.array([0.2, -0.1]), rel=1e-3)
    capture_point(still, still, turning, 5.0, 0.3, 0.0, xi)
    assert not xi.any()


@given(x=SIDE, y=SIDE)
def test_the_nearest_place_in_a_foot_is_nearest(x, y):
    out, place = np.zeros(2), np.array([x, y])
    distance = nearest_in_foot(POINTS, FOOT, 1, place, out)
    line = np.linspace(POINTS[2, :2], POINTS[3, :2], 501)
    assert distance == pytest.approx(np.linalg.norm(line - place, axis=1).min(), abs=2e-4)
    assert distance == pytest.approx(np.linalg.norm(out - place), abs=1e-12)
    if abs(y) > 1e-6:
        assert farthest_foot(POINTS, FOOT, 2, place, np.zeros(2)) == (1 if y < 0 else 0)


@pytest.mark.parametrize(
    ("wanted", "side", "found"),
    [
        ((0.1, 0.2), 1.0, (0.1, 0.2)),
        ((0.5, 0.2), 1.0, (0.2, 0.2)),
        ((-0.5, 0.01), 1.0, (-0.2, 0.09)),  # it would cross the other leg
        ((0.0, 0.9), 1.0, (0.0, 0.27)),
        ((0.0, -0.9), -1.0, (0.0, -0.27)),
        ((0.0, -0.9), 0.0, (0.0, -0.27)),
    ],
)
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_limits_turn_with_the_feet(wanted, side, found, heading):
    turn = np.array(
        [[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]]
    )
    stance = np.array([0.3, -0.1, 0.0])
    out = np.append(stance[:2] + turn @ wanted, 0.05)
    limit_foothold(stance, heading, side, 0.2, 0.09, 0.27, out)
    assert out == pytest.approx(np.append(stance[:2] + turn @ found, 0.05))


def test_a_foot_arrives_in_time_and_at_rest():
    place, speed, dt = 0.02, -0.5, 1e-5
    for step in range(9990):
        acceleration = approach(place, speed, 0.1, 0.1 - step * dt)
        speed += dt * acceleration
        place += dt * speed
    assert place == pytest.approx(0.1, abs=1e-4) and speed == pytest.approx(0.0, abs=0.01)


def test_a_foot_that_stands_on_one_point_stands():
    out = np.zeros(4, bool)
    assert spread_to_feet(np.array([True, False, False, False]), FOOT, 2, out) == 1
    assert out.tolist() == [True, True, False, False]


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
ALL = np.ones(4, dtype=bool)


@pytest.mark.parametrize(
    ("x", "y", "margin"),
    [(0.5, 0.5, 0.5), (0.9, 0.5, 0.1), (1.2, 0.5, -0.2), (0.5, -0.3, -0.3), (0.25, 0.4, 0.25)],
)
def test_square(x: float, y: float, margin: float) -> None:
    assert support_margin(SQUARE, ALL, x, y) == pytest.approx(margin)
    assert support_margin(SQUARE[[2, 0, 3, 1]], ALL, x, y) == pytest.approx(margin)


def test_only_loaded_points_support() -> None:
    triangle = np.array([True, True, False, True])
    assert support_margin(SQUARE, triangle, 0.9, 0.9) == pytest.approx(-0.8 / np.sqrt(2))


def test_a_line_a_point_and_nothing_do_not_support() -> None:
    line = np.array([True, True, False, False])
    assert support_margin(SQUARE, line, 0.5, 0.3) == pytest.approx(-0.3)
    assert support_margin(SQUARE, line, 0.5, 0.0) == 0.0
    assert support_margin(SQUARE, np.array([True, False, False, False]), 3.0, 4.0) == -5.0
    assert support_margin(SQUARE, np.zeros(4, dtype=bool), 0.0, 0.0) == -1.0
