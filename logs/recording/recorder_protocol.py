"""Protocol of a recorder and its process: the task at the beginning, the report at the end, and the
kinds of records in the ring between them.
"""

from __future__ import annotations

from dataclasses import dataclass

HEADER, ROW, KEYFRAME, NOTE, REWIND, PART = 1, 2, 3, 4, 5, 6
"""The kinds of records in the ring. A row is the bytes of the whole bus, a part those of its base and of the held
groups whose blocks run in the tick (``file.held_fields``). A keyframe is the bytes of the bus, then of the state; after ``REWIND``
come its tick and later ones once more, another way."""


@dataclass(frozen=True)
class RecorderTask:
    """The task of a recorder.

    Attributes:
        capacity: the size of the ring [bytes].
        path: the name that the recording gets; empty if no file is written.
        keep: the number of earlier recordings of that name that are kept.
        flush_period: seconds after which what has come is handed to the operating system; four times
            as many where it is less than a period of the graph's time.
        sync_period: seconds after which that is told to put it on the disk.
        live: where a viewer listens that shows the run while it goes on, if one does.
        split: ticks after which the recording goes on in a new file, at the next keyframe; zero for
            never.

    The descriptor of the ring comes with it, and that of the file, which is locked; see ``output_file``.
    """

    capacity: int
    path: str
    keep: int
    flush_period: float
    sync_period: float
    live: str = ""
    split: int = 0


@dataclass
class RecorderReport:
    """The report of a recorder at its end.

    Attributes:
        rows: the number of ticks in the file, or in all files together.
        size: the size of the file or of all files [bytes].
        files: the files, if there are several.
        memory: the most memory used [bytes].
        problem: what went wrong with the file, if anything.
        error_number: the system's number of what went wrong, as in ``errno``; zero if it has none.
        lost: the number of ticks that were taken from the ring and are not in the file.
        odd: what the user must know although the recording is whole.
        live_problem: why the viewer did not show all of the run.
    """

    rows: int = 0
    size: int = 0
    memory: int = 0
    problem: str = ""
    error_number: int = 0
    lost: int = 0
    odd: str = ""
    live_problem: str = ""
    files: tuple[str, ...] = ()
