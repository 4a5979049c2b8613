"""Opens a recording so that it can be replayed: the graph is loaded from the text in the recording.

Files that the graph names, such as tasks and plans, and the robot's description are those that the
recording carries, where the present ones are others; see ``carried_files``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.errors import AloftError, ExitCode
from ...runtime.language.layout import Layout
from ...runtime.language.parameter_change import ParameterChange
from ...runtime.language.stages import CheckedGraph
from ...runtime.loading import load_text
from ...runtime.running.memory import BoundGraph, Snapshot
from ..file.header import machine, versions
from ..file.reader import RecordedRun, read
from ..file.surroundings import digests, files_read, other_files
from .carried_files import Restored, restored


@dataclass(frozen=True)
class OpenedRun:
    """A recording, and the graph that ran, made of the present code.

    Attributes:
        file: the recording.
        folder: the folder of the graph file, to which file names in the graph are relative.
        restore: whether files that have changed or gone since are taken from the recording.
    """

    file: RecordedRun
    folder: Path
    restore: bool = True
    _place: TemporaryDirectory[str] = field(
        default_factory=lambda: TemporaryDirectory(prefix="aloft-replay-"),
        repr=False,
        compare=False,
    )

    @classmethod
    def of(
        cls, path: str | PathLike[str], folder: Path | None = None, *, restore: bool = True
    ) -> OpenedRun:
        """Open the recording at ``path``.

        Raises:
            FileNotFoundError: there is no such file.
            AloftError: it is no recording, or it holds no tick.
        """
        file = read(path)
        if not len(file.ticks):
            raise AloftError(f"{path} holds no tick")
        return cls(file, folder or _folder(Path(path), Path(file.header.source)), restore)

    @cached_property
    def restored(self) -> Restored:
        """The graph's text, and the files that were taken from the recording."""
        header = self.file.header
        text = header.graph
        if not self.restore:
            return Restored(text, {}, (), frozenset())
        return restored(header, text, self.folder, Path(self._place.name))

    def load(self, overrides: Sequence[str] = ()) -> CheckedGraph:
        """The recorded graph with further overrides. Raises ``LoadError``."""
        header, kept = self.file.header, self.restored
        name = Path(header.source).name or f"{header.name}.yaml"
        changed = [text.partition("=")[0] for text in overrides]
        files = [
            f"{parameter}={json.dumps(file)}"
            for parameter, file in kept.overrides.items()
            if parameter not in changed and f"{parameter.rpartition('.')[0]}.use" not in changed
        ]
        return load_text(kept.text, self.folder / name, [*files, *overrides])

    @cached_property
    def graph(self) -> CheckedGraph:
        """The recorded graph. Raises ``LoadError`` where code or files have gone since."""
        return self.load()

    @property
    def bus(self) -> Layout:
        """The layout of the rows."""
        return self.file.header.bus.layout()

    @property
    def state(self) -> Layout:
        """The layout of the keyframes' state."""
        return self.file.header.state.layout()

    @property
    def ticks(self) -> NDArray[np.int64]:
        """All recorded ticks."""
        return self.file.ticks

    @property
    def keyframes(self) -> Sequence[int]:
        """The ticks before which the whole memory was kept."""
        return self.file.keyframes

    @property
    def changes(self) -> Sequence[ParameterChange]:
        """The parameters that were changed during the run."""
        return self.file.parameter_changes

    @property
    def failed(self) -> bool:
        """Whether a block failed in the tick after the last row."""
        outcome = self.file.outcome or {}
        if outcome.get("exit_code") != ExitCode.RUN_FAILED:
            return False
        header = self.file.header
        done = int(self.ticks[-1]) + 1 - header.first_tick + header.earlier_ticks
        return done == outcome.get("ticks")

    def rows(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """The ticks from ``first`` up to ``last``, and their rows."""
        return self.file.window(first, last)

    def keyframe(self, tick: int) -> Snapshot:
        """What the graph remembered before ``tick``. Raises ``KeyError``."""
        return self.file.snapshot(tick)

    def what_is_other_now(self) -> list[str]:
        """The versions, the processor, BLAS and its kernel, and the files and plans that computed the run
        and are different here."""
        header = self.file.header
        now = {**versions(), **machine()}
        then = {**header.versions, **header.machine}
        found = [
            f"{name} was {then[name]} and is {now.get(name, 'not installed')}"
            for name in then
            if then[name] != now.get(name)
        ]
        kept = self.restored.entries
        files = {entry: digest for entry, digest in header.files.items() if entry not in kept}
        return found + other_files(files, digests(files_read(BoundGraph(self.graph))))


def _folder(recording: Path, source: Path) -> Path:
    """The graph file's folder: as the run named it, seen from here or from the recording."""
    places = (Path(), recording.parent, recording.parent.parent)
    found = (place / source for place in places if (place / source).is_file())
    return next(found, source).parent
