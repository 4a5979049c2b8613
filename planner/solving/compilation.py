"""Compiles the pieces' functions to machine code once, and keeps the libraries.

A library is kept under a hash of everything that decides its content: this planner's own sources,
the robot, the rotors, CasADi's version and the compiler's flags. Without a C compiler, or where
compilation fails, CasADi's own virtual machine evaluates the same functions some ten times slower.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ...files.cache import Cache, make_folders
from ...robots.description import RobotDescription
from ..models.coordinates import Coordinates
from ..models.symbolic_model import SymbolicModel
from ..problem.stage_functions import PIECES, StageFunction, make_piece
from ..task.files import need_planner
from ..task.plan import PlannedJump
from ..task.scaling import per_robot
from ..task.task import Knots

FLAGS = ("-O1", "-fPIC", "-shared", "-ffp-contract=off")
"""Compiler flags, none of one machine's: its libraries may be kept where other machines find them, and plans are the
same everywhere. Higher optimisation takes twice as long to compile and gains nothing.
"""
OPTIMISED = ("stance", "free_stance", "contact")
"""The pieces of most knots. Others are compiled without optimisation, which takes a fifth of the time:
their functions are long and have no loops, so the compiler spends it on assigning registers. Results are
the same."""
LONG = 75_000
"""A piece of so many instructions is not optimised in any case: it would take a minute, because the time for
registers grows faster than their number."""

SOURCES = (
    "models/symbolic_model.py",
    "models/symmetry.py",
    "models/coordinates.py",
    "problem/stage_functions.py",
    "problem/leg_rows.py",
    "problem/obstacles.py",
)
KINDS = ("value", "jacobian", "hessian")
Progress = Callable[[str, int, int], None]
"""Called with what is being done, steps done and steps in all."""


LIBRARIES = Cache("planner", ".so")
"""The compiled libraries, each under the hash of its content and its piece's name."""


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
    """Return the name of a library: the same for the same content; ``more`` is anything else that decides it."""
    need_planner()
    import casadi as ca

    digest = hashlib.sha256()
    for source in sources:
        digest.update((Path(__file__).parents[1] / source).read_bytes())
    kept = robot.model_dump(mode="json", exclude=UNUSED)
    kept["rotors"] = robot.rotor_matrix.tolist()
    digest.update(json.dumps(kept, sort_keys=True).encode())
    digest.update(repr((name, more, ca.CasadiMeta.version(), FLAGS, OPTIMISED)).encode())
    return digest.hexdigest()[:20]


def load_pieces(
    model: SymbolicModel,
    coordinates: Coordinates,
    *,
    names: tuple[str, ...] = PIECES,
    compiled: bool = True,
    progress: Progress | None = None,
) -> dict[str, StageFunction]:
    """Return the named pieces' functions, compiled where there is a compiler and ``compiled`` asks for it."""
    functions = FunctionSet(
        coordinates.name, names, SOURCES, lambda name: make_piece(model, coordinates, name)
    )
    return load_functions(functions, model, compiled=compiled, progress=progress)


def load_functions(
    functions: FunctionSet,
    model: SymbolicModel,
    *,
    compiled: bool = True,
    progress: Progress | None = None,
) -> dict[str, StageFunction]:
    """Return the same for any set of pieces."""
    key = content_hash(model.robot, functions.name, functions.sources, model.loads)
    held = _held.setdefault((key, compiled), {})
    missing = tuple(name for name in functions.pieces if name not in held)
    if missing:
        held |= _load(functions, key, missing, compiled, progress)
    return {name: held[name] for name in functions.pieces}


_held: dict[tuple[str, bool], dict[str, StageFunction]] = {}


def _load(
    functions: FunctionSet, key: str, names: tuple[str, ...], compiled: bool,
    progress: Progress | None,
) -> dict[str, StageFunction]:  # fmt: skip
    compiler = find_compiler() if compiled else None
    pieces: dict[str, StageFunction] = {}
    waiting, elsewhere = deque(names), 0
    while waiting:
        name = waiting.popleft()
        library = f"{key}/{name}"
        # What another process is compiling comes last, when there is nothing else to do but wait.
        with _claimed(library, compiler, wait=elsewhere > len(waiting)) as ours:
            if not ours:
                waiting.append(name)
                elsewhere += 1
                continue
            elsewhere = 0
            kept = LIBRARIES.loadable(library) if compiled else None
            if kept is None and progress is not None:
                how = "compiling" if compiler else "building"
                progress(f"{how} the {functions.name} {name} functions", len(pieces), len(names))
            piece = None if kept is not None else functions.make(name)
            if piece is not None and compiler is not None and _compile(compiler, piece, library):
                kept = LIBRARIES.loadable(library)
        if kept is not None:
            pieces[name] = _external(kept, f"{functions.name}_{name}")
        elif piece is not None:
            pieces[name] = piece
    if progress is not None:
        progress(f"{functions.name} functions ready", len(names), len(names))
    return pieces


@contextmanager
def _claimed(library: str, compiler: str | None, *, wait: bool) -> Iterator[bool]:
    """Claim a missing library for this process, so that no two make the same; yield whether it is this one's to make.

    With ``wait`` it becomes so when the other process is done or has died. Where files cannot be
    locked, and where nothing is to be made, it always is.
    """
    try:
        import fcntl

        path = LIBRARIES.path(library)
        missing = compiler is not None and LIBRARIES.loadable(library) is None
        claims = missing and path is not None and make_folders(path.parent)
        lock = path.with_suffix(".lock").open("w") if claims and path is not None else None
    except (ImportError, OSError):
        lock = None
    if lock is None:
        yield True
        return
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True


def _external(library: Path, prefix: str) -> StageFunction:
    import casadi as ca

    found: list[Any] = [ca.external(f"{prefix}_{kind}", str(library)) for kind in KINDS]
    return StageFunction(*found)


@lru_cache(maxsize=1)
def find_compiler() -> str | None:
    """Return the C compiler; ``None`` where there is none."""
    return next((path for name in ("cc", "gcc", "clang") if (path := shutil.which(name))), None)


def _compile(compiler: str, piece: StageFunction, library: str) -> bool:
    """Compile a piece and keep the library under that name; whether that worked."""
    import casadi as ca

    name = library.rpartition("/")[2]
    try:
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / f"{name}.so"
            generator = ca.CodeGenerator(f"{name}.c")
            for kind in KINDS:
                generator.add(getattr(piece, kind))
            generator.generate(f"{made.parent}/")
            short = sum(getattr(piece, kind).n_instructions() for kind in KINDS) < LONG
            flags = () if short and name in OPTIMISED else ("-O0",)
            run_compiler(compiler, made.with_suffix(".c"), made, *flags)
            return LIBRARIES.save(library, made.read_bytes())
    except (OSError, subprocess.CalledProcessError):
        return False


def run_compiler(compiler: str, source: Path, library: Path, *flags: str) -> None:
    """Compile a file of C to a library, with ``FLAGS`` and more.

    Raises:
        OSError: the compiler cannot be run.
        subprocess.CalledProcessError: it refuses the file.
    """
    command = [compiler, *FLAGS, *flags, str(source), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, capture_output=True)


@dataclass(frozen=True)
class SolveOptions:
    """Options of every formulation beside the task and the robot.

    Attributes:
        warm_start: a plan of a near task, on any grid; one that goes through other phases is not
            used. A plan of this very task that failed the validity check is solved again on finer
            intervals (see ``solve.finer_knots``).
        progress: is told when functions are compiled, once for each robot.
        compiled: whether functions are compiled where there is a compiler.
        solver: ``fatrop`` or ``ipopt`` to insist on one of them.
        knots: numbers of intervals to use instead of the task's.
        quick: whether to give up soon: what is not found in a few iterations is not looked for.
    """

    warm_start: PlannedJump | None = None
    progress: Progress | None = None
    compiled: bool = True
    solver: str = ""
    knots: Knots | None = None
    quick: bool = False
