"""Recordings that Rerun's own tools have written again: read as a whole, or refused by name."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.sources import Constant
from aloft.logs import RecordingError, read
from aloft.logs.file.header import header_of
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.sink import Note
from aloft.runtime.running.snapshot import Snapshot
from aloft.runtime.testing.graphs import BlockUse, checked_graph

TICKS = 60


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rewritten") / "a.rrd"
    bound = BoundGraph(checked_graph({"c": BlockUse(Constant, {"value": [1.0, 2.0]})}))
    header = header_of(bound)
    rows = np.zeros((TICKS, header.bus.size), np.uint8)
    rows[:, :8] = np.arange(TICKS, dtype=np.float64)[:, None].view(np.uint8)
    writer = RecordingWriter(path, header)
    for first in range(0, TICKS, 10):
        writer.write_rows(np.arange(first, first + 10), rows[first : first + 10])
    writer.write_keyframe(Snapshot(20, rows[20].tobytes(), bytes(header.state.size)))
    writer.write_notes([Note(0, "life", "running"), Note(30, "life", "stopping")])
    writer.write_outcome({"success": True, "ticks": TICKS})
    writer.close()
    return path


def rewritten(whole: Path, to: Path, *arguments: str) -> Path:
    command = [sys.executable, "-m", "rerun_cli", "rrd", *arguments, str(whole), "-o", str(to)]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    return to


@pytest.mark.long
def test_rerun_finds_nothing_wrong(whole: Path) -> None:
    command = [sys.executable, "-m", "rerun_cli", "rrd", "verify", str(whole)]
    subprocess.run(command, check=True, capture_output=True, timeout=60)


@pytest.mark.long
@pytest.mark.parametrize(
    "how",
    [
        ["optimize"],
        ["merge"],
        ["filter", "--drop-timeline", "t"],
        ["filter", "--drop-timeline", "tick"],
        ["filter", "--drop-entity", "/__properties/aloft"],
    ],
)
def test_what_has_everything_is_read(whole: Path, tmp_path: Path, how: list[str]) -> None:
    run, was = read(rewritten(whole, tmp_path / "b.rrd", *how)), read(whole)
    assert run.scan.rewritten is not None and run.scan.closed and was.scan.rewritten is None
    assert run.rows.tobytes() == was.rows.tobytes() and run.ticks.tolist() == was.ticks.tolist()
    assert run.notes == was.notes and run.outcome == was.outcome
    assert run.keyframes == (20,) and run.snapshot(20) == was.snapshot(20)


@pytest.mark.long
@pytest.mark.parametrize(
    ("dropped", "text"),
    [
        (["--drop-entity", "/header"], "left out the header"),
        (["--drop-entity", "/notes"], "left out 1 records, such as keyframes or notes"),
        (["--drop-entity", "/outcome"], "left out 1 records"),
        (
            ["--drop-entity", "/rows"],
            "left out 60 ticks, as `rerun rrd split` and `filter` do; it has 0",
        ),
    ],
)
def test_what_lacks_something_is_refused_by_name(
    whole: Path, tmp_path: Path, dropped: list[str], text: str
) -> None:
    path = rewritten(whole, tmp_path / "b.rrd", "filter", *dropped)
    with pytest.raises(RecordingError, match=text):
        read(path)


@pytest.mark.long
def test_a_part_of_a_split_is_refused_and_can_be_read(whole: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "rerun_cli", "rrd", "split", "--timeline", "tick", "-n", "2"]
    subprocess.run(
        [*command, str(whole), "-o", str(tmp_path)], check=True, capture_output=True, timeout=60
    )
    refused = 0
    for part in sorted(tmp_path.glob("*.rrd")):
        try:
            read(part)
        except RecordingError as error:
            assert "left out" in str(error)
            refused += 1
        rest = read(part, damaged=True)
        assert rest["c.y.value"][:, 0].tolist() == rest.ticks.tolist()
    assert refused == 2


def test_a_rewritten_file_that_was_cut(whole: Path, tmp_path: Path) -> None:
    path = rewritten(whole, tmp_path / "b.rrd", "optimize")
    path.write_bytes(path.read_bytes()[:9000])
    with pytest.raises(RecordingError, match=r"b\.rrd is not a recording: Rerun cannot read it"):
        read(path)
