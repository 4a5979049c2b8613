"""``blocks.MovingAverage``: the mean of what it has seen."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.moving_average import MovingAverage
from aloft.runtime.testing import BlockBench


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=12), st.integers(1, 6))
def test_it_is_the_mean_of_the_last_inputs(inputs: list[float], samples: int) -> None:
    bench = BlockBench(MovingAverage, {"samples": samples})
    for k, u in enumerate(inputs):
        bench.set("u", value=u)
        bench.step()
        expected = np.mean(inputs[max(0, k + 1 - samples) : k + 1])
        np.testing.assert_allclose(bench.get("y").value[0], expected, atol=1e-10)
