"""The code that a graph runs and that is not aloft's: which blocks need it, where it is, and whether it is trusted.

A recording that somebody sends may name a module beside itself, an FMU or an exported library. To run it again
would run that code. It is known by a digest of its content. The user's cache folder holds a file for each digest
that is trusted: of what his own runs executed, and of what he has allowed with ``--trust``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from ...files.cache import Cache
from ...files.nodes import plain
from ...robots.robot_description import RobotDescription
from ...runtime.language.block import Block
from ...runtime.language.block_files import imported_files
from ...runtime.language.errors import AloftError
from ...runtime.language.flat_graph import FlatBlock, FlatGraph
from ...runtime.language.importing import find_source, without_imports
from ...runtime.language.registry import find_block

_CLASS = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*):[A-Za-z_]\w*")
"""A class of a user's module, as graphs and robots name one."""
TRUSTED = Cache("trusted")
PROGRAMS = ("*.so", "*.dll", "*.dylib", "*.json")
"""The files of an exported library that decide what it runs."""


class UntrustedCodeError(AloftError):
    """Raised where a recording would run code that the user has not run and not allowed yet."""


@dataclass(frozen=True)
class Code:
    """Some code: the ``block`` that needs it, its ``name`` in the graph, the ``place`` it would be run from, and
    the SHA-256 of its content; of a module with those beside it that it imports."""

    block: str
    name: str
    place: Path
    digest: str

    def __str__(self) -> str:
        return f"{self.name} of {self.block}, from {self.place} (SHA-256 {self.digest[:16]})"


def needs_code(block: FlatBlock, robot: RobotDescription | None = None) -> bool:
    """Return whether a block needs code that is not aloft's; nothing is imported to find out."""
    return bool(_classes(block, robot)) or bool(_programs(block))


def _classes(block: FlatBlock, robot: RobotDescription | None) -> list[str]:
    """Return the ``module:Class`` of a block itself, of its parameters and of the sensors that a robot carries."""
    found = [block.use] if ":" in block.use else []
    found += [text for text in _texts(plain(block.parameters)) if _CLASS.fullmatch(text)]
    kind = _type_of(block)
    if kind is not None and kind.outside != "no" and robot is not None:
        found += [m.kind for m in robot.sensors.mounted.values() if ":" in m.kind]
    return found


def _programs(block: FlatBlock) -> list[str]:
    """Return what a block's parameters name and the block runs as a program."""
    kind = _type_of(block)
    given = plain(block.parameters) if kind is not None and kind.program_files else {}
    names = kind.program_files if kind is not None else ()
    return [str(given[name]) for name in names if given.get(name)]


def _type_of(block: FlatBlock) -> type[Block] | None:
    """Return the class of a block of aloft or of an installed extension; ``None`` for another."""
    if ":" in block.use:
        return None
    try:
        with without_imports():
            return find_block(block.use, block.folder)
    except AloftError:
        return None


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in plain data, also the keys."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _texts(key)
            yield from _texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from _texts(item)


def code_of(graph: FlatGraph, robot: RobotDescription | None = None) -> list[Code]:
    """Return the code that a graph would run, each piece once; what is not there is left out.

    Args:
        graph: the flat graph, with the files that it would use.
        robot: its robot.
    """
    found: dict[tuple[str, str], Code] = {}
    for block in graph.blocks:
        folders = (block.folder, graph.folder, Path())
        for name in _classes(block, robot):
            file = find_source(name.partition(":")[0], folders)
            if file is not None and (name, digest := module_digest(file, name)) not in found:
                found[name, digest] = Code(block.path, name, file, digest)
        for name in _programs(block):
            place = block.folder / name
            digest = _program_digest(place)
            if digest:
                found.setdefault((name, digest), Code(block.path, name, place, digest))
    return list(found.values())


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


def _program_digest(place: Path) -> str:
    """Return the digest of a program's file, or of the programs in a folder; empty: there is none."""
    if place.is_file():
        return sha256(place.read_bytes()).hexdigest()
    digest, files = sha256(), [file for kind in PROGRAMS for file in place.glob(kind)]
    for file in sorted(files):
        digest.update(f"{file.name}\0{sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest() if files else ""


def is_trusted(code: Code) -> bool:
    """Return whether the user has run this code, or allowed it."""
    return TRUSTED.load(code.digest) is not None


def remember(codes: Iterable[Code]) -> None:
    """Trust this code from now on. A cache folder that cannot be written is no error: it is asked for again."""
    for code in codes:
        if not is_trusted(code):
            TRUSTED.save(code.digest, b"")


def expect_trusted(codes: Sequence[Code], recording: Path) -> None:
    """Raise ``UntrustedCodeError`` with all code that the user has neither run nor allowed."""
    unknown = [code for code in codes if not is_trusted(code)]
    if unknown:
        listed = "; ".join(map(str, unknown))
        raise UntrustedCodeError(
            f"{recording} would run code that is not aloft's and that you have not run before: {listed}. Nothing was "
            "run. If you trust all of it, add --trust, which is remembered for this content"
        )
