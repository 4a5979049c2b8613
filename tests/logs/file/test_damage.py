"""Damaged recordings: every changed byte is found, nothing aborts, and the rest is kept."""

from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.sources import Constant
from aloft.logs import RecordingError, read
from aloft.logs.file.header import header_of
from aloft.logs.file.records import Content, DamagedError
from aloft.logs.recording.repair import repair
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.sink import Note
from aloft.runtime.running.snapshot import Snapshot
from aloft.runtime.testing.graphs import BlockUse, checked_graph

BATCHES, BATCH = 6, 10


def written_rows(size: int) -> np.ndarray:
    rows = np.zeros((BATCHES * BATCH, size), np.uint8)
    rows[:, :8] = np.arange(len(rows), dtype=np.float64)[:, None].view(np.uint8)
    return rows


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("damage") / "a.rrd"
    bound = BoundGraph(checked_graph({"c": BlockUse(Constant, {"value": [1.0, 2.0]})}))
    header = header_of(bound)
    rows = written_rows(header.bus.size)
    writer = RecordingWriter(path, header)
    for first in range(0, len(rows), BATCH):
        writer.write_rows(np.arange(first, first + BATCH), rows[first : first + BATCH])
        writer.draw()
    writer.write_keyframe(Snapshot(20, rows[20].tobytes(), bytes(header.state.size)))
    writer.write_notes([Note(0, "life", "running")])
    writer.write_outcome({"success": True, "ticks": len(rows)})
    writer.close()
    assert read(path).whole
    return path


def expect_found(whole: Path, folder: Path, places: np.ndarray, bits: np.ndarray) -> None:
    """Each flip is refused, and what is read in spite of it is what was written."""
    data = whole.read_bytes()
    rows = written_rows(read(whole).header.bus.size)
    path = folder / "a.rrd"
    for place, bit in zip(places.tolist(), bits.tolist(), strict=True):
        flipped = bytearray(data)
        flipped[place] ^= 1 << bit
        path.write_bytes(flipped)
        with pytest.raises(RecordingError):
            read(path)
        try:
            rest = read(path, damaged=True)
        except RecordingError:
            continue
        assert not rest.whole, place
        assert rest.rows.tobytes() == rows[rest.ticks].tobytes(), place


@pytest.mark.long
def test_a_changed_byte_anywhere_is_found(whole: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    size = whole.stat().st_size
    places = np.concatenate(
        [np.arange(140), rng.integers(0, size, 250), np.arange(size - 80, size)]
    )
    expect_found(whole, tmp_path, places, rng.integers(0, 8, len(places)))


def test_every_byte_of_the_heads_and_of_the_end_is_looked_at(whole: Path, tmp_path: Path) -> None:
    """Of all others, ``test_a_changed_byte_anywhere_is_found`` takes some."""
    scan = read(whole).scan
    heads = [np.arange(record.place, record.place + 70) for record in scan.of(Content.ROWS)[:1]]
    first, second = scan.of(Content.END)
    ends = [np.arange(first.place - 5, second.end + 10)[::5], np.arange(scan.size - 20, scan.size)]
    places = np.concatenate([*heads, *ends])
    expect_found(whole, tmp_path, places, places % 8)


def test_a_lost_batch_is_named_and_the_rest_is_kept(whole: Path, tmp_path: Path) -> None:
    before, record, after = read(whole).scan.of(Content.ROWS)[1:4]
    data = bytearray(whole.read_bytes())
    data[record.place + 100] ^= 4
    path = tmp_path / "a.rrd"
    path.write_bytes(data)
    match = rf"a\.rrd is damaged: bytes {before.end} to {after.place - 1}; of the ticks, those "
    with pytest.raises(
        DamagedError, match=match + "from tick 20 to tick 29 may be lost.*log repair"
    ):
        read(path)
    run = read(path, damaged=True)
    kept = [tick for tick in range(60) if not 20 <= tick < 30]
    assert run.ticks.tolist() == kept
    assert run.missing_ticks == 10
    done = repair(path)
    assert len(done.damage) == 1
    mended = read(path)
    assert mended.whole and mended.ticks.tolist() == kept
    assert mended["c.y.value"][:, 0].tolist() == kept
    assert mended.keyframes == (20,)


def test_damage_to_a_picture_loses_no_tick(whole: Path, tmp_path: Path) -> None:
    record = read(whole).scan.of(Content.ROWS)[2]
    data = bytearray(whole.read_bytes())
    data[record.end + 600] ^= 255
    path = tmp_path / "a.rrd"
    path.write_bytes(data)
    with pytest.raises(DamagedError, match="no tick is lost"):
        read(path)
    repair(path)
    assert read(path).ticks.tolist() == list(range(60))


def test_a_missing_message_is_noticed(whole: Path, tmp_path: Path) -> None:
    """Also a whole chunk, with nothing changed around it."""
    before, record, after = read(whole).scan.of(Content.ROWS)[1:4]
    data = whole.read_bytes()
    path = tmp_path / "a.rrd"
    begin, end = before.end + record.gap, record.end + after.gap
    for some in (data[:begin] + data[end:], data[: record.place] + data[record.end :]):
        path.write_bytes(some)
        with pytest.raises(
            RecordingError, match=r"tick 20 to tick 29 may be lost|left out 10 ticks"
        ):
            read(path)


def test_exchanged_chunks_are_noticed(whole: Path, tmp_path: Path) -> None:
    before, first, second, after = read(whole).scan.of(Content.ROWS)[:4]
    data = whole.read_bytes()
    places = before.end + first.gap, first.end + second.gap, second.end + after.gap
    one, two = data[places[0] : places[1]], data[places[1] : places[2]]
    path = tmp_path / "a.rrd"
    path.write_bytes(data[: places[0]] + two + one + data[places[2] :])
    with pytest.raises(DamagedError, match="no tick is lost"):
        read(path)
    rest = read(path, damaged=True)
    assert rest.rows.tobytes() == written_rows(rest.rows.shape[1]).tobytes()


def test_any_prefix_is_useful(whole: Path, tmp_path: Path) -> None:
    data, scan = whole.read_bytes(), read(whole).scan
    path = tmp_path / "a.rrd"
    begun = scan.of(Content.START)[-1].end
    for size in [*range(begun, len(data), 997), *range(len(data) - 3000, len(data), 151)]:
        path.write_bytes(data[:size])
        run = read(path)
        there = [record.last + 1 for record in scan.of(Content.ROWS) if record.end <= size]
        assert len(run.ticks) == max(there, default=0), size
        assert not run.whole


def test_a_window_reads_only_what_it_needs(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from aloft.logs.file import packed_rows

    run = read(whole)
    _ = run.ticks
    asked: list[int] = []
    unpack = packed_rows.unpack
    monkeypatch.setattr(packed_rows, "unpack", lambda data: asked.append(1) or unpack(data))
    ticks, rows = run.window(25, 35)
    assert ticks.tolist() == list(range(25, 35))
    assert rows.tobytes() == written_rows(rows.shape[1])[25:35].tobytes()
    assert len(asked) == 2
    assert len(run.window(60, 70)[0]) == 0


def test_packed_rows_are_handed_to_rerun_without_an_object_a_byte() -> None:
    """A batch of half a second must take far less processor time than that; it once took four times as
    much."""
    import time

    from aloft.logs.recording.record_stream import as_arrow

    data = bytes(range(256)) * 16384
    began = time.process_time()
    assert as_arrow(data).to_numpy().tobytes() == data
    assert time.process_time() - began < 0.5
