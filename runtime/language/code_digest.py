"""Digests of code by its content: of a module with those beside it that it imports, of a program, and of the blocks
of a graph."""

from __future__ import annotations

import inspect
import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from hashlib import blake2b, sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from .block import Block
from .block_files import imported_files
from .stages import BlockSpec

CLASS = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*):[A-Za-z_]\w*")
"""A class of a user's module, as graphs and robots name one."""
PROGRAMS = ("*.so", "*.dll", "*.dylib", "*.json")
"""The files of an exported library that decide what it runs."""
_PACKAGE = Path(__file__).parents[2]
_RUNTIME = __name__.rpartition(".language.")[0]
_SHARED = ("blocks", "hal", "mathematics", "planner", "robots", "runtime")
"""The folders of this package whose code decides on what the blocks of a graph compute."""


def module_digest(file: Path, name: str) -> str:
    """Return the digest of a module's file and of the files beside it that it imports.

    Args:
        file: the module's file.
        name: ``package.module:Class``, which says where the root is from which it is imported.
    """
    file = file.resolve()
    depth = len(name.partition(":")[0].split(".")) - (0 if file.name == "__init__.py" else 1)
    root = file.parents[min(depth, len(file.parents) - 1)]
    own = "site-packages" not in file.parts  # an installed package is named by its module alone
    pending, known = [file], {file}
    while pending:
        more = imported_files(pending.pop(), root) if own else ()
        for each in more:
            if each.resolve() not in known:
                known.add(each.resolve())
                pending.append(each.resolve())
    digest = sha256()
    for each in sorted(known):
        content = sha256(each.read_bytes()).hexdigest()
        digest.update(f"{os.path.relpath(each, root)}\0{content}\n".encode())
    return digest.hexdigest()


def program_digest(place: Path) -> str:
    """Return the digest of a program's file, or of the programs in a folder; empty: there is none."""
    if place.is_file():
        return sha256(place.read_bytes()).hexdigest()
    digest, files = sha256(), [file for kind in PROGRAMS for file in place.glob(kind)]
    for file in sorted(files):
        digest.update(f"{file.name}\0{sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest() if files else ""


def block_code(blocks: Iterable[BlockSpec]) -> Iterator[str]:
    """Yield a line for the code behind each block, and one for each folder of this package that blocks share.

    A line names what it is of and ends with 16 digits of a digest of the source. Of an installed package of
    somebody else it is that of the block's own module; what has no source says so.
    """
    specs = tuple(blocks)
    for spec in specs:
        for kind in spec.block_type.__mro__:
            if _is_own(kind):
                yield f"code of {spec.path}, {_name(kind)}: {_class_digest(kind)}"
        for name in sorted(
            {text for text in texts(spec.params.model_dump()) if CLASS.fullmatch(text)}
        ):
            module = sys.modules.get(name.partition(":")[0])
            yield f"code of {spec.path}, {name}: {_module_digest(module, name)}"
        for name in spec.block_type.program_files:
            place = getattr(spec.params, name, None)
            digest = program_digest(spec.folder / str(place)) if place else ""
            yield f"code of {spec.path}, {place}: {digest[:16] or 'not found'}"
    for folder in _SHARED:
        yield f"code in aloft/{folder}: {_folder_digest(folder)}"


def _is_own(kind: type) -> bool:
    """Return whether a class is a block and not of the runtime, which is compared as a folder."""
    return issubclass(kind, Block) and not kind.__module__.startswith(_RUNTIME)


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def texts(value: Any) -> Iterator[str]:
    """Yield every text in plain data, also the keys."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from texts(key)
            yield from texts(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from texts(item)


@cache
def _class_digest(kind: type) -> str:
    module = sys.modules.get(kind.__module__)
    if module is None or getattr(module, "__file__", None) is None:
        try:  # a class of a notebook, or of a program that was given as text
            return sha256(inspect.getsource(kind).encode()).hexdigest()[:16]
        except (OSError, TypeError):
            return "no source"
    return _module_digest(module, _name(kind))


@cache
def _module_digest(module: ModuleType | None, name: str) -> str:
    file = Path(getattr(module, "__file__", None) or "")
    try:
        if _PACKAGE not in file.parents:
            return module_digest(file, name)[:16]
        folder = file.relative_to(_PACKAGE).parts[:2]
        if folder[0] == "extensions":  # whose blocks share what lies beside them
            return _folder_digest("/".join(folder))
        return sha256(file.read_bytes()).hexdigest()[:16]
    except OSError:
        return "no source"


@cache
def _folder_digest(folder: str) -> str:
    """Return the digest of all source files in a folder of this package."""
    digest = blake2b(digest_size=8)
    for path in sorted((_PACKAGE / folder).rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
