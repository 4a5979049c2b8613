"""The filter's pure functions one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics import inertial_filter as inertial
from aloft.mathematics import rotations

from ..turns import quaternion_of, turn_between

small = st.floats(-0.1, 0.1)
angles = st.floats(-1.0, 1.0)


def turned_back(orientation, vector):
    out = np.empty(3)
    rotations.rotate_back(orientation, np.array(vector), out)
    return out


def test_propagate_follows_a_turning_and_accelerating_body():
    """A body on a circle, spinning with it: everything about it is known in closed form."""
    radius, spin, period = 0.3, 4.0, 0.002
    q, p, v = np.array([0, 0, 0, 1.0]), np.array([radius, 0, 0]), np.array([0, radius * spin, 0])
    last = np.array([0, 0, spin])
    # In the body: centripetal acceleration along -x, gravity's reaction along z.
    force = np.array([-radius * spin**2, 0.0, inertial.GRAVITY])
    for _ in range(500):
        last[:] = [0, 0, spin]
        inertial.propagate(
            q, p, v, last, np.array([0, 0, spin]), force, period, np.empty(4), np.empty(3)
        )
    angle = spin * 1.0
    assert p == pytest.approx(np.array([math.cos(angle), math.sin(angle), 0]) * radius, abs=1e-5)
    assert v[:2] == pytest.approx(
        np.array([-math.sin(angle), math.cos(angle)]) * radius * spin, abs=1e-5
    )
    assert np.abs(turn_between(q, quaternion_of((0, 0, angle)))).max() < 1e-12


def test_propagate_falls_freely():
    q, p, v = quaternion_of((0.3, -0.2, 0.1)), np.zeros(3), np.array([1.0, 0, 2.0])
    for _ in range(100):
        inertial.propagate(
            q, p, v, np.zeros(3), np.zeros(3), np.zeros(3), 0.002, np.empty(4), np.empty(3)
        )
    assert v == pytest.approx([1.0, 0.0, 2.0 - inertial.GRAVITY * 0.2])
    assert p == pytest.approx([0.2, 0.0, 0.4 - 0.5 * inertial.GRAVITY * 0.04])


@given(small, small, small)
def test_rotate_in_world_is_the_exponential_from_the_left(x, y, z):
    q = quaternion_of((0.4, 0.5, -0.6))
    expected, turn = np.empty(4), quaternion_of((x, y, z))
    rotations.multiply(turn, q, expected)
    inertial.rotate_in_world(q, x, y, z)
    assert np.abs(turn_between(q, expected)).max() < 1e-3
    assert np.linalg.norm(q) == pytest.approx(1.0)


@given(angles, angles, st.floats(-3.0, 3.0))
def test_orientation_from_gravity_finds_the_tilt(roll, pitch, heading):
    lean = quaternion_of((roll, pitch, 0.0))
    q, found, up = np.empty(4), np.empty(4), np.empty(3)
    rotations.multiply(quaternion_of((0, 0, heading)), lean, q)
    force = turned_back(q, [0.0, 0.0, 9.7])
    inertial.orientation_from_gravity(force, found)
    rotations.rotate(found, force, up)
    assert up == pytest.approx([0.0, 0.0, 9.7], abs=1e-12)


def test_orientation_from_gravity_without_a_force_and_upside_down():
    q = np.empty(4)
    inertial.orientation_from_gravity(np.zeros(3), q)
    assert q.tolist() == [0, 0, 0, 1]
    inertial.orientation_from_gravity(np.array([0.0, 0.0, -9.81]), q)
    assert np.linalg.norm(q) == pytest.approx(1.0)


def test_the_tilt_correction_converges_to_upright_and_keeps_the_heading():
    q = np.empty(4)
    rotations.multiply(quaternion_of((0.1, -0.2, 0)), quaternion_of((0, 0, 0.5)), q)
    before = rotations.yaw(q)
    force = turned_back(quaternion_of((0, 0, 0.5)), [0.0, 0.0, 9.81])
    for _ in range(2000):
        inertial.correct_tilt_from_gravity(q, force, 0.01, np.empty(3))
    assert rotations.tilt(q) < 1e-6
    assert rotations.yaw(q) == pytest.approx(before, abs=0.03)


@given(small, small, small, st.sampled_from([(0.0, 0.0), (0.2, -0.1)]))
def test_misalignment_puts_the_feet_on_the_ground_and_faces_forward(x, y, z, gradient):
    true = quaternion_of((0.5, 0.3, -0.2))
    place = np.array([[0.05, -0.08, 0], [-0.035, -0.08, 0], [0.05, 0.08, 0], [-0.035, 0.08, 0]])
    place[:, 2] = place[:, :2] @ gradient
    points = np.array([turned_back(true, row - [0.01, 0.02, 0.38]) for row in place])
    forward = turned_back(true, [2.0, 0.0, 0.0])
    q, error = true.copy(), np.empty(3)
    inertial.rotate_in_world(q, x, y, z)
    for _ in range(10):
        assert inertial.misalignment(
            q, points, np.ones(4, bool), forward, np.array(gradient), error, np.empty(3)
        )
        inertial.rotate_in_world(q, *error.tolist())
    assert np.abs(turn_between(q, true)).max() < 1e-9


def test_misalignment_is_first_order_exact():
    """One step takes a small error away up to its square."""
    points = np.array([[0.05, -0.08, -0.4], [-0.03, -0.08, -0.4], [0.05, 0.08, -0.4]])
    q, error = quaternion_of((1e-3, -2e-3, 3e-3)), np.empty(3)
    forward = np.array([1.0, 0, 0])
    inertial.misalignment(q, points, np.ones(3, bool), forward, np.zeros(2), error, np.empty(3))
    assert error == pytest.approx([-1e-3, 2e-3, -3e-3], abs=1e-5)


@given(small, small, st.floats(-3.0, 3.0))
def test_points_in_one_line_give_the_turn_across_it(x, y, heading):
    """The smallest turn that lays the line flat: about the line itself it leaves what is there."""
    along = np.array([math.cos(heading), math.sin(heading), 0.0])
    points = np.outer([0.05, 0.0, -0.03], along) - np.array([0.0, 0.0, 0.4])
    q, error, forward = quaternion_of((0.0, 0.0, 0.0)), np.empty(3), np.array([1.0, 0, 0])
    inertial.rotate_in_world(q, x, y, 0.0)
    everything = points, np.ones(3, bool), forward, np.zeros(2), error, np.empty(3)
    for _ in range(10):
        assert not inertial.misalignment(q, *everything)
        assert error[2] == 0.0
        assert abs(error @ along) < 0.1 * np.abs(error).max() + 1e-9
        inertial.rotate_in_world(q, *error.tolist())
    middle, end = np.empty(3), np.empty(3)
    rotations.rotate(q, points[1], middle)
    rotations.rotate(q, points[0], end)
    assert end[2] == pytest.approx(middle[2], abs=1e-9)


def test_one_point_says_nothing():
    error, forward = np.ones(3), np.array([1.0, 0, 0])
    point = np.array([[0.05, 0.0, -0.4]])
    assert not inertial.misalignment(
        quaternion_of((0.1, 0, 0)),
        point,
        np.ones(1, bool),
        forward,
        np.zeros(2),
        error,
        np.empty(3),
    )
    assert error == pytest.approx(np.zeros(3), abs=1e-12)


def test_weights_fall_with_speed_and_are_zero_without_contact():
    rates = np.array([[-1.0, 0, 0], [-0.92, 0, 0], [0.0, 0, 0], [-1.0, 0, 0]])
    weights = np.empty(4)
    active = np.array([True, True, True, False])
    largest = inertial.weigh_contacts(rates, active, np.array([1.0, 0, 0]), 0.08, weights)
    assert weights[0] == largest == 1.0
    assert weights[1] == pytest.approx(0.25)
    assert weights[2] < 1e-4
    assert weights[3] == 0.0


def stand(position, velocity, points, rates, weights, anchors, anchored, gain=0.1):
    active = np.ones(len(points), dtype=bool)
    standing = inertial.StandingPoints(points, rates, active, weights, anchors, anchored)
    inertial.correct_by_contacts(standing, gain, gain, position, velocity, np.empty(3))


def test_standing_points_pull_velocity_and_position():
    position, velocity = np.array([0.1, 0.2, 0.4]), np.array([0.3, 0.0, -0.1])
    points = np.array([[0.0, 0.1, -0.4], [0.0, -0.1, -0.4]])
    anchors, anchored = np.zeros((2, 3)), np.zeros(2, dtype=bool)
    stand(position, velocity, points, np.zeros((2, 3)), np.ones(2), anchors, anchored)
    assert anchored.all()
    assert anchors == pytest.approx(np.array([0.1, 0.2, 0.4]) + points)
    assert velocity == pytest.approx([0.27, 0.0, -0.09])
    position += [0.01, 0.0, 0.0]
    stand(position, velocity, points, np.zeros((2, 3)), np.ones(2), anchors, anchored)
    assert position == pytest.approx([0.109, 0.2, 0.4])


def test_an_untrusted_point_drags_its_anchor_and_pulls_nothing():
    position, velocity = np.zeros(3), np.zeros(3)
    points, anchors = np.array([[0.0, 0.1, -0.4]]), np.array([[5.0, 5.0, 5.0]])
    anchored = np.array([True])
    stand(position, velocity, points, np.ones((1, 3)), np.zeros(1), anchors, anchored)
    assert not position.any() and not velocity.any()
    assert anchors == pytest.approx(points)


def test_a_point_that_is_half_trusted_keeps_its_anchor_at_any_rate():
    position, anchors = np.array([0.05, 0.0, 0.0]), np.array([[0.0, 0.1, -0.4]])
    points, anchored, place = anchors.copy(), np.array([True]), anchors.copy()
    for _ in range(1000):
        stand(position, np.zeros(3), points, np.zeros((1, 3)), np.array([0.5]), anchors, anchored)
    assert (anchors == place).all(), "it does not follow a wrong position"
    assert np.abs(position).max() < 1e-6


def test_a_point_without_contact_loses_its_anchor():
    anchored = np.array([True, True])
    standing = inertial.StandingPoints(
        np.zeros((2, 3)), np.zeros((2, 3)), np.array([True, False]), np.array([1.0, 0.0]),
        np.zeros((2, 3)), anchored,
    )  # fmt: skip
    inertial.correct_by_contacts(standing, 0.1, 0.1, np.zeros(3), np.zeros(3), np.empty(3))
    assert anchored.tolist() == [True, False]
