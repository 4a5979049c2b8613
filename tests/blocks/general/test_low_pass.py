"""``blocks.LowPass``: its start, its response, its error."""

import math

import numpy as np
import pytest

from aloft.blocks.general.low_pass import LowPass
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize("order", [1, 2])
def test_a_sine_at_the_cutoff_is_damped_by_the_root_of_two(order: int) -> None:
    bench = BlockBench(LowPass, {"cutoff": "10 Hz", "order": order}, rate=1000.0)
    found = []
    for k in range(1000):
        bench.set("u", value=math.sin(2 * math.pi * 10.0 * k / 1000.0))
        bench.step()
        found.append(bench.get("y").value[0])
    assert np.max(found[800:]) == pytest.approx(math.sqrt(0.5), abs=1e-3)


def test_it_begins_settled() -> None:
    bench = BlockBench(LowPass, {"cutoff": 10.0, "order": 2, "n": 2})
    bench.set("u", value=[3.0, -1.0])
    bench.step(5)
    np.testing.assert_allclose(bench.get("y").value, [3.0, -1.0], rtol=1e-12)


def test_the_cutoff_must_be_below_half_of_the_rate() -> None:
    with pytest.raises(BlockError, match="cutoff is not below half of the block's rate"):
        BlockBench(LowPass, {"cutoff": 250.0}, rate=500.0)
