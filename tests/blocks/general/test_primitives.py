"""The small general blocks: exact values."""

import math

import numpy as np
import pytest

from aloft.blocks.general.primitives import Constant, Gain, Integrator, SineWave, Sum, UnitDelay
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def test_constant_has_as_many_elements_as_its_value() -> None:
    bench = BlockBench(Constant, {"value": [1.0, -2.0]})
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, -2.0]


def test_gain_multiplies() -> None:
    bench = BlockBench(Gain, {"n": 2, "gain": -3.0})
    bench.set("u", value=[1.0, 0.5])
    bench.step()
    assert bench.get("y").value.tolist() == [-3.0, -1.5]


def test_sum_subtracts_with_a_negative_weight() -> None:
    bench = BlockBench(Sum, {"n": 2, "weights": [2.0, -1.0]})
    bench.set("a", value=[1.0, 2.0])
    bench.set("b", value=[0.5, 5.0])
    bench.step()
    assert bench.get("y").value.tolist() == [1.5, -1.0]


def test_unit_delay_starts_from_its_initial_value() -> None:
    bench = BlockBench(UnitDelay, {"n": 2, "initial": [3.0, 4.0]})
    outputs = []
    for value in (1.0, 2.0, 5.0):
        bench.set("u", value=value)
        bench.step()
        outputs.append(bench.get("y").value.tolist())
    assert outputs == [[3.0, 4.0], [1.0, 1.0], [2.0, 2.0]]


def test_integrator_takes_euler_steps() -> None:
    bench = BlockBench(Integrator, {"n": 1, "initial": 10.0}, rate=4.0)
    outputs = []
    for value in (1.0, 2.0, 4.0):
        bench.set("u", value=value)
        bench.step()
        outputs.append(bench.get("y").value[0])
    assert outputs == [10.0, 10.25, 10.75]


@pytest.mark.parametrize("block_type", [UnitDelay, Integrator])
def test_initial_values_must_fit(block_type: type) -> None:
    with pytest.raises(BlockError, match="initial has 2 elements, expected n = 3"):
        BlockBench(block_type, {"n": 3, "initial": [1.0, 2.0]})


def test_sine_wave_follows_time() -> None:
    bench = BlockBench(
        SineWave, {"n": 2, "amplitude": 2.0, "frequency": "50 Hz", "offset": 1.0}, rate=1000.0
    )
    values = []
    for _ in range(20):
        bench.step()
        values.append(bench.get("y").value.copy())
    expected = [1.0 + 2.0 * math.sin(2.0 * math.pi * 50.0 * k / 1000.0) for k in range(20)]
    np.testing.assert_allclose(np.array(values)[:, 1], expected, rtol=0, atol=1e-12)
