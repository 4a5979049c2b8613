"""Corrections from the rehearsal of a plan, kept in a small file in a folder of the plan library.

A rehearsal belongs to one plan and one controller. It is kept under hashes of both: the bytes of the
plan's file, and what ``controller_hash`` says. With another plan or controller it is never found.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...runtime.language.errors import AloftError
from ..task.files import write_whole
from ..task.task import JumpTask
from .library import PlanLibrary

FORMAT = 1
FOLDER = "rehearsed"
"""The folder, within a library's, of what was learnt."""
NO_PART = ("task", "rehearsed", "learnt", "library", "solve", "check")
"""The parameters of the plan's block that are no part of the controller."""

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


class RehearsalFileError(AloftError):
    """The file of a rehearsal is damaged."""


@dataclass(frozen=True)
class Deviation:
    """Error of a robot's lift-off relative to its plan, as a mean over several runs.

    Attributes:
        velocity: of the centre of mass, in the plan's axes [m/s].
        momentum: of the angular momentum about it [N m s].
        size: both as one speed [m/s].
        scatter: the standard error of ``size``, from the differences between the runs [m/s].
        landed, flown, runs: how many runs succeeded, left the ground, and were made.
    """

    velocity: Vector
    momentum: Vector
    size: float
    scatter: float
    landed: int
    flown: int
    runs: int


@dataclass(frozen=True)
class Rehearsed:
    """The outcome of a rehearsal: corrections that are zero unless they were worth ``keeping``."""

    velocity_correction: Vector
    momentum_correction: Vector
    before: Deviation
    after: Deviation
    seeds: tuple[int, ...]
    trial: str
    reason: str

    @property
    def corrects(self) -> bool:
        """True if there is a correction."""
        return any(self.velocity_correction) or any(self.momentum_correction)


def controller_hash(blocks: Mapping[str, Mapping[str, Any]], rate: float, plan: str) -> str:
    """Return a hash of the controller in a graph: of every block on which the robot's command depends.

    The robot itself with its seed and trial, the score, and the task are no part of it.

    Args:
        blocks: every block's entry in the flattened graph, with its references, by its path.
        rate: of the graph [Hz].
        plan: the path of the block that plays back the plan.
    """
    machines = [path for path, block in blocks.items() if str(block["use"]).startswith("hal.")]
    pending, found = list(machines), dict[str, Mapping[str, Any]]()
    while pending:
        path = pending.pop()
        if path in found:
            continue
        found[path] = blocks[path]
        pending += list(_sources(blocks[path].get("in"), blocks))
    parts = {path: dict(block) for path, block in found.items() if path not in machines}
    if plan in parts:
        given = parts[plan].get("with", {})
        parts[plan]["with"] = {key: value for key, value in given.items() if key not in NO_PART}
    text = json.dumps({"rate": round(rate, 6), "blocks": parts}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _sources(wires: Any, blocks: Mapping[str, Any]) -> Iterator[str]:
    """Yield the blocks that a block's wires come from."""
    if isinstance(wires, Mapping):
        wires = list(wires.values())
    if isinstance(wires, list):
        for wire in wires:
            yield from _sources(wire, blocks)
    elif isinstance(wires, str):
        path = wires.partition(".")[0]
        if path in blocks:
            yield path


def find_rehearsed(library: PlanLibrary, task: JumpTask, controller: str) -> Rehearsed | None:
    """Return the corrections for the kept plan of a task with that controller, or ``None``.

    What lies in the library's own folder comes before what is shipped.

    Raises:
        RehearsalFileError: its file is damaged; the message names it and the fix.
    """
    plan = library.path_of(task)
    if plan is None:
        return None
    own_first = sorted(library.folders, key=lambda folder: folder != library.folder)
    paths = [_path(folder, plan, controller) for folder in own_first]
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        return None
    try:
        data = json.loads(path.read_text("utf-8"))
        key = data.pop("format"), data.pop("plan"), data.pop("controller")
        corrections = {name: read_vector(data.pop(f"{name}_correction")) for name in KINDS}
        before, after = (_deviation(data.pop(name)) for name in ("before", "after"))
        found = Rehearsed(
            corrections["velocity"], corrections["momentum"], before, after,
            tuple(int(seed) for seed in data["seeds"]), str(data["trial"]), str(data["reason"]),
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RehearsalFileError(
            f"{path}: expected what a rehearsal has learnt, found a damaged file "
            f"({type(error).__name__}: {error}); remove it, or rehearse again with --rehearse"
        ) from error
    return found if key == (FORMAT, _hash_of(plan), controller) else None


def was_rehearsed(library: PlanLibrary, task: JumpTask) -> bool:
    """Check whether the kept plan of a task was ever rehearsed, with whichever controller."""
    plan = library.path_of(task)
    return plan is not None and any(
        any((folder / FOLDER).glob(f"{plan.stem}.*.json")) for folder in library.folders
    )


def keep_rehearsed(
    library: PlanLibrary, task: JumpTask, controller: str, rehearsed: Rehearsed
) -> Path:
    """Keep what was learnt for the kept plan of a task; it replaces what was learnt before.

    Raises:
        RehearsalFileError: the library has no plan of that task.
    """
    plan = library.path_of(task)
    if plan is None:
        raise RehearsalFileError(f"there is no plan of {task.name!r} to keep a rehearsal with")
    key = {"format": FORMAT, "plan": _hash_of(plan), "controller": controller}
    text = json.dumps({**key, **asdict(rehearsed)}, indent=1) + "\n"
    return write_whole(_path(library.folder, plan, controller), text.encode())


KINDS = ("velocity", "momentum")


def _path(folder: Path, plan: Path, controller: str) -> Path:
    return folder / FOLDER / f"{plan.stem}.{controller}.json"


def _hash_of(plan: Path) -> str:
    """Return the hash of a plan's file."""
    return hashlib.sha256(plan.read_bytes()).hexdigest()


def read_vector(values: Any) -> Vector:
    """Read three finite numbers from a file; raises ``ValueError`` or ``TypeError`` for anything else."""
    x, y, z = (float(value) for value in values)
    if not all(abs(value) < 1e6 for value in (x, y, z)):
        raise ValueError(f"{values} is not finite")
    return x, y, z


def _deviation(data: Any) -> Deviation:
    return Deviation(
        read_vector(data["velocity"]), read_vector(data["momentum"]), float(data["size"]),
        float(data["scatter"]), int(data["landed"]), int(data["flown"]), int(data["runs"]),
    )  # fmt: skip
