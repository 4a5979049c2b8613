"""``blocks.UnitDelay``: exact values."""

import pytest
from pydantic import ValidationError

from aloft.blocks.general.unit_delay import UnitDelay
from aloft.runtime.testing import BlockBench


def test_unit_delay_starts_from_its_initial_value() -> None:
    bench = BlockBench(UnitDelay, {"n": 2, "initial": [3.0, 4.0]})
    outputs = []
    for value in (1.0, 2.0, 5.0):
        bench.set("u", value=value)
        bench.step()
        outputs.append(bench.get("y").value.tolist())
    assert outputs == [[3.0, 4.0], [1.0, 1.0], [2.0, 2.0]]


def test_an_initial_value_must_have_n_elements() -> None:
    with pytest.raises(ValidationError, match="initial has 2 elements, expected n = 3"):
        BlockBench(UnitDelay, {"n": 3, "initial": [1.0, 2.0]})
