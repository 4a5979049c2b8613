"""``blocks.Gain``: exact values."""

import pytest
from pydantic import ValidationError

from aloft.blocks.general.gain import Gain
from aloft.runtime.testing import BlockBench


def test_gain_multiplies() -> None:
    bench = BlockBench(Gain, {"n": 2, "gain": -3.0})
    bench.set("u", value=[1.0, 0.5])
    bench.step()
    assert bench.get("y").value.tolist() == [-3.0, -1.5]


def test_gain_multiplies_each_element_by_its_own() -> None:
    bench = BlockBench(Gain, {"n": 2, "gain": [2.0, 4.0]})
    bench.set("u", value=[1.0, 0.5])
    bench.step()
    assert bench.get("y").value.tolist() == [2.0, 2.0]


def test_a_list_must_have_n_gains() -> None:
    with pytest.raises(ValidationError, match="gain has 2 elements, expected n = 3"):
        BlockBench(Gain, {"n": 3, "gain": [2.0, 4.0]})
