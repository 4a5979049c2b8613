"""Finds the general vectors that carry quaternions, which are the identity before their first value.

A vector such as the output of ``blocks.Delay`` is a quaternion where one is wired to its block, which
``infer_units`` hands on with the unit, or where it is read as one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...language.parameters import Parameters, ScalarOrVector
from ...language.quantities import UNCHECKED, InputQuantities, Quantity
from .block_check import BlockDraft
from .infer_units import inferred_outputs
from .inserted import Gather

IDENTITY = (0.0, 0.0, 0.0, 1.0)


def mark_quaternions(drafts: Mapping[str, BlockDraft]) -> None:
    """Mark the outputs that are read as quaternions, also through blocks that hand them on."""
    found = [
        source
        for draft in drafts.values()
        for port, declared in draft.inputs.items()
        for name, field in declared.signal.fields.items()
        if field.quaternion
        for source in _sources(drafts, draft, port, name)
    ]
    seen = set(found)
    for path, port, name in found:  # grows
        draft = drafts[path]
        known = draft.quantity(port, name)
        draft.quantities[f"{port}.{name}"] = replace(known, quaternion=True)
        for source in _behind(drafts, draft, f"{port}.{name}"):
            if source not in seen:
                seen.add(source)
                found.append(source)


def start_parameters(draft: BlockDraft) -> Parameters:
    """Return a block's parameters: ``initial`` is the identity where its output is a quaternion and the graph
    does not give it."""
    assert draft.block_type is not None and draft.params is not None
    info = type(draft.params).model_fields.get("initial")
    given = draft.flat.parameters.get("initial") is not None
    if info is None or info.annotation != ScalarOrVector or given or not _has_quaternion(draft):
        return draft.params
    return draft.params.model_copy(update={"initial": list(IDENTITY)})


def start_of_delay(source: BlockDraft, port: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the initial values of a delayed wire, with the identity for quaternions in general vectors."""
    identities = {}
    for name, field in source.outputs[port].signal.fields.items():
        shape = source.shape(field)
        if not field.quaternion and source.quantity(port, name).quaternion and shape is not None:
            identities[name] = np.broadcast_to(IDENTITY, shape).tolist()
    return {**identities, **values}


def _has_quaternion(draft: BlockDraft) -> bool:
    """Return whether an output is a quaternion of four numbers."""
    return any(
        draft.quantity(port, name).quaternion and draft.shape(field) == (4,)
        for port, output in draft.outputs.items()
        for name, field in output.signal.fields.items()
    )


def _sources(
    drafts: Mapping[str, BlockDraft], draft: BlockDraft, port: str, name: str
) -> Iterator[tuple[str, str, str]]:
    """Yield the general vector of four that an input's field reads, as path, port and field."""
    wire = draft.flat.wires.get(port)
    source = drafts.get(wire.source_block) if wire is not None else None
    if wire is None or source is None or wire.source_port not in source.outputs:
        return
    field = source.outputs[wire.source_port].signal.fields.get(name)
    if field is not None and not field.quaternion and (source.shape(field) or ())[-1:] == (4,):
        yield wire.source_block, wire.source_port, name
    if source.stands_for:
        yield from _behind(drafts, source, f"{wire.source_port}.{name}")


def _behind(
    drafts: Mapping[str, BlockDraft], draft: BlockDraft, output: str
) -> Iterator[tuple[str, str, str]]:
    """Yield what a block hands on to one of its outputs."""
    kind = draft.block_type
    if kind is None:
        return
    if issubclass(kind, Gather):
        target = output.partition(".")[2]
        (piece, *more) = [each for each in kind.pieces if each.target == target]
        if not more and piece.copies == ((0, 0, len(IDENTITY)),):
            yield from _sources(drafts, draft, piece.port, piece.field)
        return
    for port, declared in draft.inputs.items():
        for name, field in declared.signal.fields.items():
            if not field.inferred:
                continue
            alone = InputQuantities({f"{port}.{name}": Quantity(None, quaternion=True)})
            if (inferred_outputs(draft, alone).get(output) or UNCHECKED).quaternion:
                yield from _sources(drafts, draft, port, name)
