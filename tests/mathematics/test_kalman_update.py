"""Three rows of a measurement against the textbook, and what rounding must not break."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics.kalman_update import correct, invert, weigh


def update(covariance, sensitivity, noise, residual):
    """Chi-squared, the new covariance, and the correction."""
    n = len(covariance)
    covariance = covariance.copy()
    seen, inverse, gain = np.empty((n, 3)), np.empty((3, 3)), np.empty((n, 3))
    correction = np.empty(n)
    likelihood = weigh(covariance, sensitivity, noise, residual, seen, inverse, np.empty((3, 3)))
    correct(covariance, sensitivity, noise, residual, seen, inverse, gain, correction)
    return likelihood, covariance, correction


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


@pytest.mark.parametrize("seed", range(3))
def test_stays_symmetric_and_positive_over_many_updates(seed):
    """Standard deviations over five decades, noise of a millionth of the largest."""
    covariance, _, _, _ = draw(seed, 37, spread=5.0)
    random = np.random.default_rng(seed)
    for _ in range(400):
        h = random.normal(size=(3, 37))
        _, covariance, _ = update(covariance, h, 1e-12 * np.eye(3), np.zeros(3))
        covariance += 1e-9 * np.eye(37)
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
