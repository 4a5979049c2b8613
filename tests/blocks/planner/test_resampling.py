"""A motion on another grid of the same phases."""

import numpy as np
import pytest

from aloft.blocks.planner.resampling import (
    matching_places,
    means_between,
    same_phases,
    segments,
    states_at,
)

KINDS = ["squat", "squat", "thrust", "hit", "flight", "flight"]
TIME = np.array([0.0, 0.2, 0.4, 0.5, 0.5, 0.8, 1.0])
"""An interval of no length is an impact."""


def instants_of(places: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    interval, past = places
    return np.asarray(TIME[interval] + past * np.diff(TIME)[interval])


def test_segments_are_runs_of_one_kind() -> None:
    assert segments("aabccb") == [("a", 0, 2), ("b", 2, 3), ("c", 3, 5), ("b", 5, 6)]


def test_the_same_phases_in_any_number_of_intervals() -> None:
    assert same_phases("aabc", "abbbc")
    assert not same_phases("aabc", "ac")
    assert not same_phases("aabc", "abca")


def test_segments_begin_and_end_together() -> None:
    kinds = ["squat", "thrust", "thrust", "hit", "flight", "flight", "flight"]
    places = matching_places(TIME, KINDS, np.array([7.0, 1.0, 1.0, 0.0, 2.0, 2.0, 2.0]), kinds)
    expected = [0.0, 0.4, 0.45, 0.5, 0.5, 2 / 3, 2.5 / 3, 1.0]
    assert instants_of(places) == pytest.approx(expected)
    assert places[0][3] == 3, "the knot before an impact is before it"


def test_at_its_own_knots_a_motion_is_itself() -> None:
    rng = np.random.default_rng(0)
    place, rate = rng.normal(size=(7, 4)), rng.normal(size=(7, 4))
    places = matching_places(TIME, KINDS, np.diff(TIME), KINDS)
    moved, moving = states_at(*places, TIME, place, rate)
    assert moved == pytest.approx(place, abs=1e-12)
    assert moving == pytest.approx(rate, abs=1e-12)


def test_constant_accelerations_are_followed_exactly() -> None:
    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.column_stack([1.0 + 2.0 * t - 3.0 * t**2]), np.column_stack([2.0 - 6.0 * t])

    kinds = ["squat"] * 5 + ["thrust"] * 3 + ["hit"] + ["flight"] * 7
    places = matching_places(TIME, KINDS, np.array([1.0] * 8 + [0.0] + [1.0] * 7), kinds)
    moved, moving = states_at(*places, TIME, *motion(TIME))
    assert moved == pytest.approx(motion(instants_of(places))[0], abs=1e-12)
    assert moving == pytest.approx(motion(instants_of(places))[1], abs=1e-12)


def test_means_keep_the_impulse_and_an_impact_its_own() -> None:
    force = np.array([[3.0], [1.0], [0.0], [40.0], [2.0], [9.0], [9.0]])
    kinds = ["squat"] * 3 + ["thrust"] * 2 + ["hit"] + ["flight"] * 3
    steps = np.array([1.0, 1.0, 2.0, 1.0, 1.0, 0.0, 1.0, 2.0, 1.0])
    places = matching_places(TIME, KINDS, steps, kinds)
    means = means_between(*places, TIME, force)
    assert means[0, 0] == pytest.approx(3.0)
    assert means[2, 0] == pytest.approx(1.0)
    assert means[5, 0] == 40.0
    lengths = np.diff(instants_of(places))
    assert lengths @ means == pytest.approx(np.diff(TIME) @ force[:-1])
