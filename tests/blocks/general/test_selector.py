"""``blocks.Selector``: exact values and its error."""

import pytest

from aloft.blocks.general.selector import Selector
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def test_selector() -> None:
    bench = BlockBench(Selector, {"n": 3, "elements": [2, 0, 2, 1]})
    bench.set("u", value=[1.0, 2.0, 3.0])
    bench.step()
    assert bench.get("y").value.tolist() == [3.0, 1.0, 3.0, 2.0]


@pytest.mark.parametrize("element", [-1, 3])
def test_an_element_must_be_there(element: int) -> None:
    with pytest.raises(BlockError, match=f"element {element} is not there"):
        BlockBench(Selector, {"n": 3, "elements": [0, element]})
