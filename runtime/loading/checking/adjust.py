"""Checks changes of a running graph's parameters, with the same messages as at loading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...language.block import Block
from ...language.fit import find_misfits
from ...language.parameter_change import Adjustment
from ...language.parameters import Parameters, is_live, unit_of
from ...language.registry import block_name
from ...language.signals import Field
from ...language.stages import Position
from ..flattening.flat import FlatBlock
from ..problems import Code, LoadError, Problems, listing, nearest
from ..reading.nodes import MapNode, from_plain
from ..reading.overrides import Override, Overrides, read_overrides
from .parameter_check import check_parameters

_PLACE = Position("the running graph", 0, 0)


@dataclass(frozen=True)
class ParameterEntry:
    """One parameter as it is now; ``value`` is plain data in ``unit``."""

    path: str
    value: Any
    unit: str
    live: bool
    text: str


def entries(blocks: Mapping[str, Block]) -> tuple[ParameterEntry, ...]:
    """All parameters of some blocks, in file order; blocks that loading inserted are left out."""
    return tuple(
        ParameterEntry(
            f"{path}.{name}", value, unit_of(fields[name]), is_live(fields[name]),
            fields[name].description or "",
        )
        for path, block in blocks.items()
        if "~" not in path
        for fields in (type(block.params).model_fields,)
        for name, value in plain_parameters(block.params).items()
    )  # fmt: skip


def plain_parameters(params: Parameters) -> dict[str, Any]:
    """Parameters as plain data, as a graph file has them; reading them back gives the same."""
    return params.model_dump(mode="json", round_trip=True)


def adjust(blocks: Mapping[str, Block], settings: Overrides) -> Adjustment:
    """Check new values of parameters and make the adjustment to hand to the running graph.

    Args:
        blocks: the blocks of the graph, by path.
        settings: ``{"landing.w_c": 0.05}`` or ``["landing.w_c=0.05"]``.

    Raises:
        LoadError: a setting is wrong; the error carries the report of all problems.
    """
    problems = Problems()
    by_block: dict[str, list[Override]] = {}
    for override in read_overrides(settings, problems):
        if _may_be_set(override, blocks, problems):
            by_block.setdefault(override.block, []).append(override)
    params: dict[str, Parameters] = {}
    values: dict[str, tuple[str, Any, Any]] = {}
    for path, overrides in by_block.items():
        block = blocks[path]
        old = plain_parameters(block.params)
        node = from_plain(old, _PLACE)
        assert isinstance(node, MapNode)
        for override in overrides:
            node = node.assign(override.path, override.value, override.where)
        checked = check_parameters(
            _flat(path, block, node), type(block), problems, block.context.robot
        )
        if checked is None or not _fits(path, block, checked, overrides[0].where, problems):
            continue
        params[path] = checked
        new = plain_parameters(checked)
        for override in overrides:
            values[override.key] = (override.key, _at(old, override), _at(new, override))
    if len(problems):
        raise LoadError(problems.report("the running graph"))
    return Adjustment(params, tuple(values.values()))


def _may_be_set(override: Override, blocks: Mapping[str, Block], problems: Problems) -> bool:
    """Whether there is such a parameter, and it is live."""
    known = [path for path in blocks if "~" not in path]
    if override.block not in known:
        near = nearest(override.block, known)
        problems.add(
            Code.OVERRIDE,
            f"there is no block {override.block!r} in the running graph"
            if override.block
            else f"{override.key} belongs to the graph, which cannot change while it runs",
            override.where,
            at=override.key,
            expected=listing(known) if override.block else "block.parameter=value",
            found=override.block,
            nearest=near,
        )
        return False
    fields = type(blocks[override.block].params).model_fields
    name = override.path[0]
    if name not in fields or is_live(fields[name]):
        return True  # check_parameters reports an unknown parameter
    live = [key for key, info in fields.items() if is_live(info)]
    problems.add(
        Code.OVERRIDE,
        f"{override.block}.{name} cannot be changed while the graph runs",
        override.where,
        at=f"{override.block}.{name}",
        expected=f"a live parameter of this block: {listing(live)}",
        found=name,
        fix=f"stop the run, and start it with --set {override.key}=...",
    )
    return False


def _flat(path: str, block: Block, parameters: MapNode) -> FlatBlock:
    return FlatBlock(
        path, _PLACE, block_name(type(block)), _PLACE, block.context.folder, parameters
    )


def _fits(path: str, block: Block, params: Parameters, where: Position, problems: Problems) -> bool:
    """Whether the block still fits its robot, and all its ports keep their sizes.

    A port of another size would need another layout of the graph's memory.
    """
    kind, context = type(block), block.context
    sizes = {**context.dimensions, **kind.local_dimensions(params, context.robot)}
    for misfit in find_misfits(kind, params, context):
        place = f"{path}.{misfit.parameter}" if misfit.parameter else path
        problems.add(
            Code.MISFIT, f"{path}: {misfit.message}", where, at=place, expected=misfit.expected,
            found=misfit.found, nearest=misfit.nearest, fix=misfit.fix,
        )  # fmt: skip
        return False
    for port in {**kind.inputs, **kind.outputs, **kind.states}.values():
        for name, field in port.signal.fields.items():
            if _shape(field, sizes) != _shape(field, context.dimensions):
                problems.add(
                    Code.DIMENSION,
                    f"this would change the size of {path}.{port.name}.{name}",
                    where,
                    at=path,
                    fix="stop the run, and start it with --set",
                )
                return False
    return True


def _shape(field: Field, sizes: Mapping[str, int]) -> tuple[int | None, ...]:
    return tuple(size if isinstance(size, int) else sizes.get(size) for size in field.shape)


def _at(values: Any, override: Override) -> Any:
    """The value at an override's path."""
    for step in override.path:
        values = values.get(step) if isinstance(values, dict) else None
    return values
