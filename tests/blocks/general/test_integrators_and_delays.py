"""``blocks.Integrator``: exact values."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from aloft.blocks.general.integrators_and_delays import (
    Delay,
    DoubleIntegrator,
    Integrator,
    SampleHold,
    TrapezoidalIntegrator,
    UnitDelay,
    ZeroOrderHold,
)
from aloft.runtime.testing import BlockBench


def test_integrator_takes_euler_steps() -> None:
    bench = BlockBench(Integrator, {"n": 1, "initial": 10.0}, rate=4.0)
    outputs = []
    for value in (1.0, 2.0, 4.0):
        bench.set("u", value=value)
        bench.step()
        outputs.append(bench.get("y").value[0])
    assert outputs == [10.0, 10.25, 10.75]


def test_an_initial_value_must_have_n_elements() -> None:
    with pytest.raises(ValidationError, match="initial has 2 elements, expected n = 3"):
        BlockBench(Integrator, {"n": 3, "initial": [1.0, 2.0]})


def test_bounds_and_reset() -> None:
    bench = BlockBench(
        Integrator, {"n": 2, "initial": 1.0, "lower": [0.0, -9.0], "upper": 3.0}, rate=1
    )
    outputs = []
    for value, reset in ((5.0, False), (-7.0, False), (1.0, True), (0.0, False)):
        bench.set("u", value=value)
        bench.set("reset", value=reset)
        bench.step()
        outputs.append(bench.get("y").value.tolist())
    assert outputs == [[1.0, 1.0], [3.0, 3.0], [0.0, -4.0], [1.0, 1.0]]


def test_it_is_exact_on_a_ramp() -> None:
    bench = BlockBench(TrapezoidalIntegrator, {"initial": 1.0}, rate=4.0)
    for k in range(9):
        bench.set("u", value=k / 4.0)
        bench.step()
        assert bench.get("y").value[0] == 1.0 + 0.5 * (k / 4.0) ** 2


def test_a_reset_starts_anew() -> None:
    bench = BlockBench(TrapezoidalIntegrator, {"n": 2, "initial": [1.0, -1.0]}, rate=1.0)
    found = []
    for reset in (False, False, True, False):
        bench.set("u", value=2.0)
        bench.set("reset", value=reset)
        bench.step()
        found.append(bench.get("y").value.tolist())
    assert found == [[1, -1], [3, 1], [1, -1], [3, 1]]


def test_unit_delay_starts_from_its_initial_value() -> None:
    bench = BlockBench(UnitDelay, {"n": 2, "initial": [3.0, 4.0]})
    outputs = []
    for value in (1.0, 2.0, 5.0):
        bench.set("u", value=value)
        bench.step()
        outputs.append(bench.get("y").value.tolist())
    assert outputs == [[3.0, 4.0], [1.0, 1.0], [2.0, 2.0]]


def test_an_initial_value_must_have_n_elements_unit_delay() -> None:
    with pytest.raises(ValidationError, match="initial has 2 elements, expected n = 3"):
        BlockBench(UnitDelay, {"n": 3, "initial": [1.0, 2.0]})


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=12), st.integers(1, 5))
def test_it_gives_back_the_inputs_in_order(inputs: list[float], samples: int) -> None:
    bench = BlockBench(Delay, {"samples": samples, "initial": 7.0})
    found = []
    for u in inputs:
        bench.set("u", value=u)
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == ([7.0] * samples + inputs)[: len(inputs)]


def test_it_holds_what_it_sampled() -> None:
    bench = BlockBench(SampleHold, {"initial": -1.0})
    found = []
    for u, trigger in ((1.0, False), (2.0, True), (3.0, False), (4.0, True)):
        bench.set("u", value=u)
        bench.set("trigger", value=trigger)
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == [-1, 2, 2, 4]


def test_every_third_input_is_held() -> None:
    bench = BlockBench(ZeroOrderHold, {"samples": 3})
    found = []
    for u in range(8):
        bench.set("u", value=float(u))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == [0, 0, 0, 3, 3, 3, 6, 6]


def amplitude(frequency: float, runs: int) -> float:
    """The greatest position of a mass on a spring in the last hundred runs; it starts from 1."""
    bench = BlockBench(DoubleIntegrator, {"initial": 1.0}, rate=500.0)
    found = []
    for _ in range(runs):
        bench.set("u", value=-(frequency**2) * bench.get("x").value)
        bench.step()
        found.append(abs(float(bench.get("y").value[0])))
    return max(found[-100:])


@pytest.mark.parametrize("frequency", [12.25, 200.0, 900.0])
def test_a_spring_on_a_double_integrator_keeps_its_amplitude(frequency: float) -> None:
    # The exact bound of symplectic Euler: 1 / sqrt(1 - (w T / 2)^2).
    assert amplitude(frequency, 5000) <= 1.0 / np.sqrt(1.0 - (frequency / 1000.0) ** 2) + 1e-9


def test_a_double_integrator_falls_as_the_sum_of_its_steps() -> None:
    bench = BlockBench(DoubleIntegrator, {"initial": 3.0, "initial_rate": 1.0}, rate=4.0)
    found = []
    for reset in (False, False, True, False):
        bench.set("u", value=2.0)
        bench.set("reset", value=reset)
        bench.step()
        found.append((float(bench.get("rate").value[0]), float(bench.get("y").value[0])))
    assert found == [(1.0, 3.0), (1.5, 3.375), (2.0, 3.875), (1.0, 3.0)]
