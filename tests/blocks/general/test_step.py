"""``blocks.Step``: exact values and the tick of the step."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from aloft.blocks.general.step import Step
from aloft.runtime.testing import BlockBench


def test_step_jumps_once() -> None:
    bench = BlockBench(Step, {"n": 2, "at": "2 s", "before": [1.0, 2.0], "after": 5.0}, rate=1.0)
    values = []
    for _ in range(4):
        bench.step()
        values.append(bench.get("y").value.tolist())
    assert values == [[1.0, 2.0], [1.0, 2.0], [5.0, 5.0], [5.0, 5.0]]


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 20_000), st.sampled_from([100.0, 333.0, 500.0, 1000.0]))
def test_a_step_on_a_tick_comes_in_that_tick(tick: int, rate: float) -> None:
    bench = BlockBench(Step, {"at": tick / rate}, rate=rate)
    bench.clock.tick = tick
    bench.step()
    assert bench.get("y").value[0] == 1.0
    bench.clock.tick = tick - 1
    bench.step()
    assert bench.get("y").value[0] == 0.0


def test_a_list_must_have_n_elements() -> None:
    with pytest.raises(ValidationError, match="after has 2 elements, expected n = 3"):
        BlockBench(Step, {"n": 3, "after": [1.0, 2.0]})
