"""Finds blocks by the name a graph file uses, and imports only those that are used.

There are four kinds of names:

* ``blocks.LandingHeuristic``, ``hal.MujocoRobot``: a package of aloft and a class in it. By
  convention its file is ``landing_heuristic.py``; otherwise the text of all files is searched.
* ``hopping.SteeredPlan``: an extension, of aloft or of another installed package, and a class in it.
* ``package.module:Class``: a class of a module beside the graph, in the current folder, or
  wherever Python finds it.
* The name of an entry point of the group ``aloft.blocks`` of an installed package.
"""

from __future__ import annotations

import difflib
import inspect
import re
import sys
from abc import ABC
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, lru_cache
from pathlib import Path
from types import ModuleType

from .block import Block
from .block_files import blocks_in_folder, blocks_in_packages, class_files, files_of
from .errors import DeclarationError, UnknownBlockError
from .extensions import SHIPPED, extension, extensions, missing_extension, own_extensions
from .importing import BlockImportError, import_module, user_module, without_imports

PACKAGES = ("blocks", "hal")
"""The packages of the core that hold blocks."""
ENTRY_POINTS = "aloft.blocks"
"""The group in which other packages announce blocks."""

_OURS = __name__.rpartition(".runtime.")[0]
_ROOT = Path(__file__).parents[2]


def snake_case(name: str) -> str:
    """``LandingHeuristic`` -> ``landing_heuristic``, ``JointPD`` -> ``joint_pd``."""
    parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return parts.lower()


@lru_cache(maxsize=1)
def _own_blocks() -> Mapping[str, Path]:
    """Find the blocks of aloft and their files, by parsing the files without importing them."""
    return blocks_in_packages(
        {name: _ROOT / name for name in PACKAGES}
        | {each.name: each.folder for each in extensions() if each.name != "lab"}
    )


@lru_cache(maxsize=1)
def _entry_points() -> Mapping[str, str]:
    from importlib import (
        metadata,  # a twentieth of a start, and most graphs have aloft's blocks only
    )

    return {point.name: point.value for point in metadata.entry_points(group=ENTRY_POINTS)}


def known_names() -> tuple[str, ...]:
    """Return the names of all blocks of aloft and of installed packages, sorted; none is
    imported."""
    return tuple(sorted({**_own_blocks(), **_entry_points()}))


def all_blocks() -> dict[str, type[Block]]:
    """All blocks by name. Imports every one of them.

    Raises:
        BlockImportError: one cannot be imported.
    """
    return {name: find_block(name) for name in known_names()}


def block_name(block_type: type[Block]) -> str:
    """Return the name that a graph file may use for a block's class."""
    module = block_type.__module__
    package = module.removeprefix(f"{_OURS}.").partition(".")[0]
    if module.startswith(f"{_OURS}.") and package in PACKAGES:
        return f"{package}.{block_type.__name__}"
    for each in extensions():
        if each.name != "lab" and module.startswith(f"{each.package}."):
            return f"{each.name}.{block_type.__name__}"
    return f"{module.partition('@')[0]}:{block_type.__name__}"


def find_block(name: str, folder: Path | None = None) -> type[Block]:
    """Find the block class called ``name``; files in ``folder`` and in the current folder can be
    imported as modules.

    Raises:
        UnknownBlockError: there is no such block.
        BlockImportError: its module fails when imported, or the class is not a block.
    """
    known = _STAND_INS.get() or {}
    if name in known:
        return known[name]
    if ":" in name:
        module_name, _, class_name = name.partition(":")
        if not module_name or not class_name:
            raise UnknownBlockError(f"{name!r} is not of the form package.module:Class")
        return _class_of(user_module(module_name, _places(folder)), class_name, name)
    package, _, class_name = name.partition(".")
    if class_name:
        module = _own_module(package, class_name)
        if module is not None:
            return _class_of(module, class_name, name)
    point = _entry_points().get(name)
    if point is not None:
        module_name, _, class_name = point.partition(":")
        return _class_of(import_module(module_name), class_name, name)
    if class_name and package in SHIPPED and package not in own_extensions():
        raise UnknownBlockError(missing_extension(package, f"the block {name!r}"))
    raise UnknownBlockError(f"there is no block called {name!r}")


def attribute_of(package: str, name: str) -> type[Block]:
    """Return a block for the ``__getattr__`` of its package, ``aloft.blocks`` or ``aloft.hal``.

    Raises:
        AttributeError: there is none of that name.
    """
    short = package.rpartition(".")[2]
    if not name[:1].isupper() or f"{short}.{name}" not in _own_blocks():
        near = difflib.get_close_matches(f"{short}.{name}", _own_blocks(), 1)
        hint = f"; the nearest block is {near[0]}" if near and name[:1].isupper() else ""
        raise AttributeError(f"module {package!r} has no attribute {name!r}{hint}")
    return find_block(f"{short}.{name}")


_STAND_INS: ContextVar[Mapping[str, type[Block]] | None] = ContextVar("stand-ins", default=None)


@contextmanager
def stand_ins(classes: Mapping[str, type[Block]]) -> Iterator[None]:
    """Find these classes by these names, as long as this lasts, and import no user's module."""
    token = _STAND_INS.set(classes)
    try:
        with without_imports():
            yield
    finally:
        _STAND_INS.reset(token)


def find_class(name: str, folder: Path | None = None) -> object:
    """Find the object that ``module:Class`` names; files in ``folder`` and in the current folder
    can be imported as modules.

    Raises:
        UnknownBlockError: there is no such module, or it has no such name.
        BlockImportError: the module fails when imported.
    """
    module_name, _, class_name = name.partition(":")
    module = user_module(module_name, _places(folder))
    found = getattr(module, class_name, None)
    if found is None:
        raise UnknownBlockError(f"module {module_name!r} has no class {class_name!r}")
    return found


def _places(folder: Path | None) -> tuple[Path, ...]:
    """Return the folders in which a user's modules are searched for, in this order."""
    return (folder, Path()) if folder is not None else (Path(),)


@cache
def _own_module(package: str, class_name: str) -> ModuleType | None:
    """Import the module of a package of the core, or of an extension, that has the class: first the
    one that convention gives, then one whose text has it, as long as that is a block to use, then any."""
    if package in PACKAGES:
        folder, imported = _ROOT / package, f"{_OURS}.{package}"
    elif (found := extension(package)) is not None:
        folder, imported = found.folder, found.package
    else:
        return None
    stem = snake_case(class_name)
    for path in files_of(folder):
        if path.stem == stem:
            module = _import_file(path, folder, imported)
            if hasattr(module, class_name):
                return module
    if class_name in class_files(folder):
        module = _import_file(class_files(folder)[class_name], folder, imported)
        if _is_usable(getattr(module, class_name, None)):
            return module
    written = _own_blocks().get(f"{package}.{class_name}")
    return _import_file(written, folder, imported) if written is not None else None


def _is_usable(found: object) -> bool:
    """Return whether a class is one of those that ``blocks_in_packages`` finds, as far as the class shows."""
    return (
        isinstance(found, type)
        and issubclass(found, Block)
        and not found.__name__.startswith("_")
        and ABC not in found.__bases__
        and not any(getattr(each, "__isabstractmethod__", False) for each in vars(found).values())
        and bool(found.inputs or found.outputs)
        and (hasattr(found, "step") or hasattr(found, "emit"))
    )


def _import_file(path: Path, folder: Path, package: str) -> ModuleType:
    parts = path.relative_to(folder).with_suffix("").parts
    return import_module(".".join((package, *parts)).removesuffix(".__init__"))


def _class_of(module: ModuleType, class_name: str, name: str) -> type[Block]:
    found = getattr(module, class_name, None)
    if found is None:
        # Of two modules of one name, the name of one goes on with its folder.
        written = module.__name__.partition("@")[0]
        raise UnknownBlockError(f"module {written!r} has no class {class_name!r}")
    if not (isinstance(found, type) and issubclass(found, Block)):
        raise BlockImportError(f"{name} is not a block: it does not derive from aloft's Block")
    if inspect.isabstract(found):
        raise BlockImportError(f"{name} is abstract: it is there to be derived from")
    try:
        found.is_moore()
    except DeclarationError as error:
        raise BlockImportError(str(error)) from error
    return found


def nearest_names(name: str, folder: Path | None = None) -> tuple[str, ...]:
    """At most three blocks whose names resemble an unknown one, the most similar first; the class counts most.

    A name of the form ``module:Class`` means a user's own block, so a block of aloft is proposed
    only if its class has almost the same name.
    """
    package, class_name = _parts(name)
    own = ":" in name
    candidates = [(each, 0.85 if own else 0.6) for each in known_names()]
    for place in _places(folder):
        if place.resolve() == _ROOT:
            continue  # the blocks of aloft have shorter names
        candidates += [(each, 0.6) for each in blocks_in_folder(place)]
    candidates += [(each, 0.6) for each in _names_loaded(name)]
    scored: dict[str, float] = {}
    for candidate, least in candidates:
        other_package, other_class = _parts(candidate)
        similarity = _similarity(class_name, other_class)
        if similarity >= least:
            scored.setdefault(candidate, similarity + 0.2 * _similarity(package, other_package))
    ordered = sorted(scored, key=lambda each: (-scored[each], each))
    return tuple(each for each in ordered[:3] if scored[each] >= scored[ordered[0]] - 0.2)


def _parts(name: str) -> tuple[str, str]:
    parts = re.split(r"[:.\s/]+", name.strip())
    return ".".join(parts[:-1]), parts[-1]


def _similarity(a: str, b: str) -> float:
    return difflib.SequenceMatcher(None, a.lower(), b.lower()).ratio()


def _names_loaded(name: str) -> list[str]:
    module_name = name.partition(":")[0]
    values = vars(sys.modules[module_name]) if module_name in sys.modules else {}
    return [
        f"{module_name}:{attribute}"
        for attribute, value in values.items()
        if isinstance(value, type) and issubclass(value, Block) and value is not Block
    ]
