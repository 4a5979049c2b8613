"""``blocks.Delay``: it is as many unit delays one after the other."""

from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.delay import Delay
from aloft.runtime.testing import BlockBench


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
