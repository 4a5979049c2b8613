"""Opens a recording so that it can be replayed: the graph is loaded from the text in the recording.

A recording carries the files that parameters named and that blocks found, such as tasks and plans,
and the robot's description. Where the present ones are the same they are used. Else the recorded
ones are written to a folder of their own and the graph is made to name those.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml
from numpy.typing import NDArray

from ...files.names import inside
from ...files.nodes import plain
from ...files.problems import Problems
from ...robots.description import RobotDescription, RobotError, find_robot
from ...runtime.language.errors import AloftError, ExitCode
from ...runtime.language.flat_graph import FlatGraph
from ...runtime.language.layout import Layout
from ...runtime.language.parameter_change import ParameterChange
from ...runtime.language.stages import CheckedGraph
from ...runtime.loading import checked_again, flattened_text
from ...runtime.loading.flattening.change import change
from ...runtime.running.memory import BoundGraph
from ...runtime.running.snapshot import Snapshot
from ..file.code import NeededCode, code_of, expect_trusted, remember
from ..file.dependencies import digests, files_read, named_file, other_files, unpacked
from ..file.format import Header
from ..file.header import machine, versions
from ..file.reader import RecordedRun, read
from ..viewing.signal_names import value_text
from .replay import late_blocks
from .stand_in import seen_graph

_ENTRY = re.compile(r"(?P<block>[^:/]+)\.(?P<parameter>\w+)(?P<kind>: |/)(?P<name>.*)", re.DOTALL)


@dataclass(frozen=True)
class Restored:
    """The restored files of a recording.

    Attributes:
        overrides: by ``block.parameter`` the restored file or folder, and by ``robot`` the description.
        said: what was restored and why, each in one sentence.
        entries: the entries of the restored files in ``Header.files``.
    """

    overrides: Mapping[str, str]
    said: tuple[str, ...]
    entries: frozenset[str]


def restored(header: Header, graph: FlatGraph, folder: Path) -> Restored:
    """Write the files that are other than they were, or are not there any more, to ``folder``.

    Args:
        header: the recording's header.
        graph: the recorded graph; the names of files are relative to its folder.
        folder: an empty folder.
    """
    overrides: dict[str, str] = {}
    said, entries = [], set()
    places: dict[tuple[str, str], Path] = {}
    for number, (entry, block, parameter, kind, name) in enumerate(_entries(header)):
        try:
            content = unpacked(header.contents[header.files[entry]])
        except ValueError as error:
            raise AloftError(f"the recording's file of {entry} cannot be used: {error}") from error
        found_in_folder = kind == "/"
        now = named_file(name, graph.folder)
        if now is not None and sha256(now.read_bytes()).hexdigest() == header.files[entry]:
            continue
        place = folder / f"file{number}"
        if found_in_folder:  # further files that the block found lie beside it
            place = places.setdefault((block, parameter), place)
        file = inside(place, Path(name).name)
        _write(file, content)
        overrides[f"{block}.{parameter}"] = str(place if found_in_folder else file)
        entries.add(entry)
        if found_in_folder:
            said.append(f"the file {name} of {block} is taken from the recording")
            continue
        why = "is not there any more" if now is None else "has other content now"
        said.append(f"the file of {entry} {why}; the recorded one is used")
    robot = header.robot
    if robot is not None and graph.robot is not None and not _is_present(robot, graph):
        place = folder / "robot.yaml"
        _write(place, yaml.safe_dump(robot.content(), sort_keys=False).encode())
        overrides["robot"] = str(place)
        said.append(
            f"the description of the robot {robot.name} is not the recorded one any more, or is "
            "not there; the recorded one is used"
        )
    return Restored(overrides, tuple(said), frozenset(entries))


def _entries(header: Header) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield entry, block, parameter, kind and name of each file that the recording carries."""
    for entry, digest in header.files.items():
        match = _ENTRY.fullmatch(entry)
        if match is not None and digest in header.contents:
            yield entry, match["block"], match["parameter"], match["kind"], match["name"]


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def _is_present(robot: RobotDescription, graph: FlatGraph) -> bool:
    """Check whether the robot that the graph names is, in every value, the recorded one."""
    assert graph.robot is not None
    name = str(plain(graph.robot.value))
    try:
        now = find_robot(name, graph.robot_folder)
    except (LookupError, RobotError, OSError):
        return False
    if robot.profile in now.profiles:
        now = now.with_profile(robot.profile)
    return now.content() == robot.content()


@dataclass(frozen=True)
class OpenedRun:
    """A recording, and the graph that ran, made of the present code.

    Attributes:
        file: the recording.
        folder: the folder of the graph file, to which file names in the graph are relative.
        restore: whether files that have changed or gone since are taken from the recording.
        look: whether the graph is only looked at: no code that the recording names is run, and blocks that
            need such code are stand-ins.
        trust: whether the user allows all code that the recording names, from now on.
    """

    file: RecordedRun
    folder: Path
    restore: bool = True
    look: bool = False
    trust: bool = False
    _place: TemporaryDirectory[str] = field(
        default_factory=lambda: TemporaryDirectory(prefix="aloft-replay-"),
        repr=False,
        compare=False,
    )

    @classmethod
    def of(
        cls, path: str | PathLike[str], folder: Path | None = None, *, restore: bool = True,
        look: bool = False, trust: bool = False,
    ) -> OpenedRun:  # fmt: skip
        """Open the recording at ``path``.

        Raises:
            FileNotFoundError: there is no such file.
            AloftError: it is no recording, or it holds no tick.
        """
        file = read(path)
        if not len(file.ticks):
            raise AloftError(f"{path} holds no tick")
        folder = folder or _folder(Path(path), Path(file.header.source))
        return cls(file, folder, restore, look, trust)

    @cached_property
    def flat(self) -> FlatGraph:
        """The recorded graph as it was written, not checked. Raises ``LoadError``."""
        header = self.file.header
        name = Path(header.source).name or f"{header.name}.yaml"
        return flattened_text(header.graph, self.folder / name)

    @cached_property
    def restored(self) -> Restored:
        """The files that were taken from the recording."""
        if not self.restore:
            return Restored({}, (), frozenset())
        return restored(self.file.header, self.flat, Path(self._place.name))

    def changed(self, overrides: Sequence[str] = ()) -> CheckedGraph:
        """Return the recorded graph with further overrides.

        Raises:
            LoadError: the graph cannot be loaded any more.
            UntrustedCodeError: it would run code of others that the user has not allowed.
        """
        changed = [text.partition("=")[0] for text in overrides]
        files = [
            f"{key}={json.dumps(file)}"
            for key, file in self.restored.overrides.items()
            if key not in changed and f"{key.rpartition('.')[0]}.use" not in changed
        ]
        if self.look:
            return seen_graph(self.flat, self.file.header, files, overrides)
        self._expect_trust(files)
        return checked_again(self.flat, [*files, *overrides])

    def _expect_trust(self, files: Sequence[str]) -> None:
        """Raise unless all code is trusted that the graph with these overrides of files runs."""
        codes = self.code(files)
        if self.trust:
            remember(codes)
        expect_trusted(codes if not self.trust else (), self.file.path)

    def code(self, files: Sequence[str] = ()) -> list[NeededCode]:
        """Return the code that is not aloft's which the recorded graph runs."""
        return code_of(change(self.flat, files, Problems()), self.file.header.robot)

    @cached_property
    def graph(self) -> CheckedGraph:
        """The recorded graph. Raises ``LoadError`` where code or files have gone since."""
        return self.changed()

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
    def late(self) -> Sequence[str]:
        """The background blocks of which a result was late."""
        return late_blocks(self.file.notes)

    @property
    def failed(self) -> bool:
        """True if a block failed in the tick after the last row."""
        outcome = self.file.outcome or {}
        if outcome.get("exit_code") != ExitCode.RUN_FAILED:
            return False
        header = self.file.header
        done = int(self.ticks[-1]) + 1 - header.first_tick + header.earlier_ticks
        return done == outcome.get("ticks")

    def rows(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Return the ticks from ``first`` up to ``last``, and their rows."""
        return self.file.window(first, last)

    def keyframe(self, tick: int) -> Snapshot:
        """Return the graph's memory before ``tick``. Raises ``KeyError``."""
        return self.file.snapshot(tick)

    def changed_dependencies(self) -> list[str]:
        """List the versions, the processor, BLAS and its kernel, and the files and plans that
        computed the run and are different here."""
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
    """Return the graph file's folder: as the run named it, seen from here or from the recording."""
    places = (Path(), recording.parent, recording.parent.parent)
    found = (place / source for place in places if (place / source).is_file())
    return next(found, source).parent


class TickValues:
    """See ``runtime.drawing.page.Values``.

    Args:
        run: a recording with one tick or more.
    """

    def __init__(self, run: RecordedRun) -> None:
        self._run = run
        self._layout = run.header.bus.layout()
        self._signals = run.signals()
        self.ticks = (int(run.ticks[0]), int(run.ticks[-1]))
        self.period = 1.0 / run.header.base_rate
        blocks = (run.outcome or {}).get("blocks", {})
        self.times: Mapping[str, str] = {
            path: f"{t['calls']} runs, median {t['p50_us']:.1f} us, 99 % {t['p99_us']:.1f} us, "
            f"longest {t['max_us']:.1f} us, {t['overruns']} deadlines missed"
            for path, t in blocks.items()
        }

    def at(self, tick: int) -> Mapping[str, str]:
        """Return the values of the last recorded tick up to this one."""
        first, last = self.ticks
        tick = min(max(tick, first), last)
        known = self._run.ticks
        row = int(known.searchsorted(tick, side="right")) - 1
        _, rows = self._run.window(int(known[row]), int(known[row]) + 1)
        return {
            name: value_text(self._layout.view(rows, name)[0], signal.unit or "")
            for name, signal in self._signals.items()
        }
