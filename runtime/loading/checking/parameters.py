"""Checks a block's parameters with pydantic and reports every error at its place in the file.

``check_parameters`` does so at loading, ``adjust`` for changes of a running graph, with the same messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from ....robots.description import RobotDescription
from ...language.block import Block
from ...language.errors import UnitError
from ...language.parameter_change import Adjustment
from ...language.parameters import Parameters, is_live, unit_of
from ...language.per_joint import BY_POSITION, by_name
from ...language.registry import block_name
from ...language.requirements import unmet_requirements
from ...language.signals import Field
from ...language.stages import Position
from ...language.units import parse_quantity
from ..flattening.flat import FlatBlock
from ..problems import Code, LoadError, Problems, fix_for_key, listing, nearest
from ..reading.nodes import (
    Entry,
    ListNode,
    MapNode,
    Node,
    ScalarNode,
    from_plain,
    kind,
    plain,
    text_of,
)
from ..reading.overrides import Override, Overrides, read_overrides

_WORDS: Mapping[str, str] = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "string": "text",
    "list": "a list",
    "tuple": "a list",
    "dict": "a mapping",
    "mapping": "a mapping",
    "model": "a mapping",
    "finite": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}


def check_parameters(
    flat: FlatBlock,
    block_type: type[Block],
    problems: Problems,
    robot: RobotDescription | None = None,
) -> Parameters | None:
    """The block's parameters; ``None`` after a problem.

    Fixes of gains by joint use the joint names of ``robot``.
    """
    model = block_type.Params
    ok = _refuse_truth_values(flat, model, problems)
    try:
        params = model.model_validate(plain(flat.parameters))
    except ValidationError as error:
        _report(flat, block_type, error.errors(include_url=False), robot, problems)
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
    for entry in flat.parameters:
        info = model.model_fields.get(entry.key)
        value = entry.value.value if isinstance(entry.value, ScalarNode) else None
        if info is not None and isinstance(value, bool) and info.annotation in (int, float):
            ok = False
            problems.add(
                Code.BAD_PARAMETER,
                f"{flat.path}.{entry.key} cannot be {kind(entry.value)}",
                entry.value.where,
                at=f"{flat.path}.{entry.key}",
                expected=_with_text("a number", model, entry.key),
                found=text_of(value),
            )
    return ok


def _refuse_beyond_64_bits(
    flat: FlatBlock, block_type: type[Block], params: Parameters, problems: Problems
) -> bool:
    """Report whole numbers that no 64 bits hold, where signals and kernels keep numbers.

    Seeds may have any size. The size of a signal is refused far earlier, by ``sizes``.
    """
    ports = (*block_type.inputs.values(), *block_type.outputs.values(), *block_type.states.values())
    sizes = {size for port in ports for f in port.signal.fields.values() for size in f.shape}
    ok = True
    for entry in flat.parameters:
        value = getattr(params, entry.key, None)
        if entry.key in sizes | {"seed"} or not isinstance(value, int):
            continue
        if not -(2**63) <= value < 2**63:
            ok = False
            problems.add(
                Code.BAD_PARAMETER,
                f"{flat.path}.{entry.key} does not fit into 64 bits",
                entry.value.where,
                at=f"{flat.path}.{entry.key}",
                expected=_with_text("a whole number below 2^63", block_type.Params, entry.key),
                found=text_of(value),
            )
    return ok


@dataclass
class _Mistake:
    """All errors of pydantic about one place; there are several where the type is a union."""

    code: Code
    place: str
    where: Position
    node: Node | None
    name: str
    expected: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    near: tuple[str, ...] = ()
    fix: str = ""


def _report(
    flat: FlatBlock,
    block_type: type[Block],
    errors: Sequence[Any],
    robot: RobotDescription | None,
    problems: Problems,
) -> None:
    model = block_type.Params
    mistakes: dict[tuple[Code, str], _Mistake] = {}
    for error in errors:
        kind_of = str(error["type"])
        steps, node, entry = _locate(flat.parameters, error["loc"])
        name = str(error["loc"][0]) if error["loc"] else ""
        if kind_of == "missing":
            missing = str(error["loc"][-1]) if error["loc"] else ""
            place = ".".join([flat.path, *steps, missing])
            found = mistakes.setdefault(
                (Code.MISSING_PARAMETER, place),
                _Mistake(Code.MISSING_PARAMETER, place, _end(node, flat), None, missing),
            )
            found.expected.append(_with_text("a value", model, name))
            found.fix = f"with: {{{missing}: ...}}" if len(error["loc"]) == 1 else f"{missing}: ..."
            continue
        place = ".".join([flat.path, *steps]).replace(".[", "[")
        if kind_of == "extra_forbidden" and entry is not None:
            legal = _siblings(model, error["loc"])
            near = nearest(entry.key, legal)
            mistakes[Code.UNKNOWN_PARAMETER, place] = _Mistake(
                Code.UNKNOWN_PARAMETER, place, entry.key_where, None, entry.key,
                [listing(legal)], [], near, _right_name(entry, near),
            )  # fmt: skip
            continue
        where = node.where if steps and node is not None else _end(node, flat)
        found = mistakes.setdefault(
            (Code.BAD_PARAMETER, place),
            _Mistake(Code.BAD_PARAMETER, place, where, node if steps else None, name),
        )
        expected, reason = _explain(error, node, _unit(model, name))
        if expected and expected not in found.expected:
            found.expected.append(expected)
        if reason and reason not in found.reasons:
            found.reasons.append(reason)
        if kind_of == BY_POSITION:
            found.fix = f"{name}: {_by_name(node, robot)}"
        if isinstance(node, ScalarNode) and isinstance(node.value, str):
            legal = tuple(w.strip("' ") for w in expected.replace(" or ", ",").split(","))
            found.near = found.near or nearest(node.value, [w for w in legal if w])
    for mistake in mistakes.values():
        if _is_explained(mistake, mistakes.values()):
            continue
        if mistake.code is Code.BAD_PARAMETER and mistake.near:
            mistake.fix = f"{mistake.name}: {mistake.near[0]}"
        if mistake.code is Code.MISSING_PARAMETER and _is_meant(mistake, mistakes.values()):
            continue  # one mistake, one problem
        _add(flat, model, mistake, problems)


def _by_name(node: Node, robot: RobotDescription | None) -> str:
    """The fix for a list of values by position: a mapping with joint names."""
    values = plain(node)
    named = by_name(values, robot) if robot is not None and isinstance(values, list) else {}
    if named:
        return text_of(named)
    names = [text_of(joint.name) for joint in robot.joints] if robot is not None else ["<joint>"]
    return "{" + ", ".join(f"{name}: ..." for name in names) + "}"


def _right_name(entry: Entry, near: Sequence[str]) -> str:
    if not near:
        return f"remove {entry.key!r}"
    return fix_for_key(entry.key, text_of(plain(entry.value)), entry.key_where, near[0])


def _is_explained(mistake: _Mistake, others: Iterable[_Mistake]) -> bool:
    """Whether a collection was refused only because of elements that other mistakes are about.

    Where the type is a number or a mapping, pydantic reports the wrong element of a mapping, and
    also that the mapping is not a number; the latter says nothing new.
    """
    return isinstance(mistake.node, (MapNode, ListNode)) and any(
        other.place.startswith((f"{mistake.place}.", f"{mistake.place}[")) for other in others
    )


def _is_meant(missing: _Mistake, mistakes: Iterable[_Mistake]) -> bool:
    """Whether a missing parameter is given under a misspelt name."""
    parent = missing.place.rpartition(".")[0]
    return any(
        other.code is Code.UNKNOWN_PARAMETER
        and other.place.rpartition(".")[0] == parent
        and other.near[:1] == (missing.name,)
        for other in mistakes
    )


def _add(flat: FlatBlock, model: type[Parameters], mistake: _Mistake, problems: Problems) -> None:
    expected = " or ".join(mistake.expected)
    found = ""
    if mistake.code is Code.MISSING_PARAMETER:
        message = f"{flat.path} ({flat.use}) needs the parameter {mistake.name!r}"
    elif mistake.code is Code.UNKNOWN_PARAMETER:
        message = f"{flat.path} ({flat.use}) has no parameter {mistake.name!r}"
        found = mistake.name
    elif mistake.node is None:
        message = f"the parameters of {flat.path} do not go together"
    else:
        found = text_of(plain(mistake.node))
        found = found if len(found) <= 80 else f"{found[:77]}..."
        message = f"{mistake.place} cannot be {found}"
    if mistake.reasons:
        message = f"{message}: {'; '.join(mistake.reasons)}"
    if mistake.code is Code.BAD_PARAMETER and expected:
        expected = _with_text(expected, model, mistake.name)
    problems.add(
        mistake.code,
        message,
        mistake.where,
        at=mistake.place,
        expected=expected,
        found=found,
        nearest=mistake.near,
        fix=mistake.fix,
    )


def _locate(root: MapNode, location: Sequence[str | int]) -> tuple[list[str], Node, Entry | None]:
    """Follow a location of pydantic as far as the file has it; such a location also names the
    members of unions, which are no keys of the file."""
    node: Node = root
    entry = None
    steps: list[str] = []
    for step in location:
        if isinstance(node, MapNode) and (found := node.get(str(step))) is not None:
            entry, node = found, found.value
            steps.append(str(step))
        elif isinstance(node, ListNode) and isinstance(step, int) and step < len(node.items):
            node, entry = node.items[step], None
            steps.append(f"[{step}]")
    return steps, node, entry


def _end(node: Node, flat: FlatBlock) -> Position:
    return node.where if node is not flat.parameters else flat.parameters.where


def _siblings(model: type[Parameters], location: Sequence[str | int]) -> tuple[str, ...]:
    """The names that are legal where the last step of ``location`` stands."""
    current: Any = model
    for step in location[:-1]:
        info = getattr(current, "model_fields", {}).get(step)
        current = info.annotation if info is not None else None
    return tuple(getattr(current, "model_fields", {}))


def _unit(model: type[Parameters], name: str) -> str:
    info = model.model_fields.get(name)
    return unit_of(info) if info else ""


def _with_text(expected: str, model: type[Parameters], name: str) -> str:
    """What is expected, with the parameter's unit and its line of text."""
    info = model.model_fields.get(name)
    unit = _unit(model, name)
    if unit and unit not in expected:
        expected = f"{expected} in {unit}"
    return f"{expected} ({info.description})" if info and info.description else expected


def _explain(error: Mapping[str, Any], node: Node, unit: str) -> tuple[str, str]:
    """What was expected, and a reason where there is more to say."""
    kind_of = str(error["type"])
    context = error.get("ctx", {})
    if kind_of in _BOUNDS:
        key, words = _BOUNDS[kind_of]
        return f"{words} {context[key]:g} {unit}".strip(), ""
    if kind_of in ("too_short", "too_long"):
        few = kind_of == "too_short"
        limit = context["min_length" if few else "max_length"]
        return f"{'at least' if few else 'at most'} {limit} values", ""
    if kind_of in ("literal_error", "enum"):
        return str(context["expected"]), ""
    if kind_of == BY_POSITION:
        return "a number for all joints, or numbers by joint name or pattern", str(error["msg"])
    if kind_of in ("value_error", "assertion_error"):
        return "", str(context.get("error", error["msg"]))
    if kind_of == "int_from_float":
        return "a whole number", ""
    word = _WORDS.get(kind_of.partition("_")[0])
    if word is None:
        return str(error["msg"]), ""
    if unit and isinstance(node, ScalarNode) and isinstance(node.value, str):
        try:
            parse_quantity(node.value, unit)
        except UnitError as reason:
            return word, str(reason)
    return word, ""


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
    """The value at an override's path."""
    for step in override.path:
        values = values.get(step) if isinstance(values, dict) else None
    return values
