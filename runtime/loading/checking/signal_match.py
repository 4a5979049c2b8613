"""Whether the signal that is written is the signal that is read, field by field."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ...language.block import Input, Output
from ...language.signals import Field, Signal
from ...language.unit_algebra import over
from ...language.units import Unit
from ..problems import Code
from .draft import Draft


@dataclass(frozen=True)
class Mismatch:
    """One way in which a reader's field differs from the writer's."""

    code: Code
    message: str
    expected: str
    found: str
    fix: str = ""


def compare(
    output: Output[Any], reader: type[Signal], source: Draft, target: Draft
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
        yield from _compare_units(name, quantity.unit, wanted, _says_unit(source))
        if quantity.frame and wanted.frame and quantity.frame != wanted.frame:
            yield Mismatch(
                Code.FRAME,
                f"field {name!r} is expressed in another frame",
                wanted.frame,
                quantity.frame,
                f"rotate it from {quantity.frame} to {wanted.frame} in a block between",
            )


def _says_unit(source: Draft) -> bool:
    """Whether the source is a block whose parameter ``unit`` may still be set."""
    fields = type(source.params).model_fields if source.params is not None else {}
    return "unit" in fields and source.flat.parameters.get("unit") is None


def _compare_units(
    name: str, given: Unit | None, wanted: Field, may_say: bool
) -> Iterator[Mismatch]:
    if given is None or wanted.unit is None or given.matches(wanted.unit):
        return
    if given.same_dimension(wanted.unit):
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
        fix = ""
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


def fits(output: Output[Any], port: Input[Any], source: Draft, target: Draft) -> bool:
    """Whether a wire from ``output`` to ``port`` would have no problem."""
    if output.truth and not port.reads_truth:
        return False
    if any(name not in output.signal.fields for name in port.signal.fields):
        return False
    return next(compare(output, port.signal, source, target), None) is None
