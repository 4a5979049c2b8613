"""The log-linear property, and the covariance against a swarm of perturbed estimates."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics import extended_pose, rotations
from aloft.mathematics.constants import GRAVITY
from aloft.mathematics.inertial_filter import propagate
from aloft.mathematics.invariant_propagation import (
    error_transition,
    input_jacobian,
    propagate_covariance,
    vector_deviation,
)

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
