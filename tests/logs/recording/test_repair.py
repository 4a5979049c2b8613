"""A recording cut anywhere is mended, and what stood whole before the cut is all there."""

import resource
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.sources import Constant
from aloft.logs import RecordedRun, RecordingError, read
from aloft.logs.file.header import make_header
from aloft.logs.recording.output_file import unfinished_name
from aloft.logs.recording.repair import RepairError, repair
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import BlockUse, checked_graph

BATCHES, BATCH = 10, 20


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[int]]:
    """A recording of batches, and the size of the file after each flush."""
    path = tmp_path_factory.mktemp("repair") / "a.rrd"
    bound = BoundGraph(checked_graph({"c": BlockUse(Constant, {"value": [1.0, 2.0]})}))
    size = bound.memory.bus.layout.size
    header = make_header(bound.graph, bound.memory.bus.layout, bytes(size))
    writer = RecordingWriter(path, header)
    sizes = []
    for batch in range(BATCHES):
        ticks = np.arange(batch * BATCH, (batch + 1) * BATCH)
        rows = np.zeros((BATCH, size), np.uint8)
        rows[:, :8] = ticks.astype(np.float64)[:, None].view(np.uint8)
        writer.write_rows(ticks, rows)
        sizes.append(unfinished_name(path).stat().st_size)
    writer.write_outcome({"run_hash": "", "reason": "over"})
    writer.close()
    return path, sizes


def check(run: RecordedRun, least: int) -> None:
    assert len(run.ticks) >= least
    assert run.ticks.tolist() == list(range(len(run.ticks)))
    assert run["c.y.value"][:, 0].tolist() == run.ticks.tolist()


@pytest.mark.parametrize("batch", [2, 9])
@pytest.mark.parametrize("beyond", [0, 1, 15, 16, 17, 300])
def test_all_that_was_flushed_survives_a_cut(
    written: tuple[Path, list[int]], tmp_path: Path, batch: int, beyond: int
) -> None:
    path, sizes = written
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(path.read_bytes()[: sizes[batch] + beyond])
    before = read(cut)  # a record that is cut short is none
    check(before, (batch + 1) * BATCH)
    assert not before.whole
    done = repair(cut)
    assert not done.closed and not done.damage
    assert done.size == cut.stat().st_size
    run = read(cut)
    check(run, (batch + 1) * BATCH)
    assert run.outcome is None
    again = repair(cut)
    assert again.was_whole and again.size == done.size


def test_a_whole_file_stays_as_it_is(written: tuple[Path, list[int]]) -> None:
    path, _ = written
    before = path.read_bytes()
    done = repair(path)
    assert done.closed and done.size == done.size_before
    assert path.read_bytes() == before
    check(read(path), BATCHES * BATCH)


def test_what_cannot_be_mended(tmp_path: Path) -> None:
    (tmp_path / "a.rrd").write_bytes(b"hello world, hello world")
    with pytest.raises(RecordingError, match=r"a.rrd is not a recording: it does not begin like"):
        repair(tmp_path / "a.rrd")
    (tmp_path / "a.rrd").write_bytes(b"RRF2" + bytes(8) + b"\1" + bytes(7) + b"\377" + bytes(20))
    with pytest.raises(RecordingError, match=r"Rerun cannot read it|was cut off before"):
        repair(tmp_path / "a.rrd")
    with pytest.raises(FileNotFoundError):
        repair(tmp_path / "none.rrd")


def test_a_full_disk_leaves_the_file_as_it_is(
    written: tuple[Path, list[int]], tmp_path: Path
) -> None:
    path, sizes = written
    cut = tmp_path / "cut.rrd"
    data = path.read_bytes()[: sizes[-1]]
    cut.write_bytes(data)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(data) // 2, limits[1]))
    try:
        with pytest.raises(OSError, match=r"cut\.rrd cannot be written any further"):
            repair(cut)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert cut.read_bytes() == data and list(tmp_path.iterdir()) == [cut]
    assert len(read(cut).ticks) == len(sizes) * BATCH


def test_without_a_header_there_is_nothing_to_save(
    written: tuple[Path, list[int]], tmp_path: Path
) -> None:
    path, _ = written
    cut = tmp_path / "cut.rrd"
    data = bytearray(path.read_bytes())
    data[read(path).scan.records[0].place + 40] ^= 1
    cut.write_bytes(data)
    with pytest.raises(RepairError, match="holds no header that is intact"):
        repair(cut)
