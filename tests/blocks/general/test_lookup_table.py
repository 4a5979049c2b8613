"""``blocks.LookupTable``: exact values and its errors."""

import pytest

from aloft.blocks.general.lookup_table import LookupTable
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

TABLE = {"points": [0.0, 1.0, 3.0], "values": [5.0, 7.0, 3.0]}


@pytest.mark.parametrize(
    ("beyond", "expected"), [("clamp", [5.0, 6.0, 5.0, 3.0]), ("extrapolate", [3.0, 6.0, 5.0, 1.0])]
)
def test_lookup(beyond: str, expected: list[float]) -> None:
    bench = BlockBench(LookupTable, {**TABLE, "n": 4, "beyond": beyond})
    bench.set("u", value=[-1.0, 0.5, 2.0, 4.0])
    bench.step()
    assert bench.get("y").value.tolist() == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": [0.0, 1.0, 1.0]}, "points does not rise"),
        ({"values": [0.0, 1.0]}, "there must be as many values as points"),
    ],
)
def test_a_table_must_be_whole(change: dict[str, list[float]], message: str) -> None:
    with pytest.raises(BlockError, match=message):
        BlockBench(LookupTable, {**TABLE, **change})
