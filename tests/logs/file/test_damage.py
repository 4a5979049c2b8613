"""Damaged recordings: every changed byte is found, nothing aborts, and the rest is kept."""

from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

from aloft.blocks.general.sources import Constant
from aloft.logs import RecordingError, read
from aloft.logs.file.header import header_of
from aloft.logs.file.index import FOOTER_END
from aloft.logs.file.messages import (
    CLOSING,
    FILE_HEAD,
    HEAD,
    Content,
    DamagedError,
    _checked,
    table_of,
)
from aloft.logs.file.repair import repair
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.running.memory import BoundGraph, Snapshot
from aloft.runtime.running.sink import Note
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


def test_no_message_is_taken_for_intact_with_any_of_its_bytes_changed(whole: Path) -> None:
    """Every byte of every message, which is what a file is made of but for its first and last bytes."""
    data, scan = whole.read_bytes(), read(whole).scan
    assert FILE_HEAD + sum(message.size for message in scan.messages) == scan.end
    assert scan.closed and data.endswith(FOOTER_END)
    for number, message in enumerate(scan.messages):
        known = crc32(data[:FILE_HEAD]) if number == 0 else 0
        taken = bytearray(data[message.place : message.end])
        for place in range(len(taken)):
            taken[place] ^= 1 << place % 8
            head, body = bytes(taken[: HEAD.size]), bytes(taken[HEAD.size :])
            assert _checked(message.place, head, body, known) is None, (number, place)
            taken[place] ^= 1 << place % 8
        again = _checked(message.place, bytes(taken[: HEAD.size]), bytes(taken[HEAD.size :]), known)
        assert again == message


def test_a_changed_head_of_the_last_message_is_found(whole: Path, tmp_path: Path) -> None:
    """With a greater length it looks like a message that was cut short."""
    last = read(whole).scan.messages[-1]
    places = np.arange(last.place, last.place + HEAD.size)
    expect_found(whole, tmp_path, np.repeat(places, 8), np.tile(np.arange(8), HEAD.size))


def test_a_lost_batch_is_named_and_the_rest_is_kept(whole: Path, tmp_path: Path) -> None:
    message = read(whole).scan.of(Content.ROWS)[2]
    data = bytearray(whole.read_bytes())
    data[message.place + 300] ^= 4
    path = tmp_path / "a.rrd"
    path.write_bytes(data)
    match = rf"a\.rrd is damaged: bytes {message.place} to {message.end - 1}; of the ticks, those "
    with pytest.raises(
        DamagedError, match=match + "from tick 20 to tick 29 may be lost.*log repair"
    ):
        read(path)
    run = read(path, damaged=True)
    kept = [tick for tick in range(60) if not 20 <= tick < 30]
    assert run.ticks.tolist() == kept
    assert run.missing_ticks == 10
    done = repair(path)
    assert len(done.damage) == 1 and abs(done.removed - message.size) < 1000
    mended = read(path)
    assert mended.whole and mended.ticks.tolist() == kept
    assert mended["c.y.value"][:, 0].tolist() == kept
    assert mended.keyframes == (20,)


def test_damage_to_a_picture_loses_no_tick(whole: Path, tmp_path: Path) -> None:
    pictures = [m for m in read(whole).scan.messages if m.content is Content.PICTURE]
    message = next(m for m in pictures if m.first == 20)
    data = bytearray(whole.read_bytes())
    data[message.place] ^= 255  # not even its length is known
    path = tmp_path / "a.rrd"
    path.write_bytes(data)
    with pytest.raises(DamagedError, match="no tick is lost"):
        read(path)
    repair(path)
    assert read(path).ticks.tolist() == list(range(60))


def test_a_missing_message_is_noticed(whole: Path, tmp_path: Path) -> None:
    message = read(whole).scan.of(Content.ROWS)[1]
    data = whole.read_bytes()
    path = tmp_path / "a.rrd"
    path.write_bytes(data[: message.place] + data[message.end :])
    with pytest.raises(DamagedError, match="messages are missing at byte"):
        read(path)


def test_any_prefix_is_useful(whole: Path, tmp_path: Path) -> None:
    data, scan = whole.read_bytes(), read(whole).scan
    path = tmp_path / "a.rrd"
    begun = scan.of(Content.START)[-1].end
    # Sixteen zeros close a file, and stand inside of messages too.
    before_a_close = range(begun + len(CLOSING), len(data))
    seem_closed = [size for size in before_a_close if data.endswith(CLOSING, 0, size)]
    assert len(seem_closed) > 10
    for size in [*range(begun, len(data), 997), *seem_closed]:
        path.write_bytes(data[:size])
        run = read(path)
        there = [m.last + 1 for m in scan.of(Content.ROWS) if m.end <= size]
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

    from aloft.logs.recording.writer import _bytes

    data = bytes(range(256)) * 16384
    began = time.process_time()
    assert _bytes(data).to_numpy().tobytes() == data
    assert time.process_time() - began < 0.5


@pytest.mark.parametrize("body", [b"\x80" * 1_000_000, b"\x08" + b"\xff" * 30, b"\x12\xff\x01a"])
def test_numbers_without_an_end_are_no_table(body: bytes) -> None:
    with pytest.raises(ValueError, match="a message holds no table"):
        table_of(body)
