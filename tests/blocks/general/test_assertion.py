"""Assertions end a run that does not keep them, or note it."""

import pytest

from aloft.blocks.general.assertion import Assertion
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def run(action: str) -> BlockBench[Assertion]:
    bench = BlockBench(Assertion, {"n": 2, "lower": [-1.0, 0.0], "action": action}, rate=10.0)
    for value in ([0.0, 0.0], [0.0, -0.5], [-2.0, 0.0], [1.0, 1.0]):
        bench.set("u", value=value)
        bench.step()
        assert bool(bench.get("ok").value) == (min(value) >= 0.0)
    return bench


def test_the_first_violation_is_the_reason() -> None:
    reason = "block: element 1 was -0.5 at 0.1 s, outside [0, inf]"
    bench = run("stop")
    assert bench.stop_reason == reason
    assert bench.block.metrics() == {"success": False, "reason": reason, "violations": 2}
    bench = run("mark")
    assert bench.stop_reason is None
    assert bench.block.metrics()["violations"] == 2


def test_kept_bounds_are_success() -> None:
    bench = BlockBench(Assertion, {"upper": 1.0})
    bench.step()
    assert bench.block.metrics() == {"success": True, "violations": 0}


def test_it_needs_a_bound() -> None:
    with pytest.raises(BlockError, match="it has no bound"):
        BlockBench(Assertion, {})
