"""A finished recording passes Rerun's own check, and so does what is left of it after damage."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.sources import Constant
from aloft.logs import read
from aloft.logs.file.header import header_of
from aloft.logs.file.index import xxhash32
from aloft.logs.file.messages import CLOSING, Content, DamagedError
from aloft.logs.file.repair import repair
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.running.memory import BoundGraph, Snapshot
from aloft.runtime.running.sink import Note
from aloft.runtime.testing.graphs import BlockUse, checked_graph

RERUN = Path(sys.executable).with_name("rerun")
TICKS, BATCH = 60, 10


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("index") / "a.rrd"
    bound = BoundGraph(checked_graph({"c": BlockUse(Constant, {"value": [1.0, 2.0]})}))
    header = header_of(bound)
    rows = np.zeros((TICKS, header.bus.size), np.uint8)
    rows[:, :8] = np.arange(TICKS, dtype=np.float64)[:, None].view(np.uint8)
    writer = RecordingWriter(path, header)
    for first in range(0, TICKS, BATCH):
        writer.write_rows(np.arange(first, first + BATCH), rows[first : first + BATCH])
        writer.draw()
    writer.write_keyframe(Snapshot(20, rows[20].tobytes(), bytes(header.state.size)))
    writer.write_notes([Note(0, "life", "running")])
    writer.write_outcome({"success": True, "ticks": TICKS})
    writer.close()
    return path


def rerun_rrd(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [str(RERUN), "rrd", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def expect_verified(path: Path) -> None:
    done = rerun_rrd("verify", path)
    assert done.returncode == 0, done.stderr
    assert "1 file verified without error" in done.stderr


def test_rerun_verifies_a_finished_recording(whole: Path) -> None:
    expect_verified(whole)
    assert read(whole).whole


def test_rerun_verifies_what_is_left_after_damage(whole: Path, tmp_path: Path) -> None:
    message = read(whole).scan.of(Content.ROWS)[2]
    data = bytearray(whole.read_bytes())
    data[message.place + 300] ^= 4
    path = tmp_path / "a.rrd"
    path.write_bytes(data)
    repair(path)
    expect_verified(path)
    assert read(path).ticks.tolist() == [t for t in range(TICKS) if not 20 <= t < 30]


def test_damage_to_the_index_loses_nothing(whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    end = read(whole).scan.end
    path = tmp_path / "a.rrd"
    for place in (end + 100, len(data) - 20, len(data) - 1):
        path.write_bytes(bytes(data[:place]) + bytes([data[place] ^ 1]) + bytes(data[place + 1 :]))
        with pytest.raises(DamagedError, match=r"a\.rrd is damaged"):
            read(path)
        repair(path)
        assert read(path).whole and path.stat().st_size == end + len(CLOSING)
        assert read(path)["c.y.value"][:, 0].tolist() == list(range(TICKS))


def test_what_rerun_has_made_compact_is_read_as_a_whole(whole: Path, tmp_path: Path) -> None:
    """It puts several chunks into one."""
    path = tmp_path / "compact.rrd"
    done = rerun_rrd("optimize", whole, "-o", path)
    assert done.returncode == 0, done.stderr
    run = read(path)
    assert run.rows.tobytes() == read(whole).rows.tobytes()
    assert run["c.y.value"][:, 0].tolist() == list(range(TICKS))
    assert run.keyframes == (20,) and run.notes == read(whole).notes


@pytest.mark.parametrize(
    ("data", "seed", "expected"),
    [
        (b"", 0, 0x02CC5D05),
        (b"", 0x9E3779B1, 0x36B78AE7),
        (b"a", 0, 0x550D7456),
        (b"abc", 0, 0x32D153FF),
        (b"Nobody inspects the spammish repetition", 0, 0xE2293B2F),
    ],
)
def test_the_hash_has_its_published_values(data: bytes, seed: int, expected: int) -> None:
    assert xxhash32(data, seed) == expected
