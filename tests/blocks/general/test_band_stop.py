"""``blocks.BandStop``: its start and what it takes out."""

import math

import numpy as np
import pytest

from aloft.blocks.general.band_stop import BandStop
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(("frequency", "left"), [(10.0, 0.0), (100.0, 1.0)])
def test_only_the_centre_is_taken_out(frequency: float, left: float) -> None:
    bench = BlockBench(BandStop, {"centre": "10 Hz", "width": "2 Hz"}, rate=1000.0)
    found = []
    for k in range(3000):
        bench.set("u", value=2.0 + math.sin(2 * math.pi * frequency * k / 1000.0))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found[0] == pytest.approx(2.0)
    assert math.sqrt(2.0) * np.std(found[2500:]) == pytest.approx(left, abs=2e-3)
