"""Checks every wire: both ends exist, and each field that is written is the field that is read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ....files.nodes import text_of
from ....files.problems import Code, Problems, listing, nearest
from ...language.block import Input, Output
from ...language.flat_graph import FlatGraph, FlatWire
from ...language.quantities import UNCHECKED, Quantity, quantity_of
from ...language.signals import Field, Signal
from ...language.unit_algebra import over
from ...language.units import Unit
from .block_check import BlockDraft


class WireCheck:
    """Checks the wires of a graph, one block at a time."""

    def __init__(
        self, graph: FlatGraph, drafts: Mapping[str, BlockDraft], problems: Problems
    ) -> None:
        self.graph = graph
        self.drafts = drafts
        self.problems = problems
        self._similar: dict[str, tuple[str, ...]] = {}

    @cached_property
    def _known(self) -> list[str]:
        """All blocks and sub-graphs that a wire may name."""
        known = [path for path, draft in self.drafts.items() if not draft.stands_for]
        return [*known, *self.graph.subgraphs]

    def check(self, draft: BlockDraft) -> None:
        """Report every problem of the wires into one block."""
        if draft.block_type is None:
            return
        flat = draft.flat
        likely_inputs: dict[str, None] = {}
        proposed: dict[str, None] = {}
        for name, wire in flat.wires.items():
            port = draft.inputs.get(name)
            if port is None:
                likely_inputs[self._unknown_input(draft, name, wire)] = None
            elif wire.constant is None:
                self._check_wire(draft, name, port, wire)
        for name, port in draft.inputs.items():
            wired = name in flat.wires or name in flat.excused or name in likely_inputs
            if not wired and not port.optional:
                candidates = self._candidates(draft, port, proposed)
                proposed.update(dict.fromkeys(candidates[:1]))
                self.problems.add(
                    Code.UNWIRED_INPUT,
                    f"input {name!r} of {flat.path} is not wired",
                    flat.where,
                    at=f"{flat.path}.{name}",
                    expected=_signal_text(port.signal) + (f" ({port.text})" if port.text else ""),
                    nearest=candidates,
                    fix=f"in: {{{name}: {candidates[0] if candidates else 'block.port'}}}",
                )

    def _unknown_input(self, draft: BlockDraft, name: str, wire: FlatWire) -> str:
        """Report an unknown input. Returns the input that was meant, if that is clear."""
        flat = draft.flat
        free = [n for n in draft.inputs if n not in flat.wires]
        similar = nearest(name, draft.inputs)
        best = next((n for n in similar if n in free), similar[0] if similar else "")
        if not best:  # the name resembles none: is there one input that takes this signal?
            source = self.drafts.get(wire.source_block)
            output = source.outputs.get(wire.source_port) if source else None
            if source is not None and output is not None:
                able = [n for n in free if fits(output, draft.inputs[n], source, draft)]
                best = able[0] if len(able) == 1 else ""
        self.problems.add(
            Code.UNKNOWN_INPUT,
            f"{flat.path} ({flat.use}) has no input {name!r}",
            flat.input_places.get(name, wire.where),
            at=f"{flat.path}.{name}",
            expected=listing(draft.inputs),
            found=name,
            nearest=similar,
            fix=f"{best}: {text_of(wire.plain())}" if best else f"remove {name!r}",
        )
        return best

    def _check_wire(self, target: BlockDraft, name: str, port: Input[Any], wire: FlatWire) -> None:
        at = target.stands_for or f"{target.flat.path}.{name}"
        ends = self.source(at, wire, target, port)
        if ends is None:
            return
        source, output = ends
        name, written = at.rpartition(".")[2], wire.shown or wire.source
        end = written if source.stands_for else wire.source
        other = {"at": at, "other": end, "other_where": source.flat.where}
        if output.truth and not port.reads_truth and not wire.truth:
            nearby = self._local(self._candidates(target, port), at, wire)
            allowed = f"{name}: {{from: {written}, allow: truth}}"
            self.problems.add(
                Code.TRUTH,
                f"{at} reads {wire.source}, which only a simulator knows",
                wire.where,
                **other,
                expected="a measured or estimated signal",
                found="simulation truth",
                nearest=nearby,
                fix=f"{name}: {nearby[0]}; or, where truth is meant, {allowed}"
                if nearby
                else allowed,
            )
        reason = source.outputs[wire.source_port].absent
        if reason:
            self.problems.add(
                Code.UNMET_REQUIREMENT,
                f"{at} reads {wire.source}, which is not there: {reason}",
                wire.where,
                **other,
                expected="a signal that this robot has",
                found=reason,
                nearest=self._local(self._candidates(target, port), at, wire),
                fix="" if port.optional else f"leave {name!r} out, or use another block",
            )
            return
        missing = [n for n in port.signal.fields if n not in output.signal.fields]
        if missing:
            selected = [f"{wire.source}.{n}" for n in _fitting(source, output, port)]
            one = _one_element(source, output, target, port)
            selected = selected or ([f"{wire.source}.{one}"] if one else [])
            candidates = self._local(selected[:3] or self._candidates(target, port), at, wire)
            self.problems.add(
                Code.FIELD_MISSING,
                f"{wire.source} does not carry {listing(missing)}",
                wire.where,
                **other,
                expected=_signal_text(port.signal),
                found=_signal_text(output.signal),
                nearest=candidates,
                fix=f"{name}: {candidates[0]}" if candidates else "",
            )
        for mismatch in compare(output, port.signal, source, target):
            self.problems.add(
                mismatch.code,
                f"{at} does not fit {written}: {mismatch.message}",
                wire.where,
                **other,
                expected=mismatch.expected + self._width_of(target, name, mismatch),
                found=mismatch.found,
                fix=mismatch.fix,
            )

    def _width_of(self, target: BlockDraft, name: str, mismatch: Mismatch) -> str:
        """Return where the width that an input has comes from, if it follows from another wire."""
        field = (
            next(iter(target.inputs[name].signal.fields.values()))
            if name in target.inputs
            else None
        )
        size = field.shape[0] if field is not None and len(field.shape) == 1 else None
        entry = target.flat.parameters.get(size) if isinstance(size, str) else None
        if mismatch.code is not Code.SHAPE or entry is None or entry.key_where != target.flat.where:
            return ""
        for other, port in target.inputs.items():
            wire = target.flat.wires.get(other)
            if other == name or wire is None:
                continue
            if any(field.shape == (size,) for field in port.signal.fields.values()):
                return f", as {target.flat.path}.{other} from {wire.shown or wire.source}"
        return ""

    def check_output(self, at: str, wire: FlatWire) -> None:
        """Report a sub-graph's output whose source does not exist."""
        for inner in wire.inner():
            self.source(at, inner, None, None)

    def source(
        self, at: str, wire: FlatWire, target: BlockDraft | None, port: Input[Any] | None
    ) -> tuple[BlockDraft, Output[Any]] | None:
        """Return the block and the output that a wire comes from; ``None`` after a problem."""
        name = at.rpartition(".")[2]
        source = self.drafts.get(wire.source_block)
        if source is None:
            candidates = self._candidates(target, port) if target and port else ()
            self._unknown_block(wire, at, candidates)
            return None
        if source.block_type is None:
            return None  # reported at that block
        output = source.outputs.get(wire.source_port)
        if output is not None:
            return source, output
        similar = nearest(wire.source_port, source.outputs)
        if not similar and target is not None and port is not None:
            able = [n for n, o in source.outputs.items() if fits(o, port, source, target)]
            similar = tuple(able)
        names = self._local([f"{wire.source_block}.{match}" for match in similar], at, wire)
        names = tuple(f"{each}{wire.selected}" for each in names)
        self.problems.add(
            Code.UNKNOWN_SOURCE,
            f"{wire.source_block} ({source.flat.use}) has no output {wire.source_port!r}",
            wire.where,
            at=at,
            other=wire.source_block,
            other_where=source.flat.where,
            expected=listing(f"{wire.source_block}.{n}" for n in source.outputs),
            found=wire.source,
            nearest=names,
            fix=f"{name}: {names[0]}" if names else "",
        )
        return None

    def _local(self, names: Iterable[str], at: str, wire: FlatWire) -> tuple[str, ...]:
        """Paths as the wire's own file writes them: without the path of the sub-graph it is in."""
        owner = at.rpartition(".")[0]
        scope = owner if owner in self.graph.subgraphs else owner.rpartition("/")[0]
        if not scope or wire.where.file == self.graph.file:
            return tuple(names)
        return tuple(name.removeprefix(f"{scope}/") for name in names)

    def _unknown_block(self, wire: FlatWire, at: str, candidates: tuple[str, ...]) -> None:
        block = wire.source_block
        prefixes = [f"{path}/" for path in self.graph.broken]
        if self.graph.incomplete or any(f"{block}/".startswith(prefix) for prefix in prefixes):
            return  # it may be in a file that could not be read, which is reported
        if block not in self._similar:  # many wires may read one block that is missing
            self._similar[block] = nearest(block, self._known)
        names = [f"{match}.{wire.source_port}" for match in self._similar[block]]
        candidates = self._local(names or candidates, at, wire)
        candidates = tuple(f"{each}{wire.selected}" for each in candidates)
        self.problems.add(
            Code.UNKNOWN_SOURCE,
            f"{at} reads {wire.source}, but there is no block {block!r}",
            wire.where,
            at=at,
            expected=listing(self._known),
            found=wire.source,
            nearest=candidates,
            fix=f"{at.rpartition('.')[2]}: {candidates[0]}" if candidates else "",
        )

    def _candidates(
        self, target: BlockDraft, port: Input[Any], proposed: Iterable[str] = ()
    ) -> tuple[str, ...]:
        """Return outputs that could feed an input; those with the same type of signal come first.

        What feeds another input of the block, or is ``proposed`` for one, is hardly meant twice.
        """
        taken = {wire.source: None for wire in target.flat.wires.values()}
        taken.update(dict.fromkeys(proposed))
        exact: list[str] = []
        other: list[str] = []
        for source in self.drafts.values():
            if len(exact) == 3:
                break  # in a large graph nearly every block may fit
            if source is target or source.stands_for:
                continue
            for name, output in source.outputs.items():
                path = f"{source.flat.path}.{name}"
                if path in taken or output.absent:
                    continue
                same = output.signal is port.signal
                if not same and len(other) == 3:
                    continue
                if fits(output, port, source, target):
                    (exact if same else other).append(path)
        return tuple([*exact, *other][:3])


def _fitting(source: BlockDraft, output: Output[Any], port: Input[Any]) -> Iterator[str]:
    """Yield the fields of an output of which an input with one field may select one."""
    wanted, *more = port.signal.fields.values()
    asked = quantity_of(wanted) or UNCHECKED
    for name, given in output.signal.fields.items():
        same = given.dtype_name == wanted.dtype_name and not more
        if same and source.quantity(output.name, name).agrees(asked):
            yield name


def _one_element(
    source: BlockDraft, output: Output[Any], target: BlockDraft, port: Input[Any]
) -> str:
    """Return ``field[0]`` where an input of one number reads an output of one vector; else nothing."""
    if len(output.signal.fields) != 1 or len(port.signal.fields) != 1:
        return ""
    (given,), (wanted,) = output.signal.fields.values(), port.signal.fields.values()
    one = target.shape(wanted) in ((), (1,)) and len(source.shape(given) or ()) == 1
    return f"{given.name}[0]" if one and given.dtype_name == wanted.dtype_name else ""


def _signal_text(signal: type[Signal]) -> str:
    return f"{signal.__name__} {{{listing(signal.fields, 8)}}}"


@dataclass(frozen=True)
class Mismatch:
    """One way in which a reader's field differs from the writer's."""

    code: Code
    message: str
    expected: str
    found: str
    fix: str = ""


def compare(
    output: Output[Any], reader: type[Signal], source: BlockDraft, target: BlockDraft
) -> Iterator[Mismatch]:
    """All mismatches of the fields that the signals of an output and of its reader have."""
    for name, wanted in reader.fields.items():
        given = output.signal.fields.get(name)
        if given is None:
            continue
        if given.dtype_name != wanted.dtype_name:
            yield Mismatch(
                Code.DTYPE,
                f"field {name!r} has another element type",
                wanted.dtype_name,
                given.dtype_name,
            )
        expected, found = target.shape(wanted), source.shape(given)
        if expected is not None and found is not None and expected != found:
            yield Mismatch(
                Code.SHAPE,
                f"field {name!r} has another shape",
                _shape_text(wanted, expected),
                _shape_text(given, found),
            )
        quantity = source.quantity(output.name, name)
        if quantity.elements and wanted.unit is not None:
            if not quantity.units_agree(Quantity(wanted.unit)):
                yield Mismatch(
                    Code.UNIT, f"field {name!r} joins unlike quantities", str(wanted.unit), str(quantity),
                    "select the elements that are meant, as in block.port.field[0]",
                )  # fmt: skip
        else:
            yield from _compare_units(name, quantity.unit, wanted, _says_unit(source))
        if quantity.frame and wanted.frame and quantity.frame != wanted.frame:
            yield Mismatch(
                Code.FRAME,
                f"field {name!r} is expressed in another frame",
                wanted.frame,
                quantity.frame,
                f"rotate it from {quantity.frame} to {wanted.frame} in a block between",
            )


def _says_unit(source: BlockDraft) -> bool:
    """Return whether the source is a block whose parameter ``unit`` may still be set: neither it nor a
    number such as ``3 A`` says it."""
    return getattr(source.params, "unit", None) == "" and source.flat.parameters.get("unit") is None


def _compare_units(
    name: str, given: Unit | None, wanted: Field, may_say: bool
) -> Iterator[Mismatch]:
    if given is None or wanted.unit is None or given.matches(wanted.unit):
        return
    if given.offset != wanted.unit.offset:
        expected, found = (
            f"{unit}, whose zero is {unit.offset:g}" for unit in (wanted.unit, given)
        )
        yield Mismatch(
            Code.UNIT, f"field {name!r} has another zero", expected, found,
            "convert it in a block between: blocks.Expression, such as u + 273.15",
        )  # fmt: skip
    elif given.same_dimension(wanted.unit):
        factor = given.factor_to(wanted.unit)
        yield Mismatch(
            Code.UNIT,
            f"field {name!r} has another scale",
            str(wanted.unit),
            str(given),
            f"multiply by {factor:.9g} in a block between: 1 {given} is {factor:.9g} {wanted.unit}; "
            f"blocks.Gain with {{gain: {factor:.9g}, unit: {over(wanted.unit, given)}}}",
        )
    else:
        fix = (
            f"convert it in a block between, such as blocks.Gain with {{gain: 1, unit: {over(wanted.unit, given)}}}, "
            f"or declare the field as {given}, if that is what it holds"
        )
        if may_say:
            fix = f"say what its numbers are: with: {{unit: {over(wanted.unit, given)}}}"
        yield Mismatch(
            Code.UNIT, f"field {name!r} is another quantity", str(wanted.unit), str(given), fix
        )


def _shape_text(item: Field, shape: tuple[int, ...]) -> str:
    """``[10]``, or ``[n_joints] = [10]`` where names are involved."""
    if not shape:
        return "one number"
    numbers = f"[{', '.join(map(str, shape))}]"
    if all(isinstance(size, int) for size in item.shape):
        return numbers
    return f"[{', '.join(map(str, item.shape))}] = {numbers}"


def fits(output: Output[Any], port: Input[Any], source: BlockDraft, target: BlockDraft) -> bool:
    """Return whether a wire from ``output`` to ``port`` would have no problem."""
    if output.truth and not port.reads_truth:
        return False
    if any(name not in output.signal.fields for name in port.signal.fields):
        return False
    return next(compare(output, port.signal, source, target), None) is None
