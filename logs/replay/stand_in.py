"""The recorded graph to look at: blocks that need code of their own are stand-ins made from the recording.

No module that the recording names is imported and no program is loaded. A stand-in has the ports that the
block had in the recorded run; it cannot run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from importlib import import_module
from typing import Any

from ...files.nodes import MapNode
from ...files.problems import Position
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.errors import AloftError
from ...runtime.language.flat_graph import FlatBlock, FlatGraph
from ...runtime.language.registry import stand_ins
from ...runtime.language.signals import Field, Signal
from ...runtime.language.stages import CheckedGraph
from ...runtime.loading import checked_again
from ..file.code import needs_code
from ..file.format import Header, RecordedBlock


class StandIn(Block):
    """A block of a recorded graph of which the code is not run: only its ports are known."""

    def __init__(self, params: Any, context: Any) -> None:
        raise AloftError(f"{context.path} is only looked at: its code is not run")


class _MealyStandIn(StandIn):
    def step(self) -> None:
        """Never called."""


class _MooreStandIn(StandIn):
    def emit(self) -> None:
        """Never called."""

    def update(self) -> None:
        """Never called."""


def seen_graph(
    flat: FlatGraph, header: Header, files: Sequence[str], overrides: Sequence[str]
) -> CheckedGraph:
    """Check a recorded graph without running code of others.

    Args:
        flat: the recorded graph.
        header: the recording's header, which has the ports of blocks that need such code.
        files: overrides that name restored files; a stand-in needs none.
        overrides: the user's overrides.

    Raises:
        LoadError: the graph cannot be loaded any more.
        AloftError: the recording lacks the ports of such a block.
    """
    recorded = {block.path: block for block in header.blocks}
    classes: dict[str, type[Block]] = {}
    blocks = []
    for block in flat.blocks:
        if needs_code(block, header.robot):
            classes[f"recorded:{block.path}"] = stand_in(block.path, recorded.get(block.path))
            block = _without_code(block)
        blocks.append(block)
    with stand_ins(classes):
        needed = [text for text in files if f"recorded:{_block_of(text)}" not in classes]
        return checked_again(replace(flat, blocks=tuple(blocks)), [*needed, *overrides])


def _block_of(override: str) -> str:
    return override.partition("=")[0].rpartition(".")[0]


def _without_code(block: FlatBlock) -> FlatBlock:
    """Return a block of which the class is the stand-in, without its parameters."""
    nothing = MapNode((), Position(block.where.file, block.where.line, block.where.column))
    return replace(block, use=f"recorded:{block.path}", parameters=nothing)


def stand_in(path: str, block: RecordedBlock | None) -> type[Block]:
    """Make the class that stands for a recorded block. Raises ``AloftError``."""
    if block is None or block.ports is None:
        raise AloftError(
            f"the recording does not say which ports the block {path} has, whose code is not run to look "
            "at it"
        )
    ports = block.ports
    module, _, name = block.type.partition(":")
    body: dict[str, Any] = {
        "__doc__": ports.get("text") or StandIn.__doc__,
        "__module__": module,
        "outside": ports.get("outside", "no"),
    }
    for port, data in ports["inputs"].items():
        default: dict[str, Any] | None = {} if data["optional"] else None
        body[port] = Input(
            _signal(data), text=data["text"], default=default, reads_truth=data["truth"]
        )
    for port, data in ports["outputs"].items():
        body[port] = Output(
            _signal(data), text=data["text"], truth=data["truth"], absent=data["absent"]
        )
    for port, data in ports["states"].items():
        body[port] = State(_signal(data), text=data["text"])
    base = _MooreStandIn if ports["moore"] else _MealyStandIn
    return type(name.rpartition(".")[2] or "StandIn", (base,), body)


def _signal(data: Mapping[str, Any]) -> type[Signal]:
    """Make a recorded signal; it derives from that of aloft which the block's own derived from."""
    fields = {name: _field(field) for name, field in data["fields"].items()}
    own, *bases = data["signals"]
    base = next((known for name in (own, *bases) if (known := _known(name, fields))), Signal)
    body = {"__doc__": data["text"] or "A recorded signal.", **fields}
    return type(own, (base,), body)


def _known(name: str, fields: Mapping[str, Field]) -> type[Signal] | None:
    """Return the signal of aloft's vocabulary of that name, if it has no other fields."""
    signals = import_module("...blocks.signals", __package__)

    found = getattr(signals, name, None)
    if isinstance(found, type) and issubclass(found, Signal) and set(found.fields) <= set(fields):
        return found
    return None


def _field(data: Mapping[str, Any]) -> Field:
    names = {name.upper(): int(number) for number, name in data["values"].items()}
    values: Any = IntEnum("Values", names) if names else None
    return Field(
        tuple(data["shape"]), unit=data["unit"], frame=data["frame"], dtype=data["dtype"],
        text=data["text"], values=values,
    )  # fmt: skip
