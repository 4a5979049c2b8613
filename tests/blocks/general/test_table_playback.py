"""``blocks.TablePlayback``: rules between rows, seams in whole ticks, times of day, quaternions, mistakes."""

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft import LoadError
from aloft.blocks.general.table_playback import TablePlayback
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

ROWS = [[0.1, 1.0], [0.3, 3.0], [0.5, -1.0]]


def run(folder: Path, ticks: int = 8, rate: float = 10.0, **params: object) -> list[float]:
    bench = BlockBench(TablePlayback, {"columns": ["x"], **params}, rate=rate, folder=folder)
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
    (tmp_path / "t.csv").write_text("\ufefftime, x\n\n" + "\n".join(f"{t},{x}" for t, x in ROWS))
    times, x = np.array(ROWS).T
    np.savez(tmp_path / "t.npz", time=times, x=x)
    for source in ({"file": "t.csv"}, {"file": "t.npz"}, {"rows": ROWS}):
        assert run(tmp_path, **source, **params) == pytest.approx(expected)


def test_it_can_begin_again(tmp_path: Path) -> None:
    rows = [[0.0, 0.0], [0.25, 2.5]]
    expected = [0.0, 1.0, 2.0, 0.5, 1.5, 0.0, 1.0, 2.0]
    assert run(tmp_path, rows=rows, repeat=True) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("rate", [300.0, 700.0, 1000.0, 2000.0])
@pytest.mark.parametrize("length", [3, 21, 300])
def test_the_last_row_never_shows_where_it_begins_again(
    tmp_path: Path, rate: float, length: int
) -> None:
    rows = [[0.0, 0.0], [length / rate, 1.0]]
    found = np.array(run(tmp_path, 2000, rate, rows=rows, repeat=True))
    assert np.abs(found - np.arange(2000) % length / length).max() < 1e-12
    held = run(tmp_path, 2000, rate, rows=rows, repeat=True, between="hold")
    assert set(held) == {0.0}


TIMES_OF_DAY = "time,x\n1700000000.0,1\n1700000000.1,3\n1700000000.2,5\n"


def test_times_of_day_are_a_mistake_or_count_from_the_first(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(TIMES_OF_DAY)
    block = {"use": "blocks.TablePlayback", "with": {"columns": ["x"], "file": "t.csv"}}
    graph = {"rate": "10 Hz", "duration": "0.3 s", "blocks": {"t": block}}
    (tmp_path / "g.yaml").write_text(str(graph))
    with pytest.raises(LoadError) as caught:
        aloft.load(tmp_path / "g.yaml")
    text = str(caught.value)
    assert "the first time of the table is 1700000000 s, and a run ends after 0.3 s" in text
    assert "line 2: time = 1700000000" in text and "from_first: true" in text
    loaded = aloft.load(tmp_path / "g.yaml", {"t.from_first": True})
    assert loaded.run().signal("t.y.value")[:, 0].tolist() == pytest.approx([1.0, 3.0, 5.0])
    assert run(tmp_path, 3, file="t.csv", from_first=True, between="hold") == [1.0, 3.0, 5.0]


def test_times_of_day_are_a_mistake_in_a_run_without_an_end(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(TIMES_OF_DAY)
    with pytest.raises(BlockError, match="the first time of the table is 1700000000 s: only its"):
        run(tmp_path, file="t.csv")


def quaternion(columns: list[str], rows: list[list[float]], ticks: int = 21) -> np.ndarray:
    bench = BlockBench(TablePlayback, {"columns": columns, "rows": rows}, rate=100.0)
    found = []
    for _ in range(ticks):
        bench.step()
        found.append(bench.get("y").value.copy())
    return np.array(found)


def about_z(degrees: float, sign: float = 1.0) -> list[float]:
    half = np.radians(degrees) / 2.0
    return [0.0, 0.0, sign * float(np.sin(half)), sign * float(np.cos(half))]


@pytest.mark.parametrize("names", [["x", "y", "z", "w"], ["qx", "qy", "qz", "qw"]])
def test_quaternions_turn_evenly_also_where_their_sign_flips(names: list[str]) -> None:
    rows = [
        [0.0, 7.0, *about_z(80.0)],
        [0.1, 8.0, *about_z(90.0)],
        [0.2, 9.0, *about_z(110.0, -1.0)],
    ]
    found = quaternion(["height", *names], rows)
    angle = 2.0 * np.degrees(np.arctan2(found[:, 3], found[:, 4]))
    assert angle == pytest.approx(np.r_[np.arange(80.0, 90.0), np.arange(90.0, 111.0, 2.0)])
    assert np.sum(found[:, 1:] ** 2, axis=1) == pytest.approx(1.0)
    assert found[5, 0] == pytest.approx(7.5)


@pytest.mark.parametrize(
    ("names", "scale"), [(["a", "b", "c", "d"], 1.0), (["x", "y", "z", "w"], 2.0)]
)
def test_other_numbers_go_straight(names: list[str], scale: float) -> None:
    ends = np.array([about_z(80.0), about_z(110.0, -1.0)]) * scale
    found = quaternion(names, [[0.0, *ends[0]], [0.2, *ends[1]]])
    assert found[10] == pytest.approx(ends.mean(axis=0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "cannot read t.csv: No such file"),
        ("time,y\n0,1\n1,2\n", "the table has no column 'x'; it has time, y"),
        ("time,x\n0,1\n\n0,2\n", "line 4: the times in column 'time' do not rise: 0 follows 0"),
        ("time,x\n0,1\n1\n", "table: line 3 has 1 values, and the first line 2 names"),
        ("time,x\n0,1\n1,one\n", "table: line 3: x is 'one', which is no number"),
        ("time,x\n0,nan\n1,2\n", "line 2: x is nan, which is not finite"),
        ("", "cannot read t.csv as a table: it is empty"),
    ],
)
def test_a_table_must_be_whole(tmp_path: Path, text: str | None, message: str) -> None:
    if text is not None:
        (tmp_path / "t.csv").write_text(text)
    with pytest.raises(BlockError, match=message):
        run(tmp_path, file="t.csv")


def test_rows_must_be_whole(tmp_path: Path) -> None:
    with pytest.raises(BlockError, match=r"rows\[1\] has 1 numbers, expected the time and 1"):
        run(tmp_path, rows=[[0.0, 1.0], [1.0]])
    with pytest.raises(BlockError, match=r"rows\[1\]: the times .* do not rise: 1 follows 2"):
        run(tmp_path, rows=[[2.0, 1.0], [1.0, 0.0]])


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


@pytest.mark.parametrize(
    ("duration", "from_first", "said"), [(2.0, False, 1), (60.0, False, 0), (2.0, True, 0)]
)
def test_a_run_that_ends_before_the_first_time_is_told_so(
    duration: float, from_first: bool, said: int
) -> None:
    text = "rate: 10 Hz\nblocks:\n  t: {use: blocks.TablePlayback, with: {columns: [x], rows: [[52, 1], [53, 2]]}}\n"
    result = aloft.load(text, {"t.from_first": from_first}).run(duration=duration)
    told = [w for w in result.block_warnings if "only its first row was played" in w]
    assert len(told) == said
    if said:
        assert told == [
            (
                "t: the first time of the table is 52 s, and the run ended after 2 s: only its first row was played; "
                "for times of day: from_first: true"
            )
        ]
