"""Writes the records of a recording, and what the viewer shows, into a Rerun file; see ``file.records``.

Rerun writes into a pipe, and what comes out of it is written into the file here: so a full disk is noticed, and no
chunk is in the file in part. Whatever was written is with the operating system when the call returns.
"""

from __future__ import annotations

import fcntl
import os
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from select import select
from typing import Any
from zlib import crc32

from ..file.format import RECORD
from ..file.records import MOST_SALTS, Content, Record, composed
from .output_file import OutputFile

END_TIME = 60.0
"""Seconds that Rerun may take to write what is left."""
ENTITIES = {
    Content.START: "header",
    Content.FILES: "files",
    Content.ROWS: "rows",
    Content.HELD: "held",
    Content.KEYFRAME: "keyframes",
    Content.NOTES: "notes",
    Content.OUTCOME: "outcome",
    Content.END: "end",
}
_PIPE_SIZE = 1 << 20


class RerunPipe:
    """The bytes that Rerun writes of a stream.

    Args:
        stream: the stream, whose only sink this is.
        index: whether Rerun writes an index of all chunks at the end, which it has in memory until then.
    """

    def __init__(self, stream: Any, *, index: bool) -> None:
        import rerun as rr

        self._stream = stream
        self._reader, writer = os.pipe()
        os.set_blocking(self._reader, False)
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):  # a user's limit: the pipe is smaller
                fcntl.fcntl(self._reader, fcntl.F_SETPIPE_SZ, _PIPE_SIZE)
        self._taken, self._lock = bytearray(), threading.Lock()
        try:
            stream.set_sinks(rr.FileSink(f"/dev/fd/{writer}", write_footer=index))
        finally:
            os.close(writer)
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while not self._drain():
            select([self._reader], [], [])

    def _drain(self) -> bool:
        """Take what is in the pipe; tell whether Rerun has closed it."""
        with self._lock:
            while True:
                try:
                    data = os.read(self._reader, _PIPE_SIZE)
                except BlockingIOError:
                    return False
                if not data:
                    return True
                self._taken += data

    def take(self) -> bytes:
        """Return what Rerun has made of all that was sent."""
        self._stream.flush()
        self._drain()
        with self._lock:
            data, self._taken = bytes(self._taken), bytearray()
        return data

    def close(self) -> bytes:
        """End the stream, and return what came last; nothing, when it was ended before."""
        if self._reader < 0:
            return b""
        self._stream.disconnect()
        self._thread.join(END_TIME)
        with self._lock:
            if not self._thread.is_alive():
                os.close(self._reader)
            self._reader = -1
            return bytes(self._taken)


_NONE = Record(Content.START, -1)


@dataclass(frozen=True)
class _State:
    """The end of the file: its size, the last record, and the bytes before its mark and their CRC-32."""

    size: int = 0
    last: Record = _NONE
    front: int = 0
    crc: int = 0
    """Of the front of the last record, and of all behind it."""

    def grown(self, data: bytes) -> _State:
        """Return the state with more bytes behind the last record."""
        return replace(self, size=self.size + len(data), crc=crc32(data, self.crc))


class RecordStream:
    """Writes records one after another.

    Args:
        stream: the Rerun stream.
        output: the file.
        index: whether Rerun's index stands at the end of a file that was written without a failure.
    """

    def __init__(self, stream: Any, output: OutputFile, *, index: bool) -> None:
        self._stream, self._output = stream, output
        self._pipe = RerunPipe(stream, index=index)
        self._state = _State()
        self._index = index

    def put(
        self,
        record: Record,
        payload: bytes,
        times: Sequence[Any] = (),
    ) -> None:
        """Write what was sent to the stream, and then a record; its number and size need not be known.

        Raises:
            OSError: there is no room; nothing of it is in the file then.
        """
        data = self._pipe.take()
        written, data = self._record(self._state.grown(data), data, record, payload, times)
        self._write(data)
        self._state = written

    def put_drawn(self) -> None:
        """Write what was sent to the stream for the viewer. Raises ``OSError``."""
        data = self._pipe.take()
        self._write(data)
        self._state = self._state.grown(data)

    def _record(
        self, state: _State, data: bytes, record: Record, payload: bytes, times: Sequence[Any]
    ) -> tuple[_State, bytes]:
        """Make a record behind ``data``, with which the file is in ``state``. Return both with it."""
        import rerun as rr

        last = state.last
        for salt in range(MOST_SALTS):
            end = last.end if last.number >= 0 else 0
            made, plain, guarded = composed(
                replace(
                    record, number=last.number + 1, begin=state.size, front=state.front, gap=state.size - end,
                    gap_crc=state.crc, salt=salt,
                ),
                payload,
            )  # fmt: skip
            entity = ENTITIES[record.content]
            if record.content in (Content.HELD, Content.END):
                entity = f"{entity}/{record.group}"
            column = rr.DynamicArchetype.columns("aloft", components={RECORD: as_arrow(guarded)})
            self._stream.send_columns(entity, times, list(column.partition([len(guarded)])))
            chunk = self._pipe.take()
            front = chunk.find(plain)
            if front >= 0:
                made = replace(made, place=state.size + front)
                crc = crc32(chunk[front + len(plain) :], crc32(chunk[:front]))
                return _State(state.size + len(chunk), made, front, crc), data + chunk
            state = state.grown(chunk)  # the same record once more, masked in another way
            data += chunk
        raise OSError("Rerun does not write what it is given: this version of it packs files in another way")  # fmt: skip

    def _write(self, data: bytes) -> None:
        """Write all of ``data`` at the file's end, or, if there is no room, nothing of it."""
        rest = memoryview(data)
        at = self._state.size
        try:
            while rest:
                count = os.pwrite(self._output.descriptor, rest, at)
                rest, at = rest[count:], at + count
        except OSError as error:
            os.ftruncate(self._output.descriptor, self._state.size)
            self._index = False  # Rerun's places of chunks are not those in the file
            why = error.strerror or error
            raise OSError(f"{self._output.target} cannot be written any further ({why})") from error

    def close(self) -> None:
        """Write the two last records, and the index where it is right and there is room for it.

        Raises:
            OSError: there is no room even for the records. All before remains readable.
        """
        data = self._pipe.take()
        state = self._state.grown(data)
        ends = []
        for group in range(2):
            state, data = self._record(state, data, Record(Content.END, group=group), b"", ())
            ends.append((state.last, state.front))
        index = self._pipe.close()
        if self._index and index:
            try:
                self._write(self._ended(data + index, ends))
            except OSError:
                pass  # without the index, which only Rerun's tools use
            else:
                return
        self._write(self._ended(data, ends))

    def _ended(self, data: bytes, ends: Sequence[tuple[Record, int]]) -> bytes:
        """Fill the two last records in: what is around them is known now."""
        whole, begin = bytearray(data), self._state.size
        for end, front in reversed(ends):
            mark, behind = end.place - begin, end.end - begin
            crc = crc32(whole[behind:], crc32(whole[mark - front : mark]))
            filled = replace(end, first=front, last=len(whole) - behind, crc=crc)
            whole[mark:behind] = composed(filled, b"")[1]
        return bytes(whole)

    def abandon(self) -> None:
        """Let go of the stream; what is written stays."""
        self._pipe.close()


def as_arrow(data: bytes) -> Any:
    """Wrap bytes in an Arrow array that shares their memory: Rerun would make a Python object of each byte of a
    NumPy array."""
    import pyarrow as pa  # comes with Rerun

    return pa.Array.from_buffers(pa.uint8(), len(data), [None, pa.py_buffer(data)])
