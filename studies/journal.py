"""Keeps finished runs in a file, one line each, so that they survive the death of the process.

The file holds lines of JSON and is only appended to. An incomplete last line is not a run.

The code, the data and the library versions that decide the outcome of a run, besides its graph.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import IO, Any, Self

from ..runtime.language.errors import AloftError


@dataclass(frozen=True)
class Outcome:
    """The outcome of one run. ``error`` is empty unless something broke; a fall is not an error."""

    success: bool
    reason: str
    run_hash: str = ""
    metrics: dict[str, Any] = field(default_factory=dict)
    error: str = ""
    wall_time_s: float = 0.0


class Journal:
    """The runs in one file by their keys. It is a context manager, within which runs can be added.

    Raises:
        AloftError: another process adds to the same file, or it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.outcomes: dict[str, Outcome] = {}
        self._file: IO[bytes] | None = None

    def __enter__(self) -> Self:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("a+b")
            self._lock(self._file)
            self._read(self._file)
        except OSError as error:
            raise AloftError(f"cannot write {self.path}: {error.strerror or error}") from error
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()

    def add(self, key: str, outcome: Outcome) -> None:
        """Keep a run."""
        assert self._file is not None
        line = json.dumps({"key": key, **asdict(outcome)}, allow_nan=False)
        self._file.write(line.encode() + b"\n")
        self._file.flush()  # to the system, which outlives this process
        os.fsync(self._file.fileno())  # to the disk, which outlives the system
        self.outcomes[key] = outcome

    def read_back(self) -> None:
        """Read the file again, after a signal that may have interrupted ``add``."""
        assert self._file is not None
        self._file.flush()
        self.outcomes.clear()
        self._read(self._file)

    def _lock(self, file: IO[bytes]) -> None:
        try:
            import fcntl
        except ImportError:  # no such thing here: two at once are then the user's affair
            return
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise AloftError(
                f"another process works on {self.path.parent}; wait for it or give another --out"
            ) from None

    def _read(self, file: IO[bytes]) -> None:
        file.seek(0)
        whole = 0
        for line in file:
            if not line.endswith(b"\n"):
                break
            whole += len(line)
            try:
                data = json.loads(line)
                key = data.pop("key")
                self.outcomes[key] = Outcome(**data)
            except (ValueError, KeyError, TypeError, AttributeError):
                continue  # a damaged line is a run that is made again
        file.seek(0, os.SEEK_END)
        if file.tell() > whole:
            file.truncate(whole)


ROOT = Path(__file__).parent.parent
FOLDERS = ("mathematics", "robots", "runtime", "blocks", "planner", "hal")
SUFFIXES = (".py", ".yaml")
LIBRARIES = ("numpy", "mujoco-core", "mujoco", "pin", "daqp", "qpsolvers")


@cache
def code_fingerprint() -> str:
    """Hash all code that may run in a graph, the shipped plans, and the versions of the packages
    that compute. Results that were made by other code are therefore not used."""
    digest = hashlib.sha256()
    files = [p for folder in FOLDERS for p in (ROOT / folder).rglob("*") if p.suffix in SUFFIXES]
    for path in sorted([*files, *(ROOT / "graphs" / "plans").glob("*.npz")]):
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    for name in LIBRARIES:
        try:
            digest.update(f"{name} {metadata.version(name)}\n".encode())
        except metadata.PackageNotFoundError:
            continue
    return digest.hexdigest()[:24]
