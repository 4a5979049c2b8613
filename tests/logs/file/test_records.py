"""Records stand in the file as they were given to Rerun, and hostile ones are refused."""

import json
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.sources import Constant
from aloft.logs import RecordingError, read
from aloft.logs.file import records
from aloft.logs.file.format import FORMAT, Header
from aloft.logs.file.header import header_of
from aloft.logs.file.reader import scan
from aloft.logs.file.records import MARK, Content, Record, composed, packed_text, records_in
from aloft.logs.recording.output_file import reserve_output
from aloft.logs.recording.record_stream import RecordStream, RerunPipe, as_arrow
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import BlockUse, checked_graph


@pytest.fixture
def header() -> Header:
    return header_of(
        BoundGraph(checked_graph({"c": BlockUse(Constant, {"value": [1.0, 2.0]})}, ticks=10))
    )


def opened(path: Path) -> tuple[RecordStream, object]:
    import rerun as rr

    stream = rr.RecordingStream("aloft", recording_id="a", send_properties=False)
    output = reserve_output(path)
    return RecordStream(stream, output, index=True), output


def test_whatever_a_record_holds_it_stands_in_the_file(tmp_path: Path) -> None:
    """Also what Rerun's compression likes: zeros, texts, the mark itself, and the same once more."""
    rng = np.random.default_rng(0)
    payloads = [bytes(3000), b"again and again " * 500, MARK * 40, rng.bytes(100_000), b"x", b""]
    payloads += [rng.bytes(int(rng.integers(1, 2000))) for _ in range(40)]
    file, output = opened(tmp_path / "a.rrd")
    for number, payload in enumerate(payloads):
        file.put(Record(Content.NOTES, first=number), payload)
    file.close()
    output.publish()
    found = scan(tmp_path / "a.rrd")
    assert found.closed and not found.damage
    kept = found.of(Content.NOTES)
    assert [record.first for record in kept] == list(range(len(payloads)))
    assert [found.payload(record) for record in kept] == payloads
    assert [record.number for record in found.records] == list(range(len(payloads) + 2))


def test_a_record_that_rerun_packs_is_written_again_masked_in_another_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    take, asked = RerunPipe.take, []

    def packed_once(self: RerunPipe) -> bytes:
        data = take(self)
        asked.append(1)
        return data.replace(MARK, bytes(len(MARK))) if len(asked) == 2 else data

    file, output = opened(tmp_path / "a.rrd")
    monkeypatch.setattr(RerunPipe, "take", packed_once)
    file.put(Record(Content.NOTES), b"hello")
    file.close()
    output.publish()
    found = scan(tmp_path / "a.rrd")
    assert found.closed and not found.damage
    (record,) = found.of(Content.NOTES)
    assert record.salt == 1 and found.payload(record) == b"hello"


def test_a_rerun_that_packs_all_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    take = RerunPipe.take
    file, _ = opened(tmp_path / "a.rrd")
    monkeypatch.setattr(RerunPipe, "take", lambda self: zlib.compress(take(self)))
    with pytest.raises(OSError, match="this version of it packs files in another way"):
        file.put(Record(Content.NOTES), b"hello")
    file.abandon()


def test_a_text_unpacks_to_what_it_says_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(records, "MOST_OF_TEXT", 5000)
    data, size = packed_text("a" * 4000)
    path = tmp_path / "a.rrd"
    for whole, text in ((size, None), (size - 1, "not the size"), (6000, "more than are read")):
        _, plain, _ = composed(Record(Content.START, whole=whole), data)
        path.write_bytes(b"RRF2" + plain)
        (record,) = records_in(path.read_bytes())
        found = records.Scan(path, 0, (record,))
        if text is None:
            assert found.text(record) == "a" * 4000
        else:
            with pytest.raises(RecordingError, match=text):
                found.text(record)


def test_records_that_claim_impossible_places_are_damage(tmp_path: Path) -> None:
    """Work is bounded: what surrounds a record is never more than what stands between its neighbours."""
    data = b"RRF2"
    for number in range(50):
        claim = 2**63 if number % 2 else len(data)
        record = Record(Content.NOTES, number, begin=len(data), front=claim, gap=0, gap_crc=1)
        data += composed(record, b"n")[1]
    path = tmp_path / "a.rrd"
    path.write_bytes(data)
    with pytest.raises(RecordingError):
        read(path)


def test_a_file_of_an_older_format_names_the_version_that_reads_it(tmp_path: Path) -> None:
    import rerun as rr

    stream = rr.RecordingStream("aloft", send_properties=False)
    stream.save(tmp_path / "old.rrd")
    header = json.dumps({"format": 6, "versions": {"aloft": "0.9.1"}})
    stream.send_property("aloft", rr.AnyValues(header=header))
    stream.disconnect()
    match = f"old.rrd has format 6, this version of aloft reads {FORMAT}; read it with aloft 0.9.1"
    with pytest.raises(RecordingError, match=match):
        read(tmp_path / "old.rrd")


def test_what_unpacks_to_more_than_the_file_is_refused(tmp_path: Path) -> None:
    import rerun as rr

    stream = rr.RecordingStream("aloft", send_properties=False)
    stream.save(tmp_path / "a.rrd")
    column = rr.DynamicArchetype.columns("aloft", components={"record": as_arrow(bytes(3 << 20))})
    stream.send_columns("rows", [], list(column.partition([3 << 20])))
    stream.disconnect()
    assert (tmp_path / "a.rrd").stat().st_size < 100_000
    with pytest.raises(RecordingError, match="its records are larger than the file"):
        read(tmp_path / "a.rrd")


def test_a_file_without_an_index_is_whole(header: Header, tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.rrd", replace(header, ticks=None), indexed=False)
    rows = np.zeros((10, header.bus.size), np.uint8)
    writer.write_rows(np.arange(10), rows)
    writer.write_outcome({"ticks": 10})
    writer.close()
    indexed = RecordingWriter(tmp_path / "b.rrd", header)
    indexed.write_rows(np.arange(10), rows)
    indexed.write_outcome({"ticks": 10})
    indexed.close()
    assert read(tmp_path / "a.rrd").whole and read(tmp_path / "b.rrd").whole
    assert (tmp_path / "a.rrd").stat().st_size < (tmp_path / "b.rrd").stat().st_size - 10_000


def test_a_file_that_names_no_version_says_the_last_that_wrote_such_files(tmp_path: Path) -> None:
    import rerun as rr

    stream = rr.RecordingStream("aloft", send_properties=False)
    stream.save(tmp_path / "old.rrd")
    header = json.dumps({"format": 5, "versions": {"python": "3.11.7"}})
    stream.send_property("aloft", rr.AnyValues(header=header))
    stream.disconnect()
    with pytest.raises(RecordingError, match=r"format 5, .*; read it with aloft 0\.2\.0 as it was"):
        read(tmp_path / "old.rrd")
