"""``blocks.Relay``: exact values and its error."""

import pytest

from aloft.blocks.general.relay import Relay
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def test_relay_keeps_its_state_between_the_thresholds() -> None:
    bench = BlockBench(
        Relay, {"switch_on": 1.0, "switch_off": 0.0, "on_value": 5.0, "off_value": -5.0}
    )
    values = []
    for u in (0.5, 1.0, 0.5, 0.0, 0.5, 2.0):
        bench.set("u", value=u)
        bench.step()
        assert bool(bench.get("on").value[0]) == (bench.get("y").value[0] > 0)
        values.append(bench.get("y").value[0])
    assert values == [-5, 5, 5, -5, -5, 5]


def test_thresholds_must_not_cross() -> None:
    with pytest.raises(BlockError, match="switch_off is above switch_on"):
        BlockBench(Relay, {"switch_on": 0.0, "switch_off": 1.0})
