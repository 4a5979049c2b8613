"""``blocks.FilteredDerivative``: exact values and its limit on a ramp."""

import pytest

from aloft.blocks.general.filtered_derivative import FilteredDerivative
from aloft.runtime.testing import BlockBench


def run(inputs: list[float], **params: object) -> list[float]:
    bench = BlockBench(FilteredDerivative, params, rate=10.0)
    values = []
    for u in inputs:
        bench.set("u", value=u)
        bench.step()
        values.append(bench.get("y").value[0])
    return values


def test_without_smoothing_it_is_the_difference() -> None:
    assert run([5.0, 6.0, 4.0], time_constant=0.0) == pytest.approx([0.0, 10.0, -20.0])


def test_on_a_ramp_it_tends_to_the_slope() -> None:
    found = run([0.1 * 3.0 * k for k in range(60)], time_constant="0.3 s")
    assert found[0] == 0.0
    assert found == sorted(found)
    assert found[-1] == pytest.approx(3.0, rel=1e-5)
