"""``blocks.LookupTable``: exact values and its errors."""

import pytest

from aloft.blocks.general.tables import LookupGrid, LookupTable
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


LOOKUP_GRID_TABLE = {
    "axes": [[0.0, 1.0], [0.0, 1.0, 2.0]],
    "values": [0.0, 1.0, 2.0, 10.0, 11.0, 12.0],
}


@pytest.mark.parametrize(
    ("beyond", "u", "expected"),
    [
        ("clamp", [0.5, 1.5], 6.5),
        ("clamp", [2.0, -1.0], 10.0),
        ("extrapolate", [2.0, -1.0], 19.0),
        ("clamp", [1.0, 1.0], 11.0),
    ],
)
def test_lookup_lookup_grid(beyond: str, u: list[float], expected: float) -> None:
    bench = BlockBench(LookupGrid, {**LOOKUP_GRID_TABLE, "beyond": beyond})
    bench.set("u", value=u)
    bench.step()
    assert bench.get("y").value.tolist() == pytest.approx([expected])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": [[0.0, 1.0], [0.0, 2.0, 1.0]]}, r"axes\[1\] does not rise"),
        ({"axes": [[0.0], [0.0, 1.0]]}, r"axes\[0\] has too few points"),
        ({"values": [0.0]}, "values does not fill the grid"),
    ],
)
def test_a_table_must_be_whole_lookup_grid(change: dict[str, list[float]], message: str) -> None:
    with pytest.raises(BlockError, match=message):
        BlockBench(LookupGrid, {**LOOKUP_GRID_TABLE, **change})
