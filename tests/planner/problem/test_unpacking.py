"""A motion at other instants of the same phases."""

import numpy as np
import pytest

from aloft.planner.problem.unpacking import (
    matching_times,
    means_over,
    same_phases,
    segments,
    states_at,
)

PHASES = [1, 1, 2, 3, 3]
TIME = np.array([0.0, 0.2, 0.4, 0.5, 0.8, 1.0])


def test_segments_are_runs_of_one_phase() -> None:
    assert segments([1, 1, 3, 4, 4, 3]) == [(1, 0, 2), (3, 2, 3), (4, 3, 5), (3, 5, 6)]


def test_the_same_phases_in_any_number_of_intervals() -> None:
    assert same_phases(PHASES, [1, 2, 2, 2, 3])
    assert not same_phases(PHASES, [1, 3])
    assert not same_phases(PHASES, [1, 2, 3, 4])


def test_phases_begin_and_end_together() -> None:
    steps = np.array([7.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    found = matching_times(TIME, PHASES, steps, [1, 2, 2, 3, 3, 3])
    assert found == pytest.approx([0.0, 0.4, 0.45, 0.5, 2 / 3, 2.5 / 3, 1.0])


def test_at_its_own_knots_a_motion_is_itself() -> None:
    rng = np.random.default_rng(0)
    place, rate = rng.normal(size=(6, 4)), rng.normal(size=(6, 4))
    instants = matching_times(TIME, PHASES, np.diff(TIME), PHASES)
    moved, moving = states_at(instants, TIME, place, rate)
    assert moved == pytest.approx(place, abs=1e-12)
    assert moving == pytest.approx(rate, abs=1e-12)


def test_constant_accelerations_are_followed_exactly() -> None:
    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.column_stack([1.0 + 2.0 * t - 3.0 * t**2]), np.column_stack([2.0 - 6.0 * t])

    instants = np.linspace(0.0, 1.0, 17)
    moved, moving = states_at(instants, TIME, *motion(TIME))
    assert moved == pytest.approx(motion(instants)[0], abs=1e-12)
    assert moving == pytest.approx(motion(instants)[1], abs=1e-12)


def test_means_keep_the_impulse() -> None:
    force = np.array([[3.0], [1.0], [0.0], [4.0], [2.0], [9.0]])
    instants = np.array([0.0, 0.1, 0.45, 0.7, 1.0])
    means = means_over(instants, TIME, force)
    assert means[0, 0] == pytest.approx(3.0)
    assert means[1, 0] == pytest.approx((0.1 * 3.0 + 0.2 * 1.0) / 0.35)
    assert np.diff(instants) @ means == pytest.approx(np.diff(TIME) @ force[:-1])
