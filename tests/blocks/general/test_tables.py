"""``blocks.LookupTable``: exact values and its errors."""

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.blocks.general.tables import LookupGrid, LookupTable, TablePlayback
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


ROWS = [[0.1, 1.0], [0.3, 3.0], [0.5, -1.0]]


def run(folder: Path, ticks: int = 8, **params: object) -> list[float]:
    bench = BlockBench(TablePlayback, {"columns": ["x"], **params}, rate=10.0, folder=folder)
    found = []
    for _ in range(ticks):
        bench.step()
        found.append(float(bench.get("y").value[0]))
    return found


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ({}, [1, 1, 2, 3, 1, -1, -1, -1]),
        ({"between": "hold"}, [1, 1, 1, 3, 3, -1, -1, -1]),
    ],
)
def test_the_same_from_everywhere(
    tmp_path: Path, params: dict[str, object], expected: list[float]
) -> None:
    (tmp_path / "t.csv").write_text("time, x\n" + "\n".join(f"{t},{x}" for t, x in ROWS))
    times, x = np.array(ROWS).T
    np.savez(tmp_path / "t.npz", time=times, x=x)
    for source in ({"file": "t.csv"}, {"file": "t.npz"}, {"rows": ROWS}):
        assert run(tmp_path, **source, **params) == pytest.approx(expected)


def test_it_can_begin_again(tmp_path: Path) -> None:
    rows = [[0.0, 0.0], [0.25, 2.5]]
    expected = [0.0, 1.0, 2.0, 0.5, 1.5, 0.0, 1.0, 2.0]
    assert run(tmp_path, rows=rows, repeat=True) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot read t.csv: No such file"),
        ("time,y\n0,1\n1,2\n", "the table has no column 'x'; it has time, y"),
        ("time,x\n0,1\n0,2\n", "the times in column 'time' do not rise"),
        ("time,x\n0,1\n1\n", "cannot read t.csv as a table"),
        ("time,x\n0,nan\n1,2\n", "values that are not finite"),
        ("", "cannot read t.csv as a table"),
    ],
)
def test_a_table_must_be_whole_table_playback(
    tmp_path: Path, text: str | None, message: str
) -> None:
    if text is not None:
        (tmp_path / "t.csv").write_text(text)
    with pytest.raises(BlockError, match=message):
        run(tmp_path, file="t.csv")


def test_there_is_one_source(tmp_path: Path) -> None:
    with pytest.raises(BlockError, match="give either a file or rows"):
        run(tmp_path)


def test_a_graph_with_a_table_runs_to_its_end() -> None:
    rows = [[0.0, 1.0], [1.0, 3.0]]
    blocks = {"played": {"use": "blocks.TablePlayback", "with": {"columns": ["x"], "rows": rows}}}
    result = aloft.load({"rate": "10 Hz", "blocks": blocks}).run(0.5)
    assert result.signal("played.y.value")[:, 0].tolist() == pytest.approx(
        [1.0, 1.2, 1.4, 1.6, 1.8]
    )
