"""Every H against the residual of a perturbed estimate; points that come and go."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics import extended_pose, rotations
from aloft.mathematics.invariant_contacts import (
    add_contact,
    height_row,
    innovation,
    measurement_jacobian,
    place_jacobian,
    remove_contact,
    world_definition_jacobian,
)
from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
SEEN = ContactKinematics(ROBOT)
POINTS, JOINTS = 4, 10
OFFSETS = 15 + 3 * POINTS
SIZE = OFFSETS + JOINTS
STEP = 1e-6


class World:
    """A true state whose points stand where the legs reach, and its small perturbations."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.angles = ROBOT.standing_position + random.uniform(-0.05, 0.05, JOINTS)
        self.orientation, self.vectors = np.empty(4), np.empty((2 + POINTS, 3))
        extended_pose.exponential(
            random.normal(size=9 + 3 * POINTS), self.orientation, self.vectors
        )
        places, self.jacobians = self.places(self.orientation, np.zeros(JOINTS))
        self.vectors[2:] = self.vectors[1] + places

    def places(self, orientation, offset):
        """From base to points in the world, and their Jacobians there, with that offset left in."""
        SEEN.evaluate(orientation, np.zeros(3), self.angles - offset, np.zeros(JOINTS))
        SEEN.differentiate()
        rotation = np.empty((3, 3))
        rotations.to_matrix(orientation, rotation)
        return SEEN.centres @ rotation.T, rotation @ SEEN.jacobians

    def perturbed(self, error):
        """Orientation, vectors and offset of an estimate that is off by ``error``."""
        orientation, vectors = self.orientation.copy(), self.vectors.copy()
        extended_pose.retract(error, orientation, vectors, np.empty(4), np.empty(3))
        return orientation, vectors, error[OFFSETS:]

    def differentiate(self, residual):
        """d residual / d error, numerically; the biases do not matter."""
        columns = []
        for k in range(SIZE):
            error = np.zeros(SIZE)
            error[k] = STEP
            columns.append((residual(error) - residual(-error)) / (2 * STEP))
        return np.array(columns).T


@pytest.mark.parametrize("point", range(POINTS))
def test_where_the_legs_see_a_point(point):
    world = World(point)

    def residual(error):
        orientation, vectors, offset = world.perturbed(error)
        out = np.empty(3)
        innovation(point, world.places(orientation, offset)[0][point], vectors, out)
        return out

    sensitivity = np.empty((3, SIZE))
    place_jacobian(world.jacobians[point], OFFSETS, sensitivity)
    measurement_jacobian(point, sensitivity)
    assert residual(np.zeros(SIZE)) == pytest.approx(np.zeros(3), abs=1e-15)
    np.testing.assert_allclose(world.differentiate(residual), -sensitivity, atol=1e-8)
    assert not sensitivity[:, :6].any()  # by no rotation and no velocity: the invariant error's


@pytest.mark.parametrize(("point", "reference"), [(0, -1), (3, -1), (1, 0), (2, 3)])
def test_how_high_a_point_is(point, reference):
    world = World(5)

    def residual(error):
        out = np.empty(3)
        height_row(1, point, reference, 0.25, world.perturbed(error)[1], np.empty((3, SIZE)), out)
        return out[1]

    sensitivity, out = np.ones((3, SIZE)), np.empty(3)
    height_row(1, point, reference, 0.25, world.vectors, sensitivity, out)
    height = world.vectors[2 + point, 2] - (
        world.vectors[2 + reference, 2] if reference >= 0 else 0
    )
    assert out[1] == pytest.approx(0.25 - height)
    np.testing.assert_allclose(world.differentiate(residual), -sensitivity[1], atol=1e-8)


def test_a_point_that_comes_is_as_uncertain_as_the_legs_and_the_base():
    random, world, point = np.random.default_rng(2), World(1), 2
    root = 1e-3 * random.normal(size=(SIZE, SIZE))
    covariance = root @ root.T
    remove_contact(point, covariance)
    rows = slice(9 + 3 * point, 12 + 3 * point)
    assert not covariance[rows].any() and not covariance[:, rows].any()
    before, noise = covariance.copy(), 1e-6 * np.diag([1.0, 2.0, 3.0])
    sensitivity = np.empty((3, SIZE))
    place_jacobian(world.jacobians[point], OFFSETS, sensitivity)
    add_contact(point, sensitivity, noise, covariance, np.empty((3, SIZE)), np.empty((3, 3)))
    change = np.eye(SIZE)
    change[rows] = -sensitivity
    expected = change @ before @ change.T
    expected[rows, rows] += noise
    np.testing.assert_allclose(covariance, expected, rtol=0, atol=1e-18)
    # What has just been seen has no residual but the noise.
    measurement_jacobian(point, sensitivity)
    np.testing.assert_allclose(sensitivity @ covariance @ sensitivity.T, noise, atol=1e-17)


@pytest.mark.parametrize("levers", ["feet", "pattern"])
def test_where_the_world_is_by_the_feet(levers):
    """The origin in the points' middle, and x where the feet or the pattern of points point."""
    world, places = World(4), SEEN.heading_levers
    if levers == "pattern":
        places = np.array([[0.2, -0.1], [-0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]])

    def residual(error):
        points = world.perturbed(error)[1][2:]
        middle = points.mean(axis=0)
        across = (places[:, 0] * points[:, 1] - places[:, 1] * points[:, 0]).sum()
        return np.array([middle[0], middle[1], across / (places**2).sum()])

    sensitivity = np.empty((3, SIZE))
    world_definition_jacobian(places, world.vectors, sensitivity)
    error = world.differentiate(residual)
    # The world's points do not move with the error of rotation about x and y at height zero only.
    np.testing.assert_allclose(error[:, 2:], sensitivity[:, 2:], atol=1e-8)


def test_a_single_point_shows_no_heading():
    sensitivity = np.ones((3, SIZE))
    world_definition_jacobian(np.zeros((POINTS, 2)), World(4).vectors, sensitivity)
    assert not sensitivity[2].any()
