"""Checks a block's parameters with pydantic and reports every error at its place in the file.

``check_parameters`` does so at loading, ``adjust`` for changes of a running graph, with the same messages.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from ....files.nodes import (
    MapNode,
    Node,
    ScalarNode,
    from_plain,
    kind,
    plain,
    text_of,
)
from ....files.problems import Code, LoadError, Position, Problems, listing, nearest
from ....files.validation import find_mistakes, path_text, unit_of, with_unit
from ....robots.description import RobotDescription
from ...language.block import Block
from ...language.flat_graph import FlatBlock
from ...language.parameter_change import Adjustment
from ...language.parameters import Parameters, declared_fields, group_of, is_live
from ...language.per_joint import BY_POSITION, by_name
from ...language.registry import block_name
from ...language.requirements import unmet_requirements
from ...language.signals import Field
from ..reading.overrides import Override, Overrides, read_overrides


def check_parameters(
    flat: FlatBlock,
    block_type: type[Block],
    problems: Problems,
    robot: RobotDescription | None = None,
) -> Parameters | None:
    """Check and return the block's parameters; ``None`` after a problem.

    Fixes of gains by joint use the joint names of ``robot``.
    """
    model = block_type.Params
    ok = _refuse_truth_values(flat, model, problems)
    try:
        params = model.model_validate(plain(flat.parameters))
    except ValidationError as error:
        _report(flat, block_type, error, robot, problems)
        return None
    except Exception as error:  # noqa: BLE001  a check of the user's own failed
        problems.add(
            Code.BLOCK_DECLARATION,
            f"checking the parameters of {flat.path} failed: {type(error).__name__}: {error}",
            flat.parameters.where,
            at=flat.path,
        )
        return None
    ok &= _refuse_beyond_64_bits(flat, block_type, params, problems)
    return params if ok else None


def _refuse_truth_values(flat: FlatBlock, model: type[Parameters], problems: Problems) -> bool:
    """Report ``true`` or ``false`` in place of a number, which pydantic would take for 1 or 0."""
    ok = True
    numbers = _numbers(model)
    for path, node in _values(flat.parameters):
        info, value = numbers.get(path), node.value
        if info is not None and isinstance(value, bool):
            ok = False
            problems.add(
                Code.BAD_PARAMETER,
                f"{flat.path}.{path} cannot be {kind(node)}",
                node.where,
                at=f"{flat.path}.{path}",
                expected=_with_text("a number", info),
                found=text_of(value),
            )
    return ok


@lru_cache(maxsize=1024)
def _numbers(model: type[Parameters]) -> Mapping[str, FieldInfo]:
    """Return the parameters that are single numbers, by path."""
    return {n: info for n, info in declared_fields(model) if info.annotation in (int, float)}


def _values(node: MapNode, prefix: str = "") -> Iterator[tuple[str, ScalarNode]]:
    """Yield the single values in a mapping and in those within it, by path."""
    for entry in node:
        if isinstance(entry.value, MapNode):
            yield from _values(entry.value, f"{prefix}{entry.key}.")
        elif isinstance(entry.value, ScalarNode):
            yield f"{prefix}{entry.key}", entry.value


def _refuse_beyond_64_bits(
    flat: FlatBlock, block_type: type[Block], params: Parameters, problems: Problems
) -> bool:
    """Report whole numbers that no 64 bits hold, where signals and kernels keep numbers.

    Seeds may have any size. The size of a signal is refused far earlier, by ``sizes``.
    """
    ok = True
    for entry in flat.parameters:
        value = getattr(params, entry.key, None)
        if not isinstance(value, int) or entry.key == "seed" or -(2**63) <= value < 2**63:
            continue
        if entry.key not in _sizes(block_type):
            ok = False
            problems.add(
                Code.BAD_PARAMETER,
                f"{flat.path}.{entry.key} does not fit into 64 bits",
                entry.value.where,
                at=f"{flat.path}.{entry.key}",
                expected=_with_text(
                    "a whole number below 2^63", block_type.Params.model_fields.get(entry.key)
                ),
                found=text_of(value),
            )
    return ok


def _sizes(block_type: type[Block]) -> set[str | int]:
    """Return the sizes of a block's ports and states."""
    ports = (*block_type.inputs.values(), *block_type.outputs.values(), *block_type.states.values())
    return {size for port in ports for f in port.signal.fields.values() for size in f.shape}


def _report(
    flat: FlatBlock,
    block_type: type[Block],
    error: ValidationError,
    robot: RobotDescription | None,
    problems: Problems,
) -> None:
    """Report every mistake that pydantic has found."""
    model = block_type.Params
    for mistake in find_mistakes(error, model, flat.parameters):
        name = str(mistake.location[0]) if mistake.location else ""
        info = _declaration(model, mistake.location)
        place = ".".join([flat.path, *([path_text(mistake.path)] if mistake.path else [])])
        expected = " or ".join(mistake.expected)
        if mistake.code is Code.MISSING_PARAMETER:
            message = f"{flat.path} ({flat.use}) needs the parameter {mistake.key!r}"
            expected = _with_text(expected, info)
            if len(mistake.path) == 1:
                mistake.fix = f"with: {{{mistake.key}: ...}}"
        elif mistake.code is Code.UNKNOWN_PARAMETER:
            message = f"{flat.path} ({flat.use}) has no parameter {mistake.key!r}"
        elif mistake.node is None:
            message = f"the parameters of {flat.path} do not go together"
        else:
            message = f"{place} cannot be {mistake.found}"
            if BY_POSITION in mistake.kinds:
                mistake.fix = f"{name}: {_by_name(mistake.node, robot)}"
        if mistake.reasons:
            message = f"{message}: {'; '.join(mistake.reasons)}"
        if mistake.code is Code.BAD_PARAMETER and expected:
            expected = _with_text(expected, info)
        problems.add(
            mistake.code,
            message,
            mistake.where,
            at=place,
            expected=expected,
            found=mistake.found,
            nearest=mistake.nearest,
            fix=mistake.fix,
        )


def _by_name(node: Node, robot: RobotDescription | None) -> str:
    """Return the fix for a list of values by position: a mapping with joint names."""
    values = plain(node)
    named = by_name(values, robot) if robot is not None and isinstance(values, list) else {}
    if named:
        return text_of(named)
    names = [text_of(joint.name) for joint in robot.joints] if robot is not None else ["<joint>"]
    return "{" + ", ".join(f"{name}: ..." for name in names) + "}"


def _declaration(model: type[Parameters], location: Sequence[str | int]) -> FieldInfo | None:
    """Return the declaration of the parameter at a location, which may be in a group."""
    info = None
    for name in location:
        info = model.model_fields.get(str(name), info)
        group = None if info is None else group_of(info)
        if group is None:
            break
        model = group
    return info


def _with_text(expected: str, info: FieldInfo | None) -> str:
    """Return the expectation, with the parameter's unit and its line of text."""
    expected = with_unit(expected, unit_of(info))
    return f"{expected} ({info.description})" if info and info.description else expected


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
    return params.model_dump(mode="json", round_trip=True, by_alias=True)


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
    """Return whether there is such a parameter, and it is live."""
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
    """Return whether the block still fits its robot, and all its ports keep their sizes.

    A port of another size would need another layout of the graph's memory.
    """
    kind, context = type(block), block.context
    sizes = {**context.dimensions, **kind.dimensions(params, context.robot)}
    for requirement in unmet_requirements(kind, params, context):
        place = f"{path}.{requirement.parameter}" if requirement.parameter else path
        problems.add(
            Code.UNMET_REQUIREMENT, f"{path}: {requirement.message}", where, at=place, expected=requirement.expected,
            found=requirement.found, nearest=requirement.nearest, fix=requirement.fix,
        )  # fmt: skip
        return False
    for port in {**kind.inputs, **kind.outputs, **kind.states}.values():
        for name, item in port.signal.fields.items():
            if _shape(item, sizes) != _shape(item, context.dimensions):
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
    """Return the value at an override's path."""
    for step in override.path:
        values = values.get(step) if isinstance(values, dict) else None
    return values
