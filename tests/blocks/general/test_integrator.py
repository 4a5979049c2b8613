"""``blocks.Integrator``: exact values."""

import pytest
from pydantic import ValidationError

from aloft.blocks.general.integrator import Integrator
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
