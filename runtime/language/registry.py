"""Finds blocks by the name a graph file uses, and imports only those that are used.

Three kinds of names:

* ``blocks.LandingHeuristic``, ``hal.MujocoRobot``, ``blocks.Constant``: one of our packages and
  the class; the file is ``landing_heuristic.py`` by convention, otherwise found by a scan;
* ``package.module:Class``: any importable class, also from a file beside the graph;
* the name of an entry point of the group ``aloft.blocks`` of an installed package.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.util
import inspect
import re
import sys
import traceback
from collections.abc import Mapping
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from types import ModuleType

from .block import Block
from .errors import AloftError, DeclarationError, UnknownBlockError

PACKAGES = ("blocks", "hal", "runtime")
"""Our packages that hold blocks."""
ENTRY_POINTS = "aloft.blocks"
"""The group in which other packages announce blocks."""

MOVED = {
    "hal.JumpScore": "blocks.JumpScore",
    "hal.EstimatorScore": "blocks.EstimatorScore",
    "runtime.Constant": "blocks.Constant",
    "runtime.Gain": "blocks.Gain",
    "runtime.Integrator": "blocks.Integrator",
    "runtime.SineWave": "blocks.SineWave",
    "runtime.Sum": "blocks.Sum",
    "runtime.UnitDelay": "blocks.UnitDelay",
}
"""What blocks were called before version 0.2, and what they are called now."""

_OURS = __name__.rpartition(".runtime.")[0]
_ROOT = Path(__file__).parents[2]
_CLASS = re.compile(r"^class\s+(\w+)\s*\(([^)]*)\)\s*:(.*?)(?=^\S|\Z)", re.MULTILINE | re.DOTALL)
_MACHINE = re.compile(r"^    def (?:step|emit)\(", re.MULTILINE)
_PORT = re.compile(r"^    \w+ = (?:Input|Output)\(", re.MULTILINE)
_ABSTRACT = re.compile(r"^    @abstractmethod$", re.MULTILINE)


class BlockImportError(AloftError):
    """A block's module or class cannot be used; the message is one line, ``where`` its origin."""

    def __init__(self, message: str, where: str = "") -> None:
        super().__init__(message)
        self.where = where


def snake_case(name: str) -> str:
    """``LandingHeuristic`` -> ``landing_heuristic``, ``JointPD`` -> ``joint_pd``."""
    parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return parts.lower()


@lru_cache(maxsize=1)
def _scan() -> Mapping[str, str]:
    """Our blocks and their modules, by reading the files and importing none."""
    found: dict[str, str] = {}
    classes: list[tuple[str, str, str, list[str], frozenset[str]]] = []
    for package in PACKAGES:
        for path in sorted((_ROOT / package).rglob("*.py")):
            parts = (_OURS, *path.relative_to(_ROOT).with_suffix("").parts)
            module = ".".join(parts).removesuffix(".__init__")
            for name, bases, body in _CLASS.findall(path.read_text(encoding="utf-8")):
                parents = [b.split("[")[0].rpartition(".")[2].strip() for b in bases.split(",")]
                patterns = (("machine", _MACHINE), ("port", _PORT), ("abstract", _ABSTRACT))
                has = frozenset(what for what, pattern in patterns if pattern.search(body))
                classes.append((package, name, module, parents, has))
    # A class is a block if it derives from one, however far away; it can be used if it, or one of
    # those it derives from, has a machine's methods and a port, and it leaves nothing abstract.
    known: dict[str, frozenset[str]] = {"Block": frozenset()}
    while True:
        new = [c for c in classes if c[1] not in known and any(p in known for p in c[3])]
        if not new:
            break
        for package, name, module, parents, own in new:
            known[name] = own.union(*(known.get(parent, frozenset()) for parent in parents))
            complete = known[name] >= {"machine", "port"} and "abstract" not in own
            if complete and not name.startswith("_"):
                found.setdefault(f"{package}.{name}", module)
    return dict(sorted(found.items()))


@lru_cache(maxsize=1)
def _entry_points() -> Mapping[str, str]:
    return {point.name: point.value for point in metadata.entry_points(group=ENTRY_POINTS)}


def known_names() -> tuple[str, ...]:
    """The names of all blocks of ours and of installed packages, sorted; imports none of them."""
    return tuple(sorted({**_scan(), **_entry_points()}))


def all_blocks() -> dict[str, type[Block]]:
    """All blocks by name. Imports every one of them.

    Raises:
        BlockImportError: one cannot be imported.
    """
    return {name: find_block(name) for name in known_names()}


def block_name(block_type: type[Block]) -> str:
    """The name a graph file may use for that class."""
    module = block_type.__module__
    package = module.removeprefix(f"{_OURS}.").partition(".")[0]
    if module.startswith(f"{_OURS}.") and package in PACKAGES:
        return f"{package}.{block_type.__name__}"
    return f"{module.partition('@')[0]}:{block_type.__name__}"


def find_block(name: str, folder: Path | None = None) -> type[Block]:
    """The block class called ``name``; files in ``folder`` can be imported as modules.

    Raises:
        UnknownBlockError: there is no such block; the message names the nearest ones.
        BlockImportError: its module fails when imported, or the class is not a block.
    """
    if ":" in name:
        module_name, _, class_name = name.partition(":")
        return _class_of(_user_module(module_name, folder, name), class_name, name)
    package, _, class_name = name.partition(".")
    if package in PACKAGES and class_name:
        module = _own_module(package, class_name)
        if module is not None:
            return _class_of(module, class_name, name)
    if name in MOVED:
        raise UnknownBlockError(f"{name} has been called {MOVED[name]} since version 0.2")
    point = _entry_points().get(name)
    if point is not None:
        module_name, _, class_name = point.partition(":")
        return _class_of(_import(module_name), class_name, name)
    raise UnknownBlockError(f"there is no block called {name!r}")


def find_class(name: str, folder: Path | None = None) -> object:
    """What ``module:Class`` names; files in ``folder`` can be imported as modules.

    Raises:
        UnknownBlockError: there is no such module, or it has no such name.
        BlockImportError: the module fails when imported.
    """
    module_name, _, class_name = name.partition(":")
    module = _user_module(module_name, folder, name)
    found = getattr(module, class_name, None)
    if found is None:
        raise UnknownBlockError(f"module {module_name!r} has no class {class_name!r}")
    return found


def _own_module(package: str, class_name: str) -> ModuleType | None:
    """The module of ours that has the class: the one by convention, or any other."""
    file = f"{snake_case(class_name)}.py"
    for path in sorted((_ROOT / package).rglob(file)) if class_name.isidentifier() else ():
        module = _import(".".join((_OURS, *path.relative_to(_ROOT).with_suffix("").parts)))
        if hasattr(module, class_name):
            return module
    scanned = _scan().get(f"{package}.{class_name}")
    return _import(scanned) if scanned else None


def _user_module(module_name: str, folder: Path | None, name: str) -> ModuleType:
    """A module from a file in ``folder``, else from anywhere Python finds it."""
    if not module_name or not all(part.isidentifier() for part in module_name.split(".")):
        raise UnknownBlockError(f"{name!r} is not of the form package.module:Class")
    file = None
    if folder is not None:
        base = folder.resolve().joinpath(*module_name.split("."))
        files = (base.with_name(f"{base.name}.py"), base / "__init__.py")
        file = next((candidate for candidate in files if candidate.is_file()), None)
    if file is None:
        return _import(module_name)
    present = sys.modules.get(module_name)
    if present is None and folder is not None:
        # At the end, so that a file beside a graph never hides an installed package from others.
        if str(folder.resolve()) not in sys.path:
            sys.path.append(str(folder.resolve()))
            importlib.invalidate_caches()
        if _is_importable(module_name.partition(".")[0], folder.resolve()):
            return _import(module_name)
    if present is not None and _same_file(present, file):
        return present
    return _import_file(f"{module_name}@{file.parent}", file)


def _is_importable(top: str, folder: Path) -> bool:
    """Whether importing ``top`` gives the module or package in that folder, and no other."""
    try:
        spec = importlib.util.find_spec(top)
    except ValueError:  # a module without a spec, such as __main__
        return False
    if spec is None:
        return False
    places = [*(spec.submodule_search_locations or ()), spec.origin or ""]
    ours = (folder / top, folder / f"{top}.py")
    return any(Path(place).resolve() in ours for place in places if place)


def _same_file(module: ModuleType, file: Path) -> bool:
    origin = getattr(module, "__file__", None)
    return origin is not None and Path(origin).resolve() == file


def _import_file(key: str, file: Path) -> ModuleType:
    """A file whose module name is taken by another file, under a name of its own."""
    if key in sys.modules:
        return sys.modules[key]
    spec = importlib.util.spec_from_file_location(key, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[key] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[key]
        raise _import_error(file.stem, error) from error
    return module


def _import(module_name: str) -> ModuleType:
    try:
        return importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # whatever a user's module may raise
        raise _import_error(module_name, error) from error


def _import_error(module_name: str, error: BaseException) -> AloftError:
    """What to raise for a module that failed: it is not there, or it is broken."""
    last = traceback.format_exception_only(error)[-1].strip()
    if isinstance(error, SyntaxError):
        return BlockImportError(last, f"{error.filename}:{error.lineno}:{error.offset}")
    if isinstance(error, ModuleNotFoundError) and f"{module_name}.".startswith(f"{error.name}."):
        return UnknownBlockError(f"there is no module {module_name!r}")
    frames = traceback.extract_tb(error.__traceback__)
    outside = [f for f in frames if "importlib" not in f.filename and f.filename != __file__]
    where = f"{outside[-1].filename}:{outside[-1].lineno}" if outside else ""
    return BlockImportError(last, where)


def _class_of(module: ModuleType, class_name: str, name: str) -> type[Block]:
    found = getattr(module, class_name, None)
    if found is None:
        raise UnknownBlockError(f"module {module.__name__!r} has no class {class_name!r}")
    if not (isinstance(found, type) and issubclass(found, Block)):
        raise BlockImportError(f"{name} is not a block: it does not derive from aloft's Block")
    if inspect.isabstract(found):
        raise BlockImportError(f"{name} is abstract: it is there to be derived from")
    try:
        found.is_moore()
    except DeclarationError as error:
        raise BlockImportError(str(error)) from error
    return found


def nearest_names(name: str, folder: Path | None = None, count: int = 3) -> tuple[str, ...]:
    """Blocks whose names are like an unknown one, the likeliest first; the class counts most."""
    if name in MOVED:
        return (MOVED[name],)
    candidates = [*known_names(), *_names_beside(folder), *_names_loaded(name)]
    package, class_name = _parts(name)
    scored = []
    for candidate in dict.fromkeys(candidates):
        other_package, other_class = _parts(candidate)
        score = _likeness(class_name, other_class)
        if score >= 0.6:
            scored.append((-score - 0.2 * _likeness(package, other_package), candidate))
    scored.sort()
    return tuple(name for score, name in scored[:count] if score <= scored[0][0] + 0.2)


def _parts(name: str) -> tuple[str, str]:
    parts = re.split(r"[:.\s/]+", name.strip())
    return ".".join(parts[:-1]), parts[-1]


def _likeness(a: str, b: str) -> float:
    return difflib.SequenceMatcher(None, a.lower(), b.lower()).ratio()


def _names_beside(folder: Path | None) -> list[str]:
    """Blocks in the files of a folder, found without importing them."""
    names = []
    for path in sorted(folder.glob("*.py")) if folder is not None else ():
        for class_name, bases, _ in _CLASS.findall(
            path.read_text(encoding="utf-8", errors="replace")
        ):
            if any(base.strip().endswith("Block") for base in bases.split(",")):
                names.append(f"{path.stem}:{class_name}")
    return names


def _names_loaded(name: str) -> list[str]:
    module_name = name.partition(":")[0]
    values = vars(sys.modules[module_name]) if module_name in sys.modules else {}
    return [
        f"{module_name}:{attribute}"
        for attribute, value in values.items()
        if isinstance(value, type) and issubclass(value, Block) and value is not Block
    ]
