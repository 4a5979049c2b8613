"""The common signals and parameters of the general blocks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ValidationInfo, field_validator, model_validator

from ...runtime.language.block import Context, UnmetRequirement
from ...runtime.language.parameters import Parameters, ScalarOrVector, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities, Quantity
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import read_unit
from ...runtime.language.units import parse_quantity, unit_in


class Vector(Signal):
    """A vector of ``n`` numbers. Its unit and frame are those of what is wired."""

    value = Field("n", inferred=True, text="the vector's elements")


class Number(Signal):
    """One number as a vector of one element, so that it fits blocks with n = 1."""

    value = Field(1, unit="", text="the number")


class Seconds(Signal):
    """A duration as a vector of one element, so that it fits blocks with n = 1."""

    value = Field(1, unit="s", text="the duration")


class CountState(Signal):
    """A whole number that a block counts."""

    count = Field((), dtype="int64", text="the number")


_CHECKED = (ScalarOrVector, ScalarOrVector | None)


class VectorParameters(Parameters):
    """The base of the parameters of blocks on a vector with ``n`` elements.

    A parameter of type ``ScalarOrVector`` that is a list must have n numbers, which is part of the
    load report.
    """

    n: int = parameter(1, ge=1, text="elements")

    @field_validator("*")
    @classmethod
    def _one_or_n(cls, value: Any, info: ValidationInfo) -> Any:
        n, name = info.data.get("n"), info.field_name
        if n is None or name is None or not isinstance(value, list):
            return value
        if cls.model_fields[name].annotation in _CHECKED and len(value) != n:
            raise ValueError(f"{name} has {len(value)} elements, expected n = {n}")
        return value


class Flags(Signal):
    """A vector of ``n`` truth values."""

    value = Field("n", dtype="bool", text="the truth values")


class Flag(Signal):
    """One truth value."""

    value = Field((), dtype="bool", text="it holds")


NEVER = {"value": False}
"""The default of an optional trigger or condition that is not wired."""


class InitialValueParameters(VectorParameters):
    """The parameters of blocks that start from a vector."""

    initial: ScalarOrVector = parameter(
        0.0,
        text="the first output: n numbers, or one for all elements; of a quaternion the identity where it is not given",
    )

    def start_value(self) -> NDArray[np.float64]:
        """Return ``initial`` as an array of n elements."""
        return np.full(self.n, self.initial)


def crossed_bounds(
    lower: ScalarOrVector | None, upper: ScalarOrVector | None, n: int
) -> Iterable[UnmetRequirement]:
    """Report a lower bound that is above its upper one."""
    low = np.full(n, -np.inf if lower is None else lower)
    high = np.full(n, np.inf if upper is None else upper)
    for i in np.flatnonzero(low > high)[:1]:
        yield UnmetRequirement(
            f"the lower bound of element {i} is above the upper one",
            parameter="lower",
            expected=f"at most {high[i]:g}",
            found=f"{low[i]:g}",
        )


class Bounds(Signal):
    """The bounds of each element; infinite where there is none."""

    lower = Field("n", text="the lower bounds")
    upper = Field("n", text="the upper bounds")


class Bounded:
    """The base of blocks whose parameters ``lower`` and ``upper`` bound ``n`` elements."""

    Constants: ClassVar[type[Signal] | None] = Bounds

    @classmethod
    def requires(cls, params: Any, context: Context) -> Iterable[UnmetRequirement]:
        """Report bounds that cross."""
        return crossed_bounds(params.lower, params.upper, params.n)

    def prepare(self: Any) -> None:
        """Take the bounds."""
        p = self.params
        self.constants.lower[...] = -np.inf if p.lower is None else p.lower
        self.constants.upper[...] = np.inf if p.upper is None else p.upper


def _readable(text: str) -> str:
    """Return the text of a unit. Raises ``UnitError`` if it cannot be read."""
    read_unit(text)
    return text


UnitText = Annotated[str, AfterValidator(_readable)]
"""A unit such as ``N m/rad``; empty for plain numbers; ``unchecked`` where it is not checked."""


class InUnit(Parameters):
    """The base of parameters that have a common unit, which the graph gives.

    It is given by ``unit``, or with the numbers themselves: ``gain: 40 N m/rad``. Numbers in
    ``in_unit`` that are written with another unit of the same dimension are converted.
    """

    in_unit: ClassVar[tuple[str, ...]] = ()

    unit: UnitText = parameter("", text="unit of the numbers; nothing for plain ones")

    def own_unit(self, name: str) -> str:
        """Return ``unit`` for the numbers that are in it."""
        return self.unit if name in self.in_unit else ""

    @model_validator(mode="before")
    @classmethod
    def _read_units(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        texts = [each for name in cls.in_unit for each in _units_in(data.get(name))]
        if not texts:
            return data
        unit = data.get("unit") or texts[0]
        converted = {name: _numbers(data[name], unit) for name in cls.in_unit if name in data}
        return {**data, **converted, "unit": unit}


class SourceParameters(InUnit):
    """The base of the parameters of sources: the graph gives the quantity of their numbers."""

    frame: str | None = parameter(None, text="frame of the numbers, such as world")

    def quantity(self) -> Quantity:
        """Return the quantity of the numbers."""
        return Quantity(read_unit(self.unit), self.frame)


UnitTexts = str | list[str]
"""A unit, or one for each element."""


class VectorUnits(Parameters):
    """The base of parameters of blocks whose inputs or outputs may each have a unit of their own."""

    input_units: UnitTexts | None = parameter(
        None, text="unit of u that is checked, or a list with one for each element"
    )
    output_units: UnitTexts | None = parameter(
        None, text="unit of y, or a list with one for each element; in place of unit"
    )

    @field_validator("input_units", "output_units")
    @classmethod
    def _each_readable(cls, value: UnitTexts | None) -> UnitTexts | None:
        for text in value if isinstance(value, list) else [value or ""]:
            read_unit(text)
        return value

    @model_validator(mode="after")
    def _said_once(self) -> Self:
        if self.output_units is not None and getattr(self, "unit", None):
            raise ValueError(
                "unit and output_units both say what the outputs are; keep one of them"
            )
        return self

    def wrong_units(self, inputs: int, outputs: int) -> Iterable[UnmetRequirement]:
        """Report lists of units that do not fit the numbers of elements."""
        for name, given, size in (
            ("input_units", self.input_units, inputs),
            ("output_units", self.output_units, outputs),
        ):
            if isinstance(given, list) and len(given) != size:
                yield UnmetRequirement(
                    f"{name} has {len(given)} units for {size} elements",
                    parameter=name,
                    expected=f"{size} units, or one for all",
                    found=str(len(given)),
                )

    def check_inputs(self, inputs: InputQuantities) -> None:
        """Check ``u`` by its units, or ask for them where it joins unlike ones."""
        if self.input_units is not None:
            inputs.agree("u", said(self.input_units), "input_units says so")
            return
        u = inputs["u"]
        inputs.question("u", f"if that is meant, say so: input_units: {u}")


def said(units: UnitTexts, frame: str | None = None) -> Quantity:
    """Return the quantity that one unit, or a list with one for each element, says."""
    if isinstance(units, str):
        return Quantity(read_unit(units), frame)
    return Quantity.of((read_unit(each) for each in units), frame)


def _units_in(value: Any) -> list[str]:
    """Return the units of all texts such as ``3 m`` in a value."""
    if isinstance(value, str):
        unit = unit_in(value)
        return [unit] if unit else []
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return [unit for item in value for unit in _units_in(item)]
    return []


def _numbers(value: Any, unit: str) -> Any:
    """Return the value with its texts as numbers in ``unit``; what cannot be converted stays a text."""
    if isinstance(value, str):
        try:
            return parse_quantity(value, unit)
        except ValueError:
            return value  # reported by pydantic at its own place
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return [_numbers(item, unit) for item in value]
    return value


class UnitFromParameters:
    """A block whose output ``y`` has the ``unit`` and ``frame`` of its parameters."""

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the quantity of the parameters."""
        assert isinstance(params, SourceParameters)
        return {"y": params.quantity()}


def ask_for_lists(levels: Iterable[str], params: Parameters, inputs: InputQuantities) -> None:
    """Ask about parameters in the unit of ``u`` that are one number, where its elements have unlike units."""
    for name in levels:
        value = getattr(params, name)
        if isinstance(value, int | float) and value:  # zero is zero in every unit
            inputs.question(
                "u", f"{name} is {value:g} for all; give a list with one number for each element"
            )


class UnitOfInput:
    """A block whose output ``y`` is the same quantity as its input ``u``, and so are the parameters in ``levels``."""

    levels: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the quantity of ``u``."""
        ask_for_lists(cls.levels, params, inputs)
        return {"y": inputs["u"]}


class UnitOfProduct:
    """A block whose output ``y`` is its input ``u`` times the parameter ``unit``."""

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the quantity of ``u``, times the unit."""
        assert isinstance(params, InUnit)
        u = inputs["u"]
        return {"y": u and u.times(read_unit(params.unit))}


if TYPE_CHECKING:
    Matrix = Any  # a kernel sees an array, other methods a list
else:
    Matrix = list[list[float]]
"""A list of rows."""


def equal_rows(value: Matrix) -> Matrix:
    """Return the same matrix.

    Raises:
        ValueError: it has no column, or its rows are not equally long.
    """
    lengths = [len(row) for row in value]
    if value and (min(lengths) != max(lengths) or not lengths[0]):
        raise ValueError(f"expected rows of one length, found lengths {lengths}")
    return value


def matrix_rows(*names: str) -> Any:
    """Return the validator that a class of parameters has for its matrices."""
    return field_validator(*names)(equal_rows)
