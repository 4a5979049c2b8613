"""``blocks.HighPass``: its start and its response."""

import math

import numpy as np
import pytest

from aloft.blocks.general.high_pass import HighPass
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize("order", [1, 2])
def test_a_constant_does_not_pass_and_the_cutoff_is_damped(order: int) -> None:
    bench = BlockBench(HighPass, {"cutoff": "10 Hz", "order": order}, rate=1000.0)
    found = []
    for k in range(1000):
        bench.set("u", value=5.0 + math.sin(2 * math.pi * 10.0 * k / 1000.0))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found[0] == pytest.approx(0.0, abs=1e-12)
    assert np.max(found[800:]) == pytest.approx(math.sqrt(0.5), abs=1e-3)
    assert np.min(found[800:]) == pytest.approx(-math.sqrt(0.5), abs=1e-3)
