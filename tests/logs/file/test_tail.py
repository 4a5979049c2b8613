"""The tail of a recording: read with it, cut anywhere, taken into it."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.blocks.general.constant import Constant
from aloft.logs import read
from aloft.logs.file.header import header_of
from aloft.logs.file.tail import TailWriter, read_tail, record_type, tail_of
from aloft.logs.recording.tail_repair import take_in_tail
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import Use, checked_graph


def records(first: int, last: int, size: int = 64) -> np.ndarray[Any, Any]:
    found = np.zeros(last - first, record_type(size))
    found["tick"] = np.arange(first, last)
    found["row"][:, :8] = np.arange(first, last, dtype=np.float64)[:, None].view(np.uint8)
    return found


def test_what_is_appended_is_read_back_and_forgotten_when_told(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    assert len(read_tail(path, 64)[0]) == 0
    tail = TailWriter(path)
    tail.append(records(0, 3))
    tail.append(records(3, 5))
    assert tail.count == 5
    ticks, rows = read_tail(path, 64)
    assert ticks.tolist() == [0, 1, 2, 3, 4]
    assert rows.tobytes() == records(0, 5)["row"].tobytes()
    tail_of(path).write_bytes(tail_of(path).read_bytes()[:-1])  # a tick that is cut is none
    assert read_tail(path, 64)[0].tolist() == [0, 1, 2, 3]
    tail.clear()
    tail.append(records(7, 8))
    assert read_tail(path, 64)[0].tolist() == [7]
    tail.remove()
    assert not tail_of(path).exists()


class FullDisk:
    """A file that takes ``room`` bytes."""

    def __init__(self, file: Any, room: int) -> None:
        self._file, self._room = file, room

    def write(self, data: memoryview) -> int:
        if not self._room:
            raise OSError(errno.ENOSPC, "No space left on device")
        count = self._file.write(data[: self._room])
        self._room -= count
        return int(count)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def test_a_full_disk_keeps_whole_ticks_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    tail = TailWriter(path)
    tail._file = FullDisk(tail._file, 250)  # type: ignore[assignment]
    match = r"a.rrd.tail cannot be written any further \(No space left on device\)"
    with pytest.raises(OSError, match=match):
        tail.append(records(0, 5))
    assert tail.count == 3 and tail_of(path).stat().st_size == 3 * 72
    assert read_tail(path, 64)[0].tolist() == [0, 1, 2]


@pytest.mark.parametrize("overlap", [0, 4])
def test_a_recording_that_was_cut_off_is_read_with_its_tail(tmp_path: Path, overlap: int) -> None:
    path = tmp_path / "a.rrd"
    bound = BoundGraph(checked_graph({"c": Use(Constant, {"value": [1.0]})}))
    size = bound.memory.bus.layout.size
    data = records(0, 30, size)
    writer = RecordingWriter(path, header_of(bound))
    writer.write_rows(data["tick"][:20].astype(np.int64), data["row"][:20].copy())
    writer.flush()
    before = path.read_bytes()  # as a killed process leaves it: without an end
    writer.close()
    path.write_bytes(before)
    tail = TailWriter(path)
    tail.append(data[20 - overlap :])

    def check() -> None:
        run = read(path)
        assert run.ticks.tolist() == list(range(30))
        assert run["c.y.value"][:, 0].tolist() == list(range(30))
        assert run.rows[:, :8].tobytes() == data["row"][:, :8].tobytes()

    check()
    assert take_in_tail(path) == 10
    assert not tail_of(path).exists() and not (tmp_path / "a.rrd.piece").exists()
    check()
    assert len(read(path).written_ticks()) == 30
    assert take_in_tail(path) == 0


def test_the_tail_of_another_run_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    bound = BoundGraph(checked_graph({"c": Use(Constant, {"value": [1.0]})}))
    data = records(0, 10, bound.memory.bus.layout.size)
    TailWriter(path).append(data)
    writer = RecordingWriter(path, header_of(bound))
    writer.write_rows(data["tick"][:5].astype(np.int64), data["row"][:5].copy())
    writer.write_outcome({"success": True})
    writer.close()
    assert read(path).ticks.tolist() == [0, 1, 2, 3, 4]
    assert take_in_tail(path) == 0
    assert len(read(path).ticks) == 5
