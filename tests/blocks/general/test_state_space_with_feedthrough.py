"""``blocks.StateSpaceWithFeedthrough``: exact values and its error."""

import pytest

from aloft.blocks.general.state_space_with_feedthrough import StateSpaceWithFeedthrough
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

PARAMS = {"a": [[0.5]], "b": [[1.0, 2.0]], "c": [[2.0]], "d": [[0.0, 10.0]]}


def test_outputs_follow_from_inputs_of_the_same_tick() -> None:
    bench = BlockBench(StateSpaceWithFeedthrough, PARAMS)
    found = []
    for u in ([1.0, 1.0], [0.0, 0.0], [0.0, 1.0]):
        bench.set("u", value=u)
        bench.step()
        found.append(bench.get("y").value.tolist())
    assert found == [[10.0], [6.0], [13.0]]


def test_d_must_fit() -> None:
    with pytest.raises(BlockError, match="d does not fit b and c"):
        BlockBench(StateSpaceWithFeedthrough, {**PARAMS, "d": [[1.0]]})
