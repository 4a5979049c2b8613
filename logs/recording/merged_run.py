"""Puts the recordings of a run's parts, which several machines made, together into one.

The result is what one process would have recorded of the same run, so it can be viewed and replayed
like any other. It holds the ticks that every part has recorded.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce
from hashlib import blake2b
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from ...runtime.language.errors import AloftError, ExitCode
from ...runtime.links.lockstep_link import LinkInput
from ...runtime.links.part import MergedLayout
from ...runtime.links.path_ages import MAX_TICKS, check_path_ages, timeline_of
from ...runtime.placement.placed import PlacedGraph
from ...runtime.running.memory import Memory
from ...runtime.running.sink import Note
from ...runtime.running.snapshot import Snapshot
from ..file.format import Header, RecordedBlock
from ..file.header import make_header
from ..file.packed_rows import TickRows
from ..file.reader import RecordedRun, read
from .writer import PACKED_BYTES, ROWS_AT_ONCE, RecordingWriter

Value = TypeVar("Value")
_OF_ALL = ("life", "parameter")
"""The kinds of notes that every part has; one of them is enough."""
_STAND_IN = f"{LinkInput.__module__}:{LinkInput.__name__}"
"""Part of the type names of those blocks that only stand for a block of another machine."""


def machine_of(placed: PlacedGraph, part: RecordedRun) -> str:
    """Find the machine whose part a recording is of.

    Raises:
        AloftError: it is no recording of a part of this graph.
    """
    own = {block.path for block in part.header.blocks if _STAND_IN not in block.type}
    for machine in placed.machines:
        mine = [spec.path for spec in placed.blocks_on(machine.name)]
        if mine and all(path in own for path in mine):
            return machine.name
    raise AloftError(f"{part.path} is not the recording of one part of {placed.graph.name}")


def recorded_machines(run: RecordedRun) -> tuple[list[str], set[str]]:
    """Return all machines of a recorded graph, and those one of whose blocks is in the recording itself."""
    tree = yaml.load(run.header.graph, yaml.BaseLoader)  # in which the key `on` is a text
    machines = list(tree.get("machines", {}))
    own = {block.path for block in run.header.blocks if _STAND_IN not in block.type}
    there = {
        entry.get("on", machines[0])
        for path, entry in tree.get("blocks", {}).items()
        if machines and path in own and isinstance(entry, dict)
    }
    return machines, there


def check_all_machines(runs: Mapping[Path, RecordedRun]) -> None:
    """Refuse recordings of two parts of one machine, and recordings that are not all parts of a graph.

    Raises:
        AloftError: which are twice, or missing.
    """
    found: dict[str, Path] = {}
    machines: list[str] = []
    for file, run in runs.items():
        machines, there = recorded_machines(run)
        for name in there:
            if name in found:
                raise AloftError(f"{found[name]} and {file} are both of machine {name!r}")
            found[name] = file
    if missing := [name for name in machines if name not in found]:
        raise AloftError(f"the recordings of {', '.join(missing)} are missing")


def merged_outcome(
    placed: PlacedGraph, parts: Mapping[str, RecordedRun], run_hash: str, ticks: int
) -> dict[str, Any]:
    """Join the outcome of the whole run from those of its parts.

    The reason is that of the part with the gravest exit code. Metrics are those of all parts; where
    two have one of the same name, that of the first machine counts.

    Raises:
        AloftError: a part was cut off.
    """
    outcomes = {}
    for machine, part in parts.items():
        if part.outcome is None:
            raise AloftError(f"{part.path} was cut off; `aloft log repair` completes it")
        outcomes[machine] = part.outcome
    worst = max(outcomes.values(), key=lambda outcome: int(outcome["exit_code"]))
    metrics: dict[str, Any] = {}
    for outcome in reversed(outcomes.values()):
        metrics |= outcome["metrics"]
    blocks = {}
    for path in placed.graph.order:
        found = outcomes[placed.graph.block(path).machine]["blocks"]
        if path in found:
            blocks[path] = found[path]
    changed = {"run_hash": run_hash, "ticks": ticks, "metrics": metrics, "blocks": blocks}
    ages = path_metrics(placed, parts)
    if ages.pop("success", True) is False and worst["success"]:
        code = int(ExitCode.NOT_SUCCESSFUL)
        changed |= {"success": False, "reason": ages["reason"], "exit_code": code}
    ages.pop("reason", None)
    metrics |= ages
    return {**worst, **changed}


def path_metrics(placed: PlacedGraph, parts: Mapping[str, RecordedRun]) -> dict[str, Any]:
    """Return the measured ages of the paths for which the graph allows one, where parts ran free;
    in lockstep the part that sets the pace has measured them."""
    graph = placed.graph
    if graph.links.mode != "free" or not graph.links.paths:
        return {}
    timelines = {}
    for machine, part in parts.items():
        ticks, rows = part.window(*_latest(part))
        layout = part.header.bus.layout()
        timelines[machine] = timeline_of(placed, machine, ticks, partial(layout.view, rows))
    return check_path_ages(graph, timelines)


def _latest(part: RecordedRun) -> tuple[int, int]:
    """Return the ticks of a part that are compared: the first, and the one after the last."""
    if not len(part.ticks):
        return 0, 0
    end = int(part.ticks[-1]) + 1
    return max(int(part.ticks[0]), end - MAX_TICKS), end


def read_parts(
    placed: PlacedGraph, paths: Mapping[str, str | PathLike[str]]
) -> dict[str, RecordedRun]:
    """Read the recordings of all parts of a graph, by machine.

    Raises:
        AloftError: a part is missing, is no recording, or is of another graph.
        FileNotFoundError: there is no such file.
    """
    missing = [machine.name for machine in placed.machines if machine.name not in paths]
    if missing:
        raise AloftError(f"the recordings of {', '.join(missing)} are missing")
    parts = {machine.name: read(paths[machine.name]) for machine in placed.machines}
    try:
        _whole_bus(placed, parts)
    except (KeyError, ValueError) as error:
        text = ", ".join(str(part.path) for part in parts.values())
        raise AloftError(f"{text} are not of one run of {placed.graph.name}: {error}") from error
    return parts


def _whole_bus(placed: PlacedGraph, parts: Mapping[str, RecordedRun]) -> MergedLayout:
    """Return a layout that takes the bus of the whole from those of the parts, which may hold more."""
    layout = Memory(placed.graph.blocks, placed.graph.robot).bus.layout
    return MergedLayout(placed, layout, {m: part.header.bus.layout() for m, part in parts.items()})


def run_hash_of(placed: PlacedGraph, parts: Mapping[str, RecordedRun]) -> tuple[str, int]:
    """Compute the run hash of the whole, as one process would have it, and the number of its ticks."""
    made = blake2b(digest_size=16)
    count = 0
    for _, rows in _pieces(placed, parts):
        made.update(np.ascontiguousarray(rows).data)
        count += len(rows)
    return made.hexdigest(), count


def merge_recordings(
    path: str | PathLike[str],
    placed: PlacedGraph,
    parts: Mapping[str, RecordedRun],
    outcome: dict[str, Any],
) -> Path:
    """Write the recording of the whole run.

    Args:
        path: the file; one that is there is replaced.
        placed: the graph as it was spread.
        parts: what each machine has recorded.
        outcome: of the whole run, as ``RunResult.to_json`` gives it.

    Returns:
        The file, which has another name if a run is being recorded there.

    Raises:
        OSError: the file cannot be written.
        ImportError: Rerun is not installed.
    """
    memory = Memory(placed.graph.blocks, placed.graph.robot)
    header = _whole_header(placed, memory, parts)
    writer = RecordingWriter(path, header, outcome["run_hash"])
    try:
        for ticks, rows in _pieces(placed, parts):
            writer.write_rows(ticks, rows)
        for snapshot in _keyframes(placed, memory, parts):
            writer.write_keyframe(snapshot)
        writer.write_notes(_notes(parts))
        writer.write_outcome(outcome)
    finally:
        writer.close()
    return writer.path


def joined_blocks(parts: Sequence[RecordedRun]) -> tuple[RecordedBlock, ...]:
    """Return every block as the part recorded it that ran it, not as what stood for it elsewhere."""
    found: dict[str, RecordedBlock] = {}
    for part in parts:
        for block in part.header.blocks:
            if block.path not in found or _STAND_IN in found[block.path].type:
                found[block.path] = block
    return tuple(found.values())


def _whole_header(placed: PlacedGraph, memory: Memory, parts: Mapping[str, RecordedRun]) -> Header:
    """Return the header of the whole: what the parts say, for the memory of one process."""
    graph, first = placed.graph, next(iter(parts.values())).header
    headers = [part.header for part in parts.values()]
    starts = {
        machine: np.frombuffer(part.header.bus_start, np.uint8)[None]
        for machine, part in parts.items()
    }
    start = _whole_bus(placed, parts).rows(starts).tobytes()
    made = make_header(graph, memory.bus.layout, start, state=memory.state.layout)
    recorded = {block.path: block for block in joined_blocks(list(parts.values()))}
    return replace(
        made,
        graph=first.graph,
        first_tick=first.first_tick,
        clock=first.clock,
        blocks=tuple(
            replace(recorded.get(block.path, block), folder=block.folder) for block in made.blocks
        ),
        seeds=_joined(each.seeds for each in headers),
        parameters=_joined(each.parameters for each in headers),
        files=_joined(each.files for each in headers),
        contents=_joined(each.contents for each in headers),
        source=first.source,
        project=first.project,
    )  # fmt: skip


def _joined(found: Iterable[Mapping[str, Value]]) -> dict[str, Value]:
    return {key: value for each in found for key, value in each.items()}


def _pieces(placed: PlacedGraph, parts: Mapping[str, RecordedRun]) -> Iterator[TickRows]:
    """Yield ticks (n,) and rows (n, bytes) of the whole, as many at a time as are packed together."""
    whole = _whole_bus(placed, parts)
    waiting: list[TickRows] = []
    count = size = 0
    for ticks, of_parts in _common_rows(parts):
        rows = whole.rows(of_parts)
        waiting.append((ticks, rows))
        count, size = count + len(ticks), size + rows.nbytes
        if count >= ROWS_AT_ONCE or size >= PACKED_BYTES:
            yield _joined_rows(waiting)
            waiting, count, size = [], 0, 0
    if waiting:
        yield _joined_rows(waiting)


def _joined_rows(pieces: Sequence[TickRows]) -> TickRows:
    ticks, rows = zip(*pieces, strict=True)
    return np.concatenate(ticks), np.concatenate(rows)


def _common_rows(
    parts: Mapping[str, RecordedRun],
) -> Iterator[tuple[NDArray[np.int64], dict[str, NDArray[np.uint8]]]]:
    """Yield the ticks (n,) that every part has, and the rows (n, bytes) of each.

    Each part is unpacked once, a piece of its file at a time, whatever ticks the others lack. So rows of
    megabytes need no more memory than a few pieces.
    """
    sources = {machine: part.pieces() for machine, part in parts.items()}
    waiting: dict[str, TickRows] = {}
    while True:
        for machine, source in sources.items():
            while machine not in waiting or not len(waiting[machine][0]):
                piece = next(source, None)
                if piece is None:
                    return
                waiting[machine] = piece
        end = min(int(ticks[-1]) for ticks, _ in waiting.values())
        until = {m: int(np.searchsorted(t, end, side="right")) for m, (t, _) in waiting.items()}
        common = reduce(np.intersect1d, (t[: until[m]] for m, (t, _) in waiting.items()))
        if len(common):
            yield common, {m: r[np.searchsorted(t, common)] for m, (t, r) in waiting.items()}
        waiting = {m: (t[until[m] :], r[until[m] :]) for m, (t, r) in waiting.items()}


def _keyframes(
    placed: PlacedGraph, memory: Memory, parts: Mapping[str, RecordedRun]
) -> Sequence[Snapshot]:
    """Join the keyframes of the whole, before those ticks for which every part has one."""
    bus = _whole_bus(placed, parts)
    state = MergedLayout(
        placed, memory.state.layout, {m: p.header.state.layout() for m, p in parts.items()}
    )
    first, *others = (part.keyframes for part in parts.values())
    made = []
    for tick in first:
        if all(tick in keyframes for keyframes in others):
            kept = {machine: part.snapshot(tick) for machine, part in parts.items()}
            rows = {m: np.frombuffer(s.bus, np.uint8)[None] for m, s in kept.items()}
            states = {m: np.frombuffer(s.state, np.uint8)[None] for m, s in kept.items()}
            made.append(Snapshot(tick, bus.rows(rows).tobytes(), state.rows(states).tobytes()))
    return made


def _notes(parts: Mapping[str, RecordedRun]) -> list[Note]:
    """Join the notes of all parts; those that every part has are taken from the first."""
    found: list[Note] = []
    for number, (machine, part) in enumerate(parts.items()):
        for note in part.notes:
            if note.kind not in _OF_ALL:
                found.append(replace(note, text=f"{machine}: {note.text}"))
            elif number == 0:
                found.append(note)
    return sorted(found, key=lambda note: note.tick)
