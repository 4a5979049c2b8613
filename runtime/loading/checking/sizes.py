"""Refuses graphs whose signals would not fit into memory, such as one with ``n: 100000000000``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import prod

from ...language.block import Port
from ...language.layout import LARGEST
from ...language.signals import DTYPES, Field, Signal
from ...language.stages import Position
from ..flattening.flat import FlatGraph
from ..problems import Code, Problems
from .draft import Draft


@dataclass(frozen=True)
class _Array:
    """One array of memory that a block needs."""

    port: str
    field: Field
    size: int
    """Bytes."""
    where: Position | None = None
    """The place of the wire, if the array belongs to a delay."""

    @property
    def name(self) -> str:
        """``port.field``."""
        return f"{self.port}.{self.field.name}"


def check_sizes(graph: FlatGraph, drafts: Mapping[str, Draft], problems: Problems) -> bool:
    """Report every block whose signals are too large. Returns whether all signals fit in memory."""
    total, found = 0, len(problems)
    for draft in drafts.values():
        arrays = list(_arrays(draft, drafts))
        size = sum(array.size for array in arrays)
        total += size
        if size > LARGEST:
            draft.complete = False
            _report(graph, draft, max(arrays, key=lambda array: array.size), size, problems)
    if len(problems) == found and total > LARGEST:
        problems.add(
            Code.TOO_LARGE,
            f"the signals of all blocks together need {readable(total)} of memory",
            Position(graph.file, 1, 1),
            expected=f"at most {readable(LARGEST)}",
            found=readable(total),
        )
    return len(problems) == found


def _arrays(draft: Draft, drafts: Mapping[str, Draft]) -> Iterator[_Array]:
    """The arrays that a block needs: its outputs, its states whose shapes are known before it is
    set up, constants for its unwired inputs, and the buffers of delayed wires."""
    states = draft.block_type.states if draft.block_type is not None else {}
    for ports in (draft.outputs, states):
        for name, port in ports.items():
            yield from _of_signal(name, port.signal, draft)
    for name, reader in draft.inputs.items():
        wire = draft.flat.wires.get(name)
        if wire is None or wire.constant is not None:
            yield from _of_signal(name, reader.signal, draft)
        elif wire.delay and (source := drafts.get(wire.source_block)) is not None:
            written: Port[Signal] | None = source.outputs.get(wire.source_port)
            if written is not None:
                yield from _of_signal(name, written.signal, source, wire.delay, wire.where)


def _of_signal(
    port: str,
    signal: type[Signal],
    draft: Draft,
    count: int = 1,
    where: Position | None = None,
) -> Iterator[_Array]:
    for field in signal.fields.values():
        shape = draft.shape(field)
        if shape is not None:
            size = count * prod(shape) * DTYPES[field.dtype_name].itemsize
            yield _Array(port, field, size, where)


def _report(graph: FlatGraph, draft: Draft, largest: _Array, size: int, problems: Problems) -> None:
    """Report one block's size at the number that makes it so large: a parameter or a dimension."""
    flat = draft.flat
    shape = draft.shape(largest.field) or ()
    names = [name for name in largest.field.shape if isinstance(name, str)]
    names.sort(key=lambda name: -draft.dimensions[name])
    where, at = largest.where or flat.where, f"{flat.path}.{largest.name}"
    for name in names[:1] if largest.where is None else ():
        entry = flat.parameters.get(name)
        if entry is not None:
            where, at = entry.value.where, f"{flat.path}.{name}"
        elif graph.dimensions is not None and (given := graph.dimensions.get(name)) is not None:
            where, at = given.value.where, f"dimensions.{name}"
    problems.add(
        Code.TOO_LARGE,
        f"the signals of {flat.path} ({flat.use}) need {readable(size)} of memory",
        where,
        at=at,
        expected=f"at most {readable(LARGEST)} for all signals of a graph",
        found=f"{largest.name} of shape [{', '.join(map(str, shape))}]"
        + (", once for every period of delay" if largest.where is not None else ""),
    )


def readable(size: int) -> str:
    """A number of bytes in the largest unit that leaves at least 1: ``1.5 GB``."""
    units = ("B", "kB", "MB", "GB", "TB")
    power = min((len(str(size)) - 1) // 3, len(units) - 1)
    return f"{size / 1000**power:.3g} {units[power]}"
