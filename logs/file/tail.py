"""The newest ticks of a recording while it is written: a file beside it, ``jump.rrd.tail``.

Every piece of a Rerun file costs the writer memory until the file is closed, and costs the reader
time. Therefore thousands of ticks are written at once. Until then they are in the tail, so that a
killed process does not lose them: for each tick its number as int64, then the bytes of the bus. The
file is emptied when its ticks are in the recording, and removed when the recording is whole.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def tail_of(path: Path) -> Path:
    """The file beside the recording at ``path``."""
    return path.with_name(f"{path.name}.tail")


def record_type(bus_size: int) -> np.dtype[Any]:
    """One tick: ``tick``, and ``row``, the bytes of the bus after it."""
    return np.dtype([("tick", "<i8"), ("row", "u1", (bus_size,))])


class TailWriter:
    """Writes the tail of the recording at ``path``, replacing an older one. Raises ``OSError``.

    Attributes:
        count: how many ticks are in the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = tail_of(path)
        self.count = 0
        self._file = self.path.open("wb", buffering=0)

    def append(self, records: NDArray[Any]) -> None:
        """Hand ``records`` (n,) of ``record_type`` to the operating system.

        Raises:
            OSError: it does not take all of them; ``count`` includes those that it took.
        """
        size = records.itemsize
        began = self.count * size
        rest = records.view(np.uint8).data
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            why = error.strerror or error
            raise OSError(f"{self.path} cannot be written any further ({why})") from error
        finally:
            self.count = self._file.tell() // size
            if rest:
                self._cut(self.count * size)
        assert self._file.tell() == began + records.nbytes

    def clear(self) -> None:
        """Empty the file, because its ticks are in the recording now. Raises ``OSError``."""
        if self.count:
            self.count = 0
            self._cut(0)

    def _cut(self, size: int) -> None:
        self._file.seek(size)
        self._file.truncate()

    def sync(self) -> None:
        """Force the file's content onto the disk. Raises ``OSError``."""
        os.fsync(self._file.fileno())

    def remove(self) -> None:
        """Close and remove the file."""
        self._file.close()
        with suppress(OSError):
            self.path.unlink()


def read_tail(path: Path, bus_size: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Ticks (n,) and rows (n, bytes) in the tail of the recording at ``path``; without one, none."""
    kind = record_type(bus_size)
    try:
        data = tail_of(path).read_bytes()
    except FileNotFoundError:
        data = b""
    records = np.frombuffer(data, kind, len(data) // kind.itemsize)
    return records["tick"].astype(np.int64), records["row"]
