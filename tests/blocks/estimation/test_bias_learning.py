"""Biases of sensors are means over blocks of samples at rest, with a prior, without a motion's beginning."""

import numpy as np
import pytest

from aloft.blocks.estimation.inertial_estimator import (
    BiasSamples,
    InertialConstants,
    forget_samples,
    learn_bias,
)

BLOCK, PRIOR, PERIOD = 10, 5.0, 0.002


def constants() -> InertialConstants:
    values = InertialConstants.allocate()
    values.block_size, values.longest_mean, values.period = BLOCK, 1000, PERIOD
    return values


def nothing() -> tuple[BiasSamples, np.ndarray]:
    return BiasSamples.allocate(), np.zeros(3)


def feed(learning: BiasSamples, bias: np.ndarray, samples: np.ndarray) -> None:
    for sample in samples:
        learning.filling_sum[:] += sample
        learn_bias(learning, constants(), bias, PRIOR * PERIOD)


def test_the_bias_is_the_mean_of_all_blocks_but_the_last_with_the_prior() -> None:
    random = np.random.default_rng(0)
    for blocks in range(1, 8):
        learning, bias = nothing()
        samples = random.normal(size=(blocks * BLOCK + 3, 3))
        feed(learning, bias, samples)
        counted = samples[: (blocks - 1) * BLOCK]
        np.testing.assert_allclose(bias, counted.sum(axis=0) / (len(counted) + PRIOR), atol=1e-12)


def test_samples_before_a_motion_are_forgotten() -> None:
    learning, bias = nothing()
    feed(learning, bias, np.tile([3.0, -4.0, 5.0], (2 * BLOCK - 1, 1)))
    assert not bias.any(), "the first block waits for the second"
    forget_samples(learning)
    feed(learning, bias, np.tile([1.0, 2.0, -1.0], (2 * BLOCK, 1)))
    np.testing.assert_allclose(bias, np.array([1.0, 2.0, -1.0]) * BLOCK / (BLOCK + PRIOR))


@pytest.mark.parametrize("value", [0.5, -2.0])
def test_later_samples_count_at_least_as_one_in_a_thousand(value: float) -> None:
    learning, bias = nothing()
    feed(learning, bias, np.full((300 * BLOCK, 3), value))
    assert learning.samples == 1000
    before = bias.copy()
    feed(learning, bias, np.full((BLOCK, 3), 2.0 * value))
    feed(learning, bias, np.full((BLOCK, 3), 2.0 * value))
    expected = before + BLOCK * (value - before) / (1000 + PRIOR)
    expected = expected + BLOCK * (2.0 * value - expected) / (1000 + PRIOR)
    np.testing.assert_allclose(bias, expected, rtol=1e-12)
