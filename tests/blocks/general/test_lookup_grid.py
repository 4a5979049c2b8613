"""``blocks.LookupGrid``: exact values and its errors."""

import pytest

from aloft.blocks.general.lookup_grid import LookupGrid
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

TABLE = {"axes": [[0.0, 1.0], [0.0, 1.0, 2.0]], "values": [0.0, 1.0, 2.0, 10.0, 11.0, 12.0]}


@pytest.mark.parametrize(
    ("beyond", "u", "expected"),
    [
        ("clamp", [0.5, 1.5], 6.5),
        ("clamp", [2.0, -1.0], 10.0),
        ("extrapolate", [2.0, -1.0], 19.0),
        ("clamp", [1.0, 1.0], 11.0),
    ],
)
def test_lookup(beyond: str, u: list[float], expected: float) -> None:
    bench = BlockBench(LookupGrid, {**TABLE, "beyond": beyond})
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
def test_a_table_must_be_whole(change: dict[str, list[float]], message: str) -> None:
    with pytest.raises(BlockError, match=message):
        BlockBench(LookupGrid, {**TABLE, **change})
