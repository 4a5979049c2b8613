"""The log-linear property, the covariance against a swarm, every H against a perturbed estimate, updates against the textbook."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics import extended_pose, rotations
from aloft.mathematics.arrays import Array1D, Array2D
from aloft.mathematics.constants import GRAVITY
from aloft.mathematics.inertial_filter import propagate
from aloft.mathematics.invariant_filter import (
    add_contact,
    error_transition,
    height_row,
    innovation,
    input_jacobian,
    invert,
    measurement_jacobian,
    position_jacobian,
    propagate_covariance,
    remove_contact,
    squared_distance,
    update_covariance,
    vector_deviation,
    world_definition_jacobian,
)
from aloft.mathematics.kernel import kernel
from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import find_robot

from ..compiled import run_compiled

PERIOD, N = 0.002, 2
SIZE = 9 + 3 * N


def make(random, size=1.0):
    """Any state: orientation, and velocity, position and contact points."""
    tangent = size * random.normal(size=SIZE)
    orientation, vectors = np.empty(4), np.empty((2 + N, 3))
    extended_pose.exponential(tangent, orientation, vectors)
    return orientation, vectors


def perturbed(state, tangent):
    """exp(tangent) times a state."""
    orientation, vectors = state[0].copy(), state[1].copy()
    extended_pose.retract(
        np.asarray(tangent, float), orientation, vectors, np.empty(4), np.empty(3)
    )
    return orientation, vectors


def error(estimate, truth):
    """log(estimate truth^-1)."""
    out, spare, tangent = (np.empty(4), np.empty((2 + N, 3))), np.empty(4), np.empty(SIZE)
    extended_pose.divide(*estimate, *truth, *out, spare)
    extended_pose.logarithm(*out, tangent)
    return tangent


def advance(state, rate, force):
    """One period at a constant rate [rad/s, body] and specific force [m/s^2, body]."""
    propagate(state[0], state[1][1], state[1][0], rate.copy(), rate, force, PERIOD, np.empty(4),
              np.empty(3))  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_the_error_is_log_linear(seed):
    """Of any size and along any trajectory it grows by the same matrix, exactly."""
    random = np.random.default_rng(seed)
    transition = np.empty((SIZE, SIZE))
    error_transition(GRAVITY, PERIOD, transition)
    truth = make(random)
    start = random.uniform(-0.8, 0.8, SIZE)
    estimate, expected = perturbed(truth, start), start
    for _ in range(200):
        rate, force = 8.0 * random.normal(size=3), 30.0 * random.normal(size=3)
        advance(truth, rate, force)
        advance(estimate, rate, force)
        expected = transition @ expected
    np.testing.assert_allclose(error(estimate, truth), expected, rtol=0, atol=1e-10)


def test_the_error_is_the_same_along_every_trajectory():
    """The point of the invariant error: the ordinary one depends on where the robot goes."""
    start, invariant, ordinary = np.full(SIZE, 0.1), [], []
    for seed in (1, 2):
        random = np.random.default_rng(seed)
        truth = make(random)
        estimate = perturbed(truth, start)
        for _ in range(100):
            rate, force = 5.0 * random.normal(size=3), 20.0 * random.normal(size=3)
            advance(truth, rate, force)
            advance(estimate, rate, force)
        invariant.append(error(estimate, truth))
        ordinary.append(estimate[1] - truth[1])
    np.testing.assert_allclose(*invariant, rtol=0, atol=1e-11)
    assert np.abs(ordinary[0] - ordinary[1]).max() > 0.05


@pytest.mark.parametrize("seed", range(3))
def test_what_a_bias_does(seed):
    """Numerically: the same period with a slightly other IMU."""
    random = np.random.default_rng(seed)
    truth, rate, force = make(random), random.normal(size=3), 10.0 * random.normal(size=3)
    middle, rotation, reach = np.empty(4), np.empty((3, 3)), np.zeros((SIZE, 6))
    rotations.integrate(truth[0], rate, PERIOD / 2, middle)
    rotations.to_matrix(middle, rotation)
    end = (truth[0].copy(), truth[1].copy())
    advance(end, rate, force)
    input_jacobian(
        rotation, 0.5 * (truth[1] + end[1]), np.ones(N, dtype=bool), GRAVITY, PERIOD, reach
    )
    for column in range(6):
        bias = np.zeros(6)
        bias[column] = 1e-3
        other = (truth[0].copy(), truth[1].copy())
        advance(other, rate - bias[:3], force - bias[3:])
        found = error(other, end) / 1e-3
        # The rest is of third order in the period.
        np.testing.assert_allclose(found, reach[:, column], rtol=0, atol=5e-8)


def test_points_that_are_not_there_do_not_move():
    reach = np.ones((SIZE, 6))
    input_jacobian(np.eye(3), np.ones((2 + N, 3)), np.array([False, True]), GRAVITY, PERIOD, reach)
    assert not reach[9:12, :3].any()
    assert reach[12:15, :3].any()


@pytest.mark.long
def test_the_covariance_is_that_of_a_swarm():
    """2000 estimates with biases and noise of their own, 80 ms of tumbling."""
    random, count, bias = np.random.default_rng(7), 2000, SIZE
    gyro, accelerometer, ticks = 0.01, 0.1, 40
    truth = make(random, 0.5)
    first = np.concatenate([np.full(SIZE, 0.01), np.full(3, gyro), np.full(3, accelerometer)])
    noise = np.array([0.02] * 3 + [0.5] * 3)
    swarm = [(perturbed(truth, s[:SIZE]), s[SIZE:]) for s in random.normal(size=(count, bias + 6)) * first]  # fmt: skip
    covariance = np.diag(first**2)
    transition, reach = np.empty((bias + 6, bias + 6)), np.zeros((bias + 6, 6))
    error_transition(GRAVITY, PERIOD, transition)
    for _ in range(ticks):
        rate, force = 3.0 * random.normal(size=3), 10.0 * random.normal(size=3)
        middle, rotation = np.empty(4), np.empty((3, 3))
        rotations.integrate(truth[0], rate, PERIOD / 2, middle)
        rotations.to_matrix(middle, rotation)
        input_jacobian(rotation, truth[1], np.ones(N, dtype=bool), GRAVITY, PERIOD, reach)
        propagate_covariance(transition, reach, bias, noise, covariance, np.empty((bias + 6, 6)),
             np.empty((bias + 6, bias + 6)))  # fmt: skip
        for estimate, own in swarm:
            sample = own + noise * random.normal(size=6)
            advance(estimate, rate - sample[:3], force - sample[3:])
        advance(truth, rate, force)
    errors = np.array([[*error(estimate, truth), *own] for estimate, own in swarm])
    np.testing.assert_allclose(errors.std(axis=0), np.sqrt(np.diag(covariance)), rtol=0.08)
    # Whitened by the predicted covariance, the swarm is white in every direction.
    white = np.linalg.solve(np.linalg.cholesky(covariance), errors.T)
    assert np.abs(white @ white.T / count - np.eye(bias + 6)).max() < 0.12


@pytest.mark.parametrize("first", [3, 6])
def test_the_deviation_of_a_vectors_own_error(first):
    random = np.random.default_rng(first)
    root = 1e-3 * random.normal(size=(SIZE, SIZE))
    state = make(random)
    vector = state[1][(first - 3) // 3]
    errors = [
        np.linalg.norm(perturbed(state, root @ random.normal(size=SIZE))[1][(first - 3) // 3] - vector)
        for _ in range(4000)
    ]  # fmt: skip
    expected = np.sqrt(np.mean(np.square(errors)))
    assert vector_deviation(root @ root.T, first, vector) == pytest.approx(expected, rel=0.05)


ROBOT = find_robot("bruce")
SEEN = ContactKinematics(ROBOT)
POINTS, JOINTS = 4, 10
OFFSETS = 15 + 3 * POINTS
CONTACTS_SIZE = OFFSETS + JOINTS
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
        for k in range(CONTACTS_SIZE):
            error = np.zeros(CONTACTS_SIZE)
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

    sensitivity = np.empty((3, CONTACTS_SIZE))
    position_jacobian(world.jacobians[point], OFFSETS, sensitivity)
    measurement_jacobian(point, sensitivity)
    assert residual(np.zeros(CONTACTS_SIZE)) == pytest.approx(np.zeros(3), abs=1e-15)
    np.testing.assert_allclose(world.differentiate(residual), -sensitivity, atol=1e-8)
    assert not sensitivity[:, :6].any()  # by no rotation and no velocity: the invariant error's


@pytest.mark.parametrize(("point", "reference"), [(0, -1), (3, -1), (1, 0), (2, 3)])
def test_how_high_a_point_is(point, reference):
    world = World(5)

    def residual(error):
        out = np.empty(3)
        height_row(
            1,
            point,
            reference,
            0.25,
            world.perturbed(error)[1],
            np.empty((3, CONTACTS_SIZE)),
            out,
        )
        return out[1]

    sensitivity, out = np.ones((3, CONTACTS_SIZE)), np.empty(3)
    height_row(1, point, reference, 0.25, world.vectors, sensitivity, out)
    height = world.vectors[2 + point, 2] - (
        world.vectors[2 + reference, 2] if reference >= 0 else 0
    )
    assert out[1] == pytest.approx(0.25 - height)
    np.testing.assert_allclose(world.differentiate(residual), -sensitivity[1], atol=1e-8)


def test_a_point_that_comes_is_as_uncertain_as_the_legs_and_the_base():
    random, world, point = np.random.default_rng(2), World(1), 2
    root = 1e-3 * random.normal(size=(CONTACTS_SIZE, CONTACTS_SIZE))
    covariance = root @ root.T
    remove_contact(point, covariance)
    rows = slice(9 + 3 * point, 12 + 3 * point)
    assert not covariance[rows].any() and not covariance[:, rows].any()
    before, noise = covariance.copy(), 1e-6 * np.diag([1.0, 2.0, 3.0])
    sensitivity = np.empty((3, CONTACTS_SIZE))
    position_jacobian(world.jacobians[point], OFFSETS, sensitivity)
    add_contact(
        point,
        sensitivity,
        noise,
        covariance,
        np.empty((3, CONTACTS_SIZE)),
        np.empty((3, 3)),
    )
    change = np.eye(CONTACTS_SIZE)
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

    sensitivity = np.empty((3, CONTACTS_SIZE))
    world_definition_jacobian(places, world.vectors, sensitivity)
    error = world.differentiate(residual)
    # The world's points do not move with the error of rotation about x and y at height zero only.
    np.testing.assert_allclose(error[:, 2:], sensitivity[:, 2:], atol=1e-8)


def test_a_single_point_shows_no_heading():
    sensitivity = np.ones((3, CONTACTS_SIZE))
    world_definition_jacobian(np.zeros((POINTS, 2)), World(4).vectors, sensitivity)
    assert not sensitivity[2].any()


@kernel
def measure_and_update(
    covariance: Array2D, sensitivity: Array2D, noise: Array2D, residual: Array1D, seen: Array2D,
    inverse: Array2D, scratch: Array2D, gain: Array2D, correction: Array1D, likelihood: Array1D,
) -> None:  # fmt: skip
    likelihood[0] = squared_distance(
        covariance, sensitivity, noise, residual, seen, inverse, scratch
    )
    update_covariance(covariance, sensitivity, noise, residual, seen, inverse, gain, correction)


def update(covariance, sensitivity, noise, residual):
    """Chi-squared, the new covariance, and the correction."""
    n = len(covariance)
    covariance, correction, likelihood = covariance.copy(), np.empty(n), np.empty(1)
    run_compiled(
        measure_and_update, covariance, sensitivity, noise, residual, np.empty((n, 3)),
        np.empty((3, 3)), np.empty((3, 3)), np.empty((n, 3)), correction, likelihood,
    )  # fmt: skip
    return likelihood[0], covariance, correction


def draw(seed, n=9, spread=0.0):
    """A problem whose standard deviations span ``spread`` decades."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(n, n)) * 10.0 ** random.uniform(-spread, 0.0, size=(n, 1))
    noise = random.normal(size=(3, 3))
    return root @ root.T, random.normal(size=(3, n)), noise @ noise.T, random.normal(size=3)


@pytest.mark.parametrize("seed", range(5))
def test_is_the_textbook(seed):
    covariance, h, noise, residual = draw(seed)
    likelihood, after, correction = update(covariance, h, noise, residual)
    s = h @ covariance @ h.T + noise
    gain = covariance @ h.T @ np.linalg.inv(s)
    assert likelihood == pytest.approx(residual @ np.linalg.solve(s, residual), rel=1e-9)
    np.testing.assert_allclose(correction, gain @ residual, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(after, (np.eye(9) - gain @ h) @ covariance, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_one_batch_or_one_row_after_the_other(seed):
    covariance, h, noise, residual = draw(seed)
    noise = np.diag(np.diag(noise))
    _, together, correction = update(covariance, h, noise, residual)
    error = np.zeros(9)
    for row in range(3):
        one, r = np.zeros((3, 9)), np.zeros(3)
        one[0], r[0] = h[row], residual[row] - h[row] @ error
        own = np.diag([noise[row, row], 1.0, 1.0])
        _, covariance, step = update(covariance, one, own, r)
        error += step
    np.testing.assert_allclose(covariance, together, atol=1e-9)
    np.testing.assert_allclose(error, correction, atol=1e-9)


@pytest.mark.parametrize(("seed", "n"), [(0, 9), (1, 21), (2, 37)])
def test_stays_symmetric_and_positive_over_many_updates(seed, n):
    """Standard deviations over five decades, noise of a millionth of the largest."""
    covariance, _, _, _ = draw(seed, n, spread=5.0)
    random = np.random.default_rng(seed)
    for _ in range(150):
        h = random.normal(size=(3, n))
        _, covariance, _ = update(covariance, h, 1e-12 * np.eye(3), np.zeros(3))
        covariance += 1e-9 * np.eye(n)
    assert np.array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_rows_that_say_nothing_change_nothing():
    covariance, _, _, _ = draw(1)
    likelihood, after, correction = update(covariance, np.zeros((3, 9)), np.eye(3), np.zeros(3))
    assert likelihood == 0.0
    np.testing.assert_array_equal(after, covariance)
    assert not correction.any()


def test_the_inverse():
    random = np.random.default_rng(3)
    for _ in range(20):
        root = random.normal(size=(3, 3))
        out = np.empty((3, 3))
        invert(root @ root.T, out)
        np.testing.assert_allclose(out @ root @ root.T, np.eye(3), atol=1e-8)


def test_what_has_no_inverse_is_ignored():
    out = np.empty((3, 3))
    invert(np.zeros((3, 3)), out)
    assert not out.any()
