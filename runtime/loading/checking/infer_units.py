"""Carries units and frames from block to block, through those that take any."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping

from ....files.problems import Code, Problems
from ...language.block import Block
from ...language.flat_graph import FlatBlock
from ...language.quantities import (
    UNCHECKED,
    Disagreement,
    InputQuantities,
    Quantity,
    quantity_of,
)
from ...language.unit_algebra import over
from .block_check import BlockDraft
from .inserted import own_unit

Answers = Mapping[str, Quantity | None]
"""Quantities of a block's inferred outputs, by ``port.field``; ``None`` while one is not known."""


def infer_quantities(drafts: Mapping[str, BlockDraft], problems: Problems) -> None:
    """Fill in the quantities of all drafts, and report inputs that do not go together.

    A block infers its outputs when all its wired inputs are known. Where blocks wait for each other
    in a ring, the first that can answer with what is known does; where none can, the first output
    that is missing is taken for a plain number. A block that answered before all its inputs were
    known answers again at the end, so that a ring whose quantities contradict each other is found.
    """
    inference = _QuantityInference(drafts)
    inference.run()
    for path, draft in drafts.items():
        if draft.block_type is not None and draft.params is not None:
            inputs, answers = inference.final.get(path) or inference.ask(draft)
            _check(drafts, draft, inputs, answers, problems)


class _QuantityInference:
    def __init__(self, drafts: Mapping[str, BlockDraft]) -> None:
        self.drafts = drafts
        self.readers: dict[str, list[str]] = {}
        for path, draft in drafts.items():
            for wire in draft.flat.wires.values():
                self.readers.setdefault(wire.source_block, []).append(path)
            for name, output in draft.outputs.items():
                for field_name, field in output.signal.fields.items():
                    declared = quantity_of(field)
                    if declared is not None:
                        draft.quantities[f"{name}.{field_name}"] = declared
        self.waiting = {path: None for path, draft in drafts.items() if self._missing(draft)}
        self.unanswered: dict[str, None] = {}
        """Blocks that had no answer to what has arrived so far."""
        self.final: dict[str, tuple[InputQuantities, Answers]] = {}
        """Answers of blocks with all their inputs known, which no longer change."""

    def run(self) -> None:
        """Ask all blocks until every output is known."""
        self._settle(self.waiting)
        while self.waiting:
            asked = (path for path in self.waiting if path not in self.unanswered)
            changed = next((path for path in asked if self._ask(path)), None)
            if changed is None:
                changed = next(iter(self.waiting))
                draft = self.drafts[changed]
                draft.quantities[next(self._missing(draft))] = Quantity()
                self._tell_readers(changed)
            self._settle([changed, *self.readers.get(changed, ())])

    def _settle(self, paths: Mapping[str, None] | list[str]) -> None:
        """Ask these blocks, and those behind them, wherever all inputs are known."""
        queue = deque(paths)
        while queue:
            path = queue.popleft()
            if path not in self.waiting:
                continue
            draft = self.drafts[path]
            if next(self._missing(draft), None) is None:
                del self.waiting[path]
                queue.extend(self.readers.get(path, ()))
            elif self._complete(draft) and self._ask(path, complete=True):
                queue.extend([path, *self.readers.get(path, ())])

    def ask(self, draft: BlockDraft) -> tuple[InputQuantities, Answers]:
        """Return the quantities at a block's inputs, and its answers for its outputs."""
        inputs = self._given(draft)
        return inputs, inferred_outputs(draft, inputs)

    def _ask(self, path: str, *, complete: bool = False) -> bool:
        """Infer the block's outputs and return whether a quantity is new; ``complete`` if all
        inputs are known."""
        draft = self.drafts[path]
        inputs, answers = self.ask(draft)
        if complete:
            self.final[path] = inputs, answers
        found = False
        for name in list(self._missing(draft)):
            if answers.get(name) is not None:
                draft.quantities[name] = answers[name]  # type: ignore[assignment]  # answers were checked above
                found = True
        if found:
            self._tell_readers(path)
        else:
            self.unanswered[path] = None
        return found

    def _tell_readers(self, path: str) -> None:
        """Something new arrives at the blocks that read this one: they may be asked again."""
        for reader in self.readers.get(path, ()):
            self.unanswered.pop(reader, None)

    def _missing(self, draft: BlockDraft) -> Iterator[str]:
        """Yield the output fields that are not known yet."""
        for name, output in draft.outputs.items():
            for field_name in output.signal.fields:
                if f"{name}.{field_name}" not in draft.quantities:
                    yield f"{name}.{field_name}"

    def _complete(self, draft: BlockDraft) -> bool:
        """Return whether the quantities of all wired inputs are known."""
        for name, wire in draft.flat.wires.items():
            port = draft.inputs.get(name)
            source = self.drafts.get(wire.source_block)
            if port is None or source is None or wire.source_port not in source.outputs:
                continue
            fields = source.outputs[wire.source_port].signal.fields
            for field_name in port.signal.fields:
                if (
                    field_name in fields
                    and quantity_at_input(self.drafts, draft, name, field_name) is None
                ):
                    return False
        return True

    def _given(self, draft: BlockDraft) -> InputQuantities:
        """Return the quantities at a block's inputs."""
        found = {}
        for name, port in draft.inputs.items():
            for field_name in port.signal.fields:
                quantity = quantity_at_input(self.drafts, draft, name, field_name)
                if quantity is not None:
                    found[f"{name}.{field_name}"] = quantity
        return InputQuantities(found)


def quantity_at_input(
    drafts: Mapping[str, BlockDraft], draft: BlockDraft, name: str, field_name: str
) -> Quantity | None:
    """Return the quantity that arrives at an input's field; ``None`` where nothing is wired, or it
    is not known yet."""
    wire = draft.flat.wires.get(name)
    if wire is None:
        return None
    if wire.constant is not None:
        return constant_quantity(draft, name, field_name)
    source = drafts.get(wire.source_block)
    return source.quantities.get(f"{wire.source_port}.{field_name}") if source else None


def constant_quantity(draft: BlockDraft, name: str, field_name: str) -> Quantity:
    """Return the quantity of a constant: that of the input's field; a plain number if it takes
    any."""
    field = draft.inputs[name].signal.fields[field_name]
    declared = quantity_of(field)
    node = draft.flat.wires[name].constant
    entry = node.get(field_name) if node is not None else None
    if declared is not None or entry is None:
        return declared or UNCHECKED  # what is not named is zero, which is zero in every unit
    return Quantity(own_unit(entry.value))


def inferred_quantities(draft: BlockDraft, drafts: Mapping[str, BlockDraft]) -> dict[str, Quantity]:
    """Return the quantities of a block's inferred fields in this graph, by ``port.field``."""
    found = {}
    for name, output in draft.outputs.items():
        for field_name, field in output.signal.fields.items():
            if field.inferred:
                found[f"{name}.{field_name}"] = draft.quantity(name, field_name)
    for name, port in draft.inputs.items():
        for field_name, field in port.signal.fields.items():
            arrives = quantity_at_input(drafts, draft, name, field_name) if field.inferred else None
            if arrives is not None:
                found[f"{name}.{field_name}"] = arrives
    return found


def unchecked_wires(drafts: Mapping[str, BlockDraft]) -> Iterator[str]:
    """Yield a text for every wire whose reader has a unit and whose source has none of its own."""
    for path, draft in drafts.items():
        for name, wire in draft.flat.wires.items():
            if wire.constant is not None or name not in draft.inputs or draft.stands_for:
                continue
            for field_name, field in draft.inputs[name].signal.fields.items():
                arrives = quantity_at_input(drafts, draft, name, field_name)
                if field.unit is None or arrives is None:
                    continue
                if None in arrives.units(1):
                    yield (
                        f"{wire.shown or wire.source} does not say its unit, and {path}.{name} reads "
                        f"{field_name} in {Quantity(field.unit)}"
                    )


def questions(drafts: Mapping[str, BlockDraft]) -> Iterator[str]:
    """Yield a text for every input that joins unlike units where its block takes them for one."""
    for path, draft in drafts.items():
        arriving = [
            (name, field_name, arrives)
            for name in draft.flat.wires
            if name in draft.inputs
            for field_name in draft.inputs[name].signal.fields
            if (arrives := quantity_at_input(drafts, draft, name, field_name)) is not None
        ]
        if any(quantity.elements for _, _, quantity in arriving):
            quantities = {f"{name}.{field_name}": found for name, field_name, found in arriving}
            inputs = InputQuantities(quantities)
            inferred_outputs(draft, inputs)
            for name, fix in inputs.questions:
                yield f"{path}.{name.partition('.')[0]} joins {quantities[name]} in one vector: {fix}"


def inferred_outputs(draft: BlockDraft, inputs: InputQuantities) -> Answers:
    """Return the block's answers for its inferred outputs; they are not checked where it fails."""
    block_type = draft.block_type
    inferred = [
        (name, field_name)
        for name, output in draft.outputs.items()
        for field_name, field in output.signal.fields.items()
        if field.inferred
    ]
    if block_type is None or draft.params is None:
        return {f"{name}.{field_name}": UNCHECKED for name, field_name in inferred}
    answers_by_name = {}
    silent = block_type.infer_units.__func__ is Block.infer_units.__func__  # type: ignore[attr-defined]  # a class method
    if not silent:
        try:
            answers_by_name = dict(block_type.infer_units(draft.params, inputs))
        except Exception:  # noqa: BLE001  wrong parameters, which are reported; or a user's mistake
            silent = True
    return {
        f"{name}.{field_name}": UNCHECKED
        if silent
        else answers_by_name.get(f"{name}.{field_name}", answers_by_name.get(name))
        for name, field_name in inferred
    }


def _check(
    drafts: Mapping[str, BlockDraft],
    draft: BlockDraft,
    inputs: InputQuantities,
    answers: Answers,
    problems: Problems,
) -> None:
    """Report inputs of a block that disagree, or an output that contradicts what a ring assumed
    before."""
    flat = draft.flat
    for item in inputs.disagreements:
        name = item.port.partition(".")[0]
        wire = flat.wires.get(name)
        other = item.other.partition(".")[0]
        reason = item.reason or f"{other} and {name} must be the same quantity"
        differ = item.expected is None or _units_differ(item.expected, item.found)
        reader = f"{flat.path}.{name}"
        if draft.stands_for and wire is not None:
            reader = wire.shown
        problems.add(
            Code.UNIT if differ else Code.FRAME,
            f"{reader} is in {_named(item.found)}: {reason}",
            wire.where if wire else flat.where,
            at=draft.stands_for or reader,
            other=f"{flat.path}.{other}" if other else "",
            other_where=flat.wires[other].where if other in flat.wires else None,
            expected=_named(item.expected) if item.expected else "",
            found=_named(item.found),
            fix=_unit_of_source(drafts, flat, item, other)
            or (_conversion(item.found, item.expected) if item.expected else ""),
        )
    for name, answer in answers.items():
        known = draft.quantities.get(name)
        if answer is None or known is None or answer.agrees(known):
            continue
        fix = ""
        if answer.unit is not None and known.unit is not None:
            fix = f"a gain with unit: {over(known.unit, answer.unit)} in the ring"
        problems.add(
            Code.UNIT if _units_differ(known, answer) else Code.FRAME,
            f"{flat.path}.{name.partition('.')[0]} is in a ring of blocks that makes "
            f"{_named(answer)} of {_named(known)}",
            flat.where,
            at=f"{flat.path}.{name}",
            expected=_named(known),
            found=_named(answer),
            fix=fix,
        )


def _unit_of_source(
    drafts: Mapping[str, BlockDraft], flat: FlatBlock, item: Disagreement, other: str
) -> str:
    """Return the fix where plain numbers come from a block that can be told their unit."""
    if item.expected is None or item.found.unit is None or other not in flat.wires:
        return ""
    if str(item.expected.unit) != "1" or item.found.elements:
        return ""
    source = drafts.get(flat.wires[other].source.rpartition(".")[0])
    params = source.params if source is not None else None
    if source is None or getattr(params, "unit", None) != "":
        return ""
    return f"say what {source.flat.path}'s numbers are: with: {{unit: {item.found.unit}}}"


def _units_differ(a: Quantity, b: Quantity) -> bool:
    return not a.units_agree(b)


def _named(quantity: Quantity) -> str:
    """Describe the quantity in words that also name a plain number."""
    if quantity.unit is not None and str(quantity.unit) == "1":
        return f"plain numbers in {quantity.frame}" if quantity.frame else "plain numbers"
    return str(quantity)


def _conversion(found: Quantity, expected: Quantity) -> str:
    if found.elements or expected.elements:
        return ""
    if found.unit is None or expected.unit is None or found.unit.matches(expected.unit):
        return f"turn it into {expected.frame} with blocks.RotateVector" if expected.frame else ""
    if found.unit.same_dimension(expected.unit):
        factor = found.unit.factor_to(expected.unit)
        unit = over(expected.unit, found.unit)
        return f"blocks.Gain with {{gain: {factor:.9g}, unit: {unit}}} between"
    unit = over(expected.unit, found.unit)
    return f"where that is meant, a gain of that unit: blocks.Gain with {{unit: {unit}}} between"
