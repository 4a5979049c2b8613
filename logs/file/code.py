"""The code that a graph runs and that is not aloft's: which blocks need it, where it is, and whether it is trusted.

A recording that somebody sends may name a module beside itself, an FMU or an exported library. To run it again
would run that code. It is known by a digest of its content. The user's cache folder holds a file for each digest
that is trusted: of what his own runs executed, and of what he has allowed with ``--trust``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...files.cache import Cache
from ...files.nodes import plain
from ...robots.robot_description import RobotDescription
from ...runtime.language.block import Block
from ...runtime.language.code_digest import CLASS, module_digest, program_digest, texts
from ...runtime.language.errors import AloftError
from ...runtime.language.flat_graph import FlatBlock, FlatGraph
from ...runtime.language.importing import find_source, without_imports
from ...runtime.language.registry import find_block

TRUSTED = Cache("trusted")


class UntrustedCodeError(AloftError):
    """Raised where a recording would run code that the user has not run and not allowed yet."""


@dataclass(frozen=True)
class NeededCode:
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
    found += [text for text in texts(plain(block.parameters)) if CLASS.fullmatch(text)]
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


def code_of(graph: FlatGraph, robot: RobotDescription | None = None) -> list[NeededCode]:
    """Return the code that a graph would run, each piece once; what is not there is left out.

    Args:
        graph: the flat graph, with the files that it would use.
        robot: its robot.
    """
    found: dict[tuple[str, str], NeededCode] = {}
    for block in graph.blocks:
        folders = (block.folder, graph.folder, Path())
        for name in _classes(block, robot):
            file = find_source(name.partition(":")[0], folders)
            if file is not None and (name, digest := module_digest(file, name)) not in found:
                found[name, digest] = NeededCode(block.path, name, file, digest)
        for name in _programs(block):
            place = block.folder / name
            digest = program_digest(place)
            if digest:
                found.setdefault((name, digest), NeededCode(block.path, name, place, digest))
    return list(found.values())


def is_trusted(code: NeededCode) -> bool:
    """Return whether the user has run this code, or allowed it."""
    return TRUSTED.load(code.digest) is not None


def remember(codes: Iterable[NeededCode]) -> None:
    """Trust this code from now on. A cache folder that cannot be written is no error: it is asked for again."""
    for code in codes:
        if not is_trusted(code):
            TRUSTED.save(code.digest, b"")


def expect_trusted(codes: Sequence[NeededCode], recording: Path) -> None:
    """Raise ``UntrustedCodeError`` with all code that the user has neither run nor allowed."""
    unknown = [code for code in codes if not is_trusted(code)]
    if unknown:
        listed = "; ".join(map(str, unknown))
        raise UntrustedCodeError(
            f"{recording} would run code that is not aloft's and that you have not run before: {listed}. Nothing was "
            "run. If you trust all of it, add --trust, which is remembered for this content"
        )
