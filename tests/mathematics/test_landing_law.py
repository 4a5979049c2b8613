"""The turn of a body in flight against exact dynamics, and the choice of the landing place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.control.dynamics import Dynamics
from aloft.mathematics.landing_law import (
    LandingCost,
    choose_shift,
    flight_map,
    invert,
    map_flight,
    predict_tilt,
)
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
N = len(ROBOT.joints)
BENT = np.array([0.0, 0.6, 0.0, -1.1, 0.4, 0.1, 0.5, 0.05, -1.0, 0.3])


def in_flight(seed):
    """The dynamics of BRUCE in a random state of motion."""
    random = np.random.default_rng(seed)
    turn = random.normal(size=4) * [0.2, 0.2, 0.2, 0.0] + [0.0, 0.0, 0.0, 1.0]
    bench = BlockBench(Dynamics, robot=ROBOT)
    bench.set(
        "base",
        orientation=turn / np.linalg.norm(turn),
        linear_velocity=random.normal(size=3),
        angular_velocity=random.normal(size=3),
    )
    bench.set("joints", position=BENT, velocity=random.normal(size=N))
    bench.step()
    return bench.get("terms")


def mapped(terms, damping=1e-6):
    flight = flight_map(N, len(ROBOT.contacts))
    map_flight(
        terms.centroidal_matrix, terms.contact_jacobian, terms.base_rotation, ROBOT.total_mass,
        damping, flight,
    )  # fmt: skip
    return flight


@pytest.mark.parametrize("seed", range(5))
def test_momentum_and_the_feet_tell_how_fast_the_base_turns(seed):
    terms = in_flight(seed)
    flight = mapped(terms)
    rate = terms.base_rotation @ terms.velocity[3:6]
    seen = (terms.contact_velocity - terms.com_velocity).reshape(-1)
    carried = flight.carried @ terms.angular_momentum
    assert carried + flight.jacobian @ terms.velocity[6:] == pytest.approx(seen, abs=1e-12)
    found = (flight.drift @ terms.angular_momentum)[:2] + flight.turn @ (seen - carried)
    assert found == pytest.approx(rate[:2], abs=1e-6)


def test_tucked_legs_turn_bruces_torso_forward_and_so_do_feet_ahead():
    shift = np.zeros((2, 4))
    predict_tilt(
        mapped(in_flight(0), 0.02), np.zeros(3), np.zeros(3), np.zeros(12), 0.2, 0.0,
        np.array([-1.0, -1.0, 1.0, 1.0]), np.zeros(2), shift,
    )  # fmt: skip
    assert shift[1, 0] > 2.0  # rad/m
    assert shift[1, 3] > 2.0
    assert shift[0, 1] < -1.0


def test_the_tilt_at_touchdown_grows_with_momentum_and_time():
    flight, side = mapped(in_flight(1), 0.02), np.array([-1.0, -1.0, 1.0, 1.0])
    tilt, momentum, way = np.array([0.1, -0.2, 0.0]), np.array([0.01, 0.05, 0.0]), np.zeros(12)
    early, late, shift = np.zeros(2), np.zeros(2), np.zeros((2, 4))
    predict_tilt(flight, tilt, momentum, way, 0.0, 0.0, side, early, shift)
    predict_tilt(flight, tilt, momentum, way, 0.1, 0.0, side, late, shift)
    assert early == pytest.approx(tilt[:2])
    per_time = flight.drift[:2] @ momentum - flight.turn @ (flight.carried @ momentum)
    assert late == pytest.approx(tilt[:2] + 0.1 * per_time)
    way[2::3] = -0.01  # the feet have to go down by 1 cm
    predict_tilt(flight, tilt, momentum, way, 0.0, 0.0, side, late, shift)
    assert late == pytest.approx(tilt[:2] - 0.01 * shift[:, 3])


def test_shorter_legs_touch_down_later_so_the_base_turns_for_longer():
    flight, side = mapped(in_flight(1), 0.02), np.array([-1.0, -1.0, 1.0, 1.0])
    tilt, momentum, way = np.array([0.1, -0.2, 0.0]), np.array([0.01, 0.05, 0.0]), np.zeros(12)
    begin, end, soon, late = np.zeros(2), np.zeros(2), np.zeros((2, 4)), np.zeros((2, 4))
    predict_tilt(flight, tilt, momentum, way, 0.1, 0.0, side, begin, soon)
    predict_tilt(flight, tilt, momentum, way, 0.1 + 0.02 * 0.8, 0.0, side, end, soon)
    predict_tilt(flight, tilt, momentum, way, 0.1, 0.8, side, begin, late)
    assert 0.02 * (late - soon)[:, 3] == pytest.approx(end - begin, abs=1e-12)
    assert np.array_equal(late[:, :3], soon[:, :3])


def cost(goal, lowest=-1.0, highest=1.0, free=(0.0, 0.0)):
    weight = np.array([1.0, 1.0, 0.5, 0.2, 0.01, 0.02])
    return LandingCost(np.array(goal), weight, np.tile(free, (2, 1)), np.array([lowest, highest]))


@given(st.lists(st.floats(-1.0, 1.0), min_size=13, max_size=13))
def test_the_shift_is_the_best_one(values):
    tilt, turn, goal = np.array(values[:2]), 5.0 * np.reshape(values[2:10], (2, 4)), values[10:]
    weighed, shift = cost(goal, -100.0, 100.0), np.zeros(4)
    choose_shift(tilt, turn, weighed, np.zeros((4, 4)), shift)
    rows = np.sqrt(weighed.weight)[:, None] * np.vstack([np.eye(4), turn])
    wanted = np.sqrt(weighed.weight) * np.concatenate([goal, [0.0], -tilt])
    assert shift == pytest.approx(np.linalg.lstsq(rows, wanted, rcond=None)[0], abs=1e-9)


@pytest.mark.parametrize(("tilt", "bound"), [(-0.6, 0.05), (0.6, -0.02)])
def test_the_legs_are_no_longer_or_shorter_than_allowed(tilt, bound):
    turn = np.array([[0.0, -2.0, 0.0, 0.0], [4.0, 0.0, 0.0, 7.0]])
    free, held = np.zeros(4), np.zeros(4)
    choose_shift(np.array([0.0, tilt]), turn, cost([0.0] * 3), np.zeros((4, 4)), free)
    limits = cost([0.0] * 3, -0.02, 0.05)
    choose_shift(np.array([0.0, tilt]), turn, limits, np.zeros((4, 4)), held)
    assert abs(free[3]) > abs(bound)
    assert held[3] == pytest.approx(bound, abs=1e-6)
    assert abs(held[0]) > abs(free[0])  # the feet ahead have to do the rest


def test_a_tilt_within_what_is_free_costs_nothing_and_beyond_it_only_the_rest():
    turn = np.array([[0.0, -2.0, 0.0, 0.0], [4.0, 0.0, 0.0, 7.0]])
    goal, shift, other = [0.02, -0.01, 0.01], np.zeros(4), np.zeros(4)
    free = cost(goal, free=(-0.3, 0.5))
    choose_shift(np.array([0.1, -0.2]), turn, free, np.zeros((4, 4)), shift)
    assert shift == pytest.approx([*goal, 0.0], abs=1e-12)
    choose_shift(np.array([0.1, 0.3]), turn, free, np.zeros((4, 4)), shift)
    assert shift == pytest.approx([*goal, 0.0], abs=1e-12)
    choose_shift(np.array([0.1, -0.8]), turn, free, np.zeros((4, 4)), shift)
    rest = LandingCost(
        np.array(goal), free.weight * [1, 1, 1, 1, 0, 1], np.zeros((2, 2)), free.bounds
    )
    choose_shift(np.array([0.1, -0.5]), turn, rest, np.zeros((4, 4)), other)
    assert shift == pytest.approx(other, abs=1e-12)
    assert shift[3] > 0.01


def test_inverses_are_numpys():
    random = np.random.default_rng(0)
    a = random.normal(size=(3, 3))
    inverse = np.zeros((3, 3))
    invert(a, inverse)
    assert inverse == pytest.approx(np.linalg.inv(a))
    invert(np.zeros((3, 3)), inverse)
    assert not inverse.any()
