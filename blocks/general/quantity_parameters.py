"""Units and frames of the general blocks: the parameters that say them, and the common rules."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, model_validator

from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given, Quantity
from ...runtime.language.unit_algebra import read_unit
from ...runtime.language.units import QUANTITY, parse_quantity


def _readable(text: str) -> str:
    """The text of a unit. Raises ``UnitError`` if it cannot be read."""
    read_unit(text)
    return text


UnitText = Annotated[str, AfterValidator(_readable)]
"""A unit such as ``N m/rad``; empty for plain numbers; ``unchecked`` where it is not checked."""


class InUnit(Parameters):
    """The base of parameters that have a common unit, which the graph says.

    It is said by ``unit``, or with the numbers themselves: ``gain: 40 N m/rad``. Numbers in
    ``in_unit`` that are written with another unit of the same dimension are converted.
    """

    in_unit: ClassVar[tuple[str, ...]] = ()

    unit: UnitText = parameter("", text="unit of the numbers; nothing for plain ones")

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
    """The base of the parameters of sources: the graph says what their numbers are."""

    frame: str | None = parameter(None, text="frame of the numbers, such as world")

    def quantity(self) -> Quantity:
        """The quantity of the numbers."""
        return Quantity(read_unit(self.unit), self.frame)


def _units_in(value: Any) -> list[str]:
    """The units of all texts such as ``3 m`` in a value."""
    if isinstance(value, str):
        match = QUANTITY.match(value)
        return [match["unit"]] if match is not None and match["unit"].strip() else []
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return [unit for item in value for unit in _units_in(item)]
    return []


def _numbers(value: Any, unit: str) -> Any:
    """The value with its texts as numbers in ``unit``; what cannot be converted stays a text."""
    if isinstance(value, str):
        try:
            return parse_quantity(value, unit)
        except ValueError:
            return value  # reported by pydantic at its own place
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return [_numbers(item, unit) for item in value]
    return value


class Says:
    """A block whose output ``y`` is what its parameters ``unit`` and ``frame`` say."""

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The quantity of the parameters."""
        assert isinstance(params, SourceParameters)
        return {"y": params.quantity()}


class Keeps:
    """A block whose output ``y`` is the same quantity as its input ``u``."""

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The quantity of ``u``."""
        return {"y": given["u"]}


class Scales:
    """A block whose output ``y`` is its input ``u`` times the parameter ``unit``."""

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The quantity of ``u``, times the unit."""
        assert isinstance(params, InUnit)
        u = given["u"]
        return {"y": u and u.times(read_unit(params.unit))}
