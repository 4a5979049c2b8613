"""``blocks.Mux``: exact values."""

import pytest

from aloft.blocks.general.wires import Demux, Mux, Selector
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def test_mux() -> None:
    bench = BlockBench(Mux, {"n_a": 2, "n_b": 1})
    bench.set("a", value=[1.0, 2.0])
    bench.set("b", value=[3.0])
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, 2.0, 3.0]


def test_demux() -> None:
    bench = BlockBench(Demux, {"n_a": 1, "n_b": 2})
    bench.set("u", value=[1.0, 2.0, 3.0])
    bench.step()
    assert bench.get("a").value.tolist() == [1.0]
    assert bench.get("b").value.tolist() == [2.0, 3.0]


def test_selector() -> None:
    bench = BlockBench(Selector, {"n": 3, "elements": [2, 0, 2, 1]})
    bench.set("u", value=[1.0, 2.0, 3.0])
    bench.step()
    assert bench.get("y").value.tolist() == [3.0, 1.0, 3.0, 2.0]


@pytest.mark.parametrize("element", [-1, 3])
def test_an_element_must_be_there(element: int) -> None:
    with pytest.raises(BlockError, match=f"element {element} is not there"):
        BlockBench(Selector, {"n": 3, "elements": [0, element]})
