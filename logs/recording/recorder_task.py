"""What the graph's process and the recorder's process tell each other: task, records and report."""

from __future__ import annotations

import json
import socket
from collections.abc import Sequence
from dataclasses import asdict, dataclass

HEADER, ROW, KEYFRAME, NOTE = 1, 2, 3, 4
"""The kinds of records in the ring; a keyframe is the bytes of the bus, then of the state."""
_MOST_FILES = 2
_PART = 65536


@dataclass(frozen=True)
class Task:
    """What to write.

    Attributes:
        descriptor, capacity: of the ring.
        path: the name that the recording gets; empty if no file is written.
        file: the descriptor of the file, which is locked; see ``place``.
        keep: the number of earlier recordings of that name that are kept.
        flush_period: seconds after which what has come is handed to the operating system; four times
            as many where it is less than a period of the graph's time.
        sync_period: seconds after which that is told to put it on the disk.
        live: where a viewer listens that shows the run while it goes on, if one does.
        split: ticks after which the recording goes on in a new file, at the next keyframe; zero for
            never.
    """

    descriptor: int
    capacity: int
    path: str
    file: int
    keep: int
    flush_period: float
    sync_period: float
    live: str = ""
    split: int = 0


@dataclass
class Report:
    """What was done.

    Attributes:
        rows: the number of ticks in the file, or in all files together.
        size: the size of the file or of all files [bytes].
        files: the files, if there are several.
        memory: the most memory used [bytes].
        problem: what went wrong with the file, if anything.
        lost: the number of ticks that were taken from the ring and are not in the file.
        odd: what the user must know although the recording is whole.
        live_problem: why the viewer did not show all of the run.
    """

    rows: int = 0
    size: int = 0
    memory: int = 0
    problem: str = ""
    lost: int = 0
    odd: str = ""
    live_problem: str = ""
    files: tuple[str, ...] = ()


def send_task(connection: socket.socket, task: Task, files: Sequence[int]) -> None:
    """Send a task with the open files it speaks of: that of the ring, and if there is one that of the
    recording.

    Raises:
        OSError: nobody takes it.
    """
    text = json.dumps(asdict(task)).encode() + b"\n"
    sent = socket.send_fds(connection, [text], list(files))
    connection.sendall(text[sent:])


def receive_task(connection: socket.socket) -> Task | None:
    """The task that comes next, with the numbers that its files have here; none where the other side
    has closed the connection."""
    text, files, _, _ = socket.recv_fds(connection, _PART, _MOST_FILES)
    while text and not text.endswith(b"\n"):
        part = connection.recv(_PART)
        text += part
        if not part:
            return None
    if not text:
        return None
    numbers = dict(zip(("descriptor", "file"), files, strict=False))
    return Task(**{**json.loads(text), **numbers})
