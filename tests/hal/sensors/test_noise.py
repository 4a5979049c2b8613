"""A noise model adds bias, noise, range, resolution and delay, in this order and from the seed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.hal.random_streams import sensor_stream
from aloft.hal.sensors.noise import FieldErrors, NoiseModel, delay_sample


def errors(size: int, **model: Any) -> FieldErrors:
    streams = (sensor_stream(4, "scale", number) for number in (0, 1))
    return FieldErrors(NoiseModel(**model), size, *streams)


def readings(made: FieldErrors, true: Any, count: int = 1) -> Any:
    reading, found = np.zeros(len(true)), []
    calls = made.calls(np.array(true, dtype=np.float64), reading)
    for _ in range(count):
        for call in calls:
            call.run()
        found.append(reading.copy())
    return np.array(found)


def test_without_errors_a_reading_is_the_true_value() -> None:
    assert readings(errors(3), [1.5, -2.0, np.nan])[0].tolist()[:2] == [1.5, -2.0]
    assert np.isnan(readings(errors(1), [np.nan])).all()


def test_noise_has_its_standard_deviation_and_is_white() -> None:
    found = readings(errors(2, noise=0.3), [1.0, 2.0], 4000)
    np.testing.assert_allclose(found.std(axis=0), 0.3, rtol=0.05)
    np.testing.assert_allclose(found.mean(axis=0), [1.0, 2.0], atol=4 * 0.3 / np.sqrt(4000))
    white = found[:, 0] - 1.0
    assert abs(np.mean(white[1:] * white[:-1])) < 4 * 0.3**2 / np.sqrt(4000)


def test_a_bias_is_constant_and_uniform_within_its_spread() -> None:
    made = errors(1000, bias=0.5)
    found = readings(made, np.zeros(1000), 2)
    assert found[0].tolist() == found[1].tolist() == made.bias.tolist()
    assert np.abs(found).max() <= 0.5
    assert np.mean(np.abs(found)) == pytest.approx(0.25, abs=0.02)


def test_range_and_resolution() -> None:
    found = readings(errors(4, range=2.0, resolution=0.25), [0.4, -0.4, 5.0, -5.0])
    assert found[0].tolist() == [0.5, -0.5, 2.0, -2.0]


def test_a_delayed_reading_is_an_earlier_sample() -> None:
    past = np.zeros((4, 2)), np.zeros(1, np.int64), np.array([0, 3])
    reading, found = np.zeros(2), []
    for k in range(7):
        delay_sample(np.array([10.0 + k, 20.0 + k]), *past, reading)
        found.append(reading.tolist())
    assert [row[0] for row in found] == [10.0 + k for k in range(7)]
    assert [row[1] for row in found] == [20.0, 20.0, 20.0, 20.0, 21.0, 22.0, 23.0]


def test_a_factor_scales_noise_and_bias_and_zero_means_no_errors_at_all() -> None:
    model = NoiseModel(noise=0.2, bias=0.1, range=5.0, resolution=0.01, delay=0.002)
    assert model.scaled(2.0) == NoiseModel(
        noise=0.4, bias=0.2, range=5.0, resolution=0.01, delay=0.002
    )
    assert model.scaled(0.0) == NoiseModel()
