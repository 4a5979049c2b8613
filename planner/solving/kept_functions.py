"""Keeps the functions of a problem's pieces, which take seconds to derive, as instructions.

They are kept under a hash of everything that decides them: this planner's own sources, the robot, the rotors and
CasADi's version.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...files.cache import Cache
from ...mathematics.compiling.lanes import OPERATIONS
from ...robots.description import RobotDescription
from ..models.coordinates import Coordinates
from ..models.interpreted import InterpretedFunction, interpreted
from ..models.symbolic_model import SymbolicModel
from ..problem.stage_functions import PIECES, StageFunction, make_piece
from ..task.files import need_planner
from ..task.plan import PlannedJump
from ..task.scaling import per_robot
from ..task.task import Knots

SOURCES = (
    "models/symbolic_model.py",
    "models/symmetry.py",
    "models/coordinates.py",
    "problem/stage_functions.py",
    "problem/leg_rows.py",
    "problem/obstacles.py",
)
KINDS = ("value", "gradient", "jacobian", "hessian")
Progress = Callable[[str, int, int], None]
"""Called with what is being done, steps done and steps in all."""


FUNCTIONS = Cache("planner", ".npz")
"""Each piece's functions, under the hash of what decides them and the piece's name."""


@dataclass(frozen=True)
class FunctionSet:
    """Pieces that are kept together.

    Attributes:
        name: what the functions' names begin with.
        pieces: the names of the pieces that are wanted.
        sources: the files, from the planner's folder, that decide what the functions compute.
        make: the piece of a name.
    """

    name: str
    pieces: tuple[str, ...]
    sources: tuple[str, ...]
    make: Callable[[str], StageFunction]


UNUSED = {"profiles", "profile", "sensors", "standing", "held", "points", "text"}
"""Parts of a description that no function depends on; of the profiles only the rotors count."""


@per_robot
def content_hash(
    robot: RobotDescription, name: str, sources: tuple[str, ...] = SOURCES, more: object = None
) -> str:
    """Return the name of a set of functions: the same for the same content; ``more`` is anything else that decides
    it.
    """
    need_planner()
    import casadi as ca

    digest = hashlib.sha256()
    for source in (*sources, "models/interpreted.py", "solving/kept_functions.py"):
        digest.update((Path(__file__).parents[1] / source).read_bytes())
    kept = robot.model_dump(mode="json", exclude=UNUSED)
    kept["rotors"] = robot.rotor_matrix.tolist()
    digest.update(json.dumps(kept, sort_keys=True).encode())
    digest.update(repr((name, more, ca.CasadiMeta.version(), OPERATIONS)).encode())
    return digest.hexdigest()[:20]


def load_pieces(
    model: SymbolicModel,
    coordinates: Coordinates,
    *,
    names: tuple[str, ...] = PIECES,
    progress: Progress | None = None,
) -> dict[str, StageFunction]:
    """Return the named pieces' functions."""
    functions = FunctionSet(
        coordinates.name, names, SOURCES, lambda name: make_piece(model, coordinates, name)
    )
    return load_functions(functions, model, progress=progress)


def load_functions(
    functions: FunctionSet, model: SymbolicModel, *, progress: Progress | None = None
) -> dict[str, StageFunction]:
    """Return the same for any set of pieces."""
    key = content_hash(model.robot, functions.name, functions.sources, model.loads)
    held = _held.pop(key, {})
    _held[key] = held  # behind all others, of which the first was not asked for the longest
    if len(_held) > KEPT:
        _held.pop(next(iter(_held)), None)
    missing = [name for name in functions.pieces if name not in held]
    for count, name in enumerate(missing):
        kept = FUNCTIONS.load(f"{key}/{name}")
        if kept is None:
            if progress is not None:
                progress(f"deriving the {functions.name} {name} functions", count, len(missing))
            piece = functions.make(name)
            held[name] = StageFunction(*(interpreted(getattr(piece, kind)) for kind in KINDS))
            FUNCTIONS.save(f"{key}/{name}", _packed(held[name]))
        else:
            held[name] = _unpacked(kept, f"{functions.name}_{name}")
    if missing and progress is not None:
        progress(f"{functions.name} functions ready", len(missing), len(missing))
    return {name: held[name] for name in functions.pieces}


KEPT = 8
"""Sets of functions that are held, each of up to 30 MB: a study may plan for hundreds of robots."""
_held: dict[str, dict[str, StageFunction]] = {}


def _packed(piece: StageFunction) -> bytes:
    arrays: dict[str, Any] = {}
    for kind in KINDS:
        found = getattr(piece, kind).arrays()
        arrays |= {f"{kind} {number}": array for number, array in enumerate(found)}
    data = io.BytesIO()
    np.savez(data, **arrays)
    return data.getvalue()


def _unpacked(data: bytes, prefix: str) -> StageFunction:
    with np.load(io.BytesIO(data)) as arrays:
        return StageFunction(
            *(
                InterpretedFunction(
                    f"{prefix}_{kind}", *(arrays[f"{kind} {number}"] for number in range(3))
                )
                for kind in KINDS
            )
        )


@dataclass(frozen=True)
class SolveOptions:
    """Options of every formulation beside the task and the robot.

    Attributes:
        warm_start: a plan of a near task, on any grid; one that goes through other phases is not
            used. A plan of this very task that failed the validity check is solved again on finer
            intervals (see ``solve.finer_knots``).
        progress: is told when functions are derived, once for each robot.
        solver: ``fatrop`` or ``ipopt`` to insist on one of them.
        knots: numbers of intervals to use instead of the task's.
        quick: whether to give up soon: what is not found in a few iterations is not looked for.
    """

    warm_start: PlannedJump | None = None
    progress: Progress | None = None
    solver: str = ""
    knots: Knots | None = None
    quick: bool = False
