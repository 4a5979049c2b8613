"""Checks one block: its declaration in Python, its fit with the graph's robot, and its size in memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from ....files.nodes import ListNode, MapNode, Node
from ....files.problems import Code, Position, Problems, listing, nearest
from ...language.block import Block, Clock, Context, Input, Output, Port, UnmetRequirement
from ...language.feedthrough import inputs_read_by_emit
from ...language.flat_graph import FlatBlock, FlatGraph
from ...language.layout import LARGEST
from ...language.parameters import Parameters
from ...language.quantities import UNCHECKED, Quantity, quantity_of
from ...language.requirements import unmet_needs, unmet_requirements
from ...language.signals import DTYPES, Field, Signal
from .settings import Settings


@dataclass
class BlockDraft:
    """A block while it is checked.

    ``complete`` is true if all its dimensions are known.
    """

    flat: FlatBlock
    block_type: type[Block] | None = None
    params: Parameters | None = None
    dimensions: Mapping[str, int] = field(default_factory=dict)
    complete: bool = False
    quantities: dict[str, Quantity] = field(default_factory=dict)
    """Unit and frame of every output, by ``port.field``; those of blocks that take any are there
    once ``infer_quantities`` has been called."""
    period_ticks: int = 1
    offset_ticks: int = 0
    stands_for: str = ""
    """Input whose wire a block puts together, where loading has inserted the block."""

    @property
    def inputs(self) -> Mapping[str, Input[Any]]:
        """The declared inputs."""
        return self.block_type.inputs if self.block_type else {}

    @property
    def outputs(self) -> Mapping[str, Output[Any]]:
        """The declared outputs."""
        return self.block_type.outputs if self.block_type else {}

    def shape(self, item: Field) -> tuple[int, ...] | None:
        """Return a field's shape in numbers, where it is known."""
        try:
            return item.resolve(self.dimensions)
        except KeyError:
            return None

    def quantity(self, port: str, field_name: str) -> Quantity:
        """Return unit and frame of an output's field; not checked where they are not known."""
        known = self.quantities.get(f"{port}.{field_name}")
        if known is None:
            known = quantity_of(self.outputs[port].signal.fields[field_name])
        return known or UNCHECKED


def check_emit(draft: BlockDraft, problems: Problems) -> None:
    """Report every input that the ``emit`` of a Moore block reads."""
    assert draft.block_type is not None
    flat = draft.flat
    for read in inputs_read_by_emit(draft.block_type):
        problems.add(
            Code.BLOCK_DECLARATION,
            f"{flat.use}: emit reads the input {read.name!r}, but what it writes must follow from "
            "the state alone",
            flat.use_where,
            at=f"{flat.path}.{read.name}",
            other=read.method,
            other_where=Position(read.file, read.line, 1),
            expected="inputs are read in update, which runs when all outputs of the tick are there",
            found=f"self.{read.name} in {read.method}",
            fix=f"read {read.name!r} in update and keep it in the state; or, if the output is to "
            "follow from it in the same tick, write step in place of emit and update",
        )


def check_defaults(draft: BlockDraft, problems: Problems) -> None:
    """Report defaults of unwired inputs that name an unknown field or have the wrong shape."""
    flat = draft.flat
    for name, port in draft.inputs.items():
        if name in flat.wires:
            continue
        for field_name, value in (port.default or {}).items():
            field = port.signal.fields.get(field_name)
            shape = draft.shape(field) if field is not None else None
            if field is None:
                message = f"{port.signal.__name__} has no field {field_name!r}"
                expected, found = listing(port.signal.fields), field_name
            elif shape is not None and np.shape(value) not in ((), shape):
                message = f"{field_name} has another shape"
                expected, found = f"{list(shape)}, or one number", str(list(np.shape(value)))
            else:
                continue
            problems.add(
                Code.BLOCK_DECLARATION,
                f"{flat.use}: the default of the input {name!r} does not fit: {message}",
                flat.use_where,
                at=f"{flat.path}.{name}",
                expected=expected,
                found=found,
                nearest=nearest(field_name, port.signal.fields) if field is None else (),
                fix=f"wire {name!r}, or correct its default in Python",
            )


def lacks_robot(draft: BlockDraft, settings: Settings) -> bool:
    """Return whether the block needs a property that the graph's robot does not have."""
    assert draft.block_type is not None
    return bool(unmet_needs(draft.block_type, settings.robot))


def check_fit(draft: BlockDraft, settings: Settings, problems: Problems) -> None:
    """Report every unmet requirement of one block, whose parameters have been checked."""
    assert draft.block_type is not None and draft.params is not None
    flat, block_type = draft.flat, draft.block_type
    asks = block_type.requires.__func__ is not Block.requires.__func__  # type: ignore[attr-defined]  # a class method
    if not asks and not block_type.needs and settings.robot is None:
        return  # as most general blocks in a graph without a robot
    context = Context(
        path=flat.path,
        clock=Clock(1.0 / (settings.base_rate or 1.0)),
        period_ticks=draft.period_ticks,
        offset_ticks=draft.offset_ticks,
        dimensions=draft.dimensions,
        robot=settings.robot,
        wired=tuple(flat.wires),
        folder=flat.folder,
        graph_folder=settings.folder,
        duration=None if settings.ticks is None else settings.ticks / (settings.base_rate or 1.0),
    )
    for requirement in unmet_requirements(block_type, draft.params, context):
        report_requirement(draft, requirement, problems)


def report_requirement(
    draft: BlockDraft, requirement: UnmetRequirement, problems: Problems
) -> None:
    """Report an unmet requirement at the parameter it concerns, or else at the block."""
    flat = draft.flat
    steps = requirement.parameter.split(".") if requirement.parameter else []
    node: Node = flat.parameters
    where = flat.where
    for step in steps:
        found = _inside(node, step)
        if found is None:
            break
        node, where = found, found.where
    problems.add(
        Code.UNMET_REQUIREMENT,
        f"{flat.path} ({flat.use}): {requirement.message}",
        where,
        at=".".join([flat.path, *steps]),
        expected=requirement.expected,
        found=requirement.found,
        nearest=requirement.nearest,
        fix=requirement.fix,
    )


def _inside(node: Node, step: str) -> Node | None:
    """Return the value under a key, or the element at an index."""
    if isinstance(node, MapNode):
        entry = node.get(step)
        return entry.value if entry else None
    if isinstance(node, ListNode) and step.isdigit() and int(step) < len(node.items):
        return node.items[int(step)]
    return None


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


def check_sizes(graph: FlatGraph, drafts: Mapping[str, BlockDraft], problems: Problems) -> bool:
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


def _arrays(draft: BlockDraft, drafts: Mapping[str, BlockDraft]) -> Iterator[_Array]:
    """Yield the arrays that a block needs: its outputs, its states whose shapes are known before it
    is set up, constants for its unwired inputs, and the buffers of delayed wires."""
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
    draft: BlockDraft,
    count: int = 1,
    where: Position | None = None,
) -> Iterator[_Array]:
    for item in signal.fields.values():
        shape = draft.shape(item)
        if shape is not None:
            size = count * prod(shape) * DTYPES[item.dtype_name].itemsize
            yield _Array(port, item, size, where)


def _report(
    graph: FlatGraph, draft: BlockDraft, largest: _Array, size: int, problems: Problems
) -> None:
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
    """Format a number of bytes in the largest unit that leaves at least 1: ``1.5 GB``."""
    units = ("B", "kB", "MB", "GB", "TB")
    power = min((len(str(size)) - 1) // 3, len(units) - 1)
    return f"{size / 1000**power:.3g} {units[power]}"
