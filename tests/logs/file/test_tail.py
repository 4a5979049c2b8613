"""The tail of an old recording: read as far as its numbers can be believed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.logs.file.tail import read_tail, record_type, tail_of


def records(first: int, last: int, size: int = 64) -> np.ndarray[Any, Any]:
    found = np.zeros(last - first, record_type(size))
    found["tick"] = np.arange(first, last)
    found["row"][:, :8] = np.arange(first, last, dtype=np.float64)[:, None].view(np.uint8)
    return found


def test_it_is_read_as_far_as_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    assert len(read_tail(path, 64)[0]) == 0
    tail_of(path).write_bytes(records(0, 5).tobytes()[:-1])  # a tick that is cut is none
    ticks, rows = read_tail(path, 64)
    assert ticks.tolist() == [0, 1, 2, 3]
    assert rows.tobytes() == records(0, 4)["row"].tobytes()


@pytest.mark.parametrize("wrong, count", [(10**12, 3), (-1, 3), (2, 3)])
def test_a_tick_that_cannot_follow_ends_it(tmp_path: Path, wrong: int, count: int) -> None:
    path = tmp_path / "a.rrd"
    data = records(0, 6)
    data["tick"][3] = wrong
    tail_of(path).write_bytes(data.tobytes())
    assert read_tail(path, 64)[0].tolist() == list(range(count))
    data["tick"][0] = 10**12
    tail_of(path).write_bytes(data.tobytes())
    assert len(read_tail(path, 64, after=20)[0]) == 0
