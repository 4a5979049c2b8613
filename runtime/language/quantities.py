"""Quantities of the numbers on a wire: their unit and their frame, also behind general blocks.

A general block such as ``Gain`` takes vectors of every unit. Its fields are ``inferred``: the graph
decides what they are, and the block's ``infer_units`` method derives outputs from inputs.
Loading applies these methods from block to block, and then checks every wire.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from .signals import Field
from .unit_algebra import ONE, times
from .units import Unit, parse_unit


@dataclass(frozen=True)
class Quantity:
    """A unit and a frame. ``unit`` is ``None`` where it is not checked; ``frame`` is ``None`` where
    a frame has no meaning, or is not checked."""

    unit: Unit | None = ONE
    frame: str | None = None

    def times(self, unit: Unit | None, power: int = 1) -> Quantity:
        """Return this quantity times a unit to a power; not checked if either of the two is not."""
        if self.unit is None or unit is None:
            return Quantity(None, self.frame)
        return Quantity(times(self.unit, unit, power), self.frame)

    def agrees(self, other: Quantity) -> bool:
        """Return whether numbers of one may be used as numbers of the other."""
        units = self.unit is None or other.unit is None or self.unit.matches(other.unit)
        return units and (not self.frame or not other.frame or self.frame == other.frame)

    def __str__(self) -> str:
        unit = "a unit that is not checked" if self.unit is None else str(self.unit)
        return f"{unit} in {self.frame}" if self.frame else unit


UNCHECKED = Quantity(None)
"""Quantity of numbers without a declared unit or frame."""


def quantity_of(field: Field) -> Quantity | None:
    """Return the quantity that a field declares; ``None`` for one that carries whatever is
    wired."""
    return None if field.inferred else Quantity(field.unit, field.frame)


@dataclass(frozen=True)
class Disagreement:
    """Input without the quantity that its block needs.

    ``port`` is the input's field, as ``port.field``. ``other`` is the input that it must agree
    with, if there is one. ``reason`` explains it, such as ``sin takes an angle``. ``expected`` is
    ``None`` where no one quantity would do.
    """

    port: str
    expected: Quantity | None
    found: Quantity
    other: str = ""
    reason: str = ""


class InputQuantities:
    """The quantities at a block's inputs, as ``Block.infer_units`` reads them.

    An input is named by its port, or by ``port.field`` if it has several fields. What is not known
    yet, and what is not wired, is ``None``.
    """

    def __init__(self, quantities: Mapping[str, Quantity]) -> None:
        self._quantities = quantities
        self.disagreements: list[Disagreement] = []

    def __getitem__(self, port: str) -> Quantity | None:
        return self._quantities.get(self._name(port))

    def _name(self, port: str) -> str:
        if "." in port:
            return port
        return next((n for n in self._quantities if n.startswith(f"{port}.")), f"{port}.value")

    def alike(self, *ports: str) -> Quantity | None:
        """Return the one quantity that all these inputs must have; unknown ones are passed over."""
        known = [(self._name(port), self[port]) for port in ports]
        first, result = "", None
        for name, found in known:
            if found is None:
                continue
            if result is None:
                first, result = name, found
            elif result.agrees(found):
                unit = found.unit if result.unit is None else result.unit
                result = Quantity(unit, result.frame or found.frame)
            else:
                self.disagreements.append(Disagreement(name, result, found, first))
        return result

    def agree(self, port: str, expected: Quantity | None, reason: str) -> None:
        """Say what an input must be; ``None`` while that is not known."""
        found = self[port]
        if found is not None and expected is not None and not found.agrees(expected):
            self.disagreements.append(
                Disagreement(self._name(port), expected, found, reason=reason)
            )

    def demand(self, port: str, units: Iterable[str], reason: str) -> None:
        """Say that an input must have one of these units."""
        found = self[port]
        if found is None or found.unit is None:
            return
        wanted = [parse_unit(unit) for unit in units]
        if not any(found.unit.matches(unit) for unit in wanted):
            expected = Quantity(wanted[0])
            self.disagreements.append(
                Disagreement(self._name(port), expected, found, reason=reason)
            )

    def refuse(self, port: str, reason: str) -> None:
        """Say that what an input is cannot be used, for instance that it has no square root."""
        found = self[port] or UNCHECKED
        self.disagreements.append(Disagreement(self._name(port), None, found, reason=reason))


OutputQuantities = Mapping[str, Quantity | None]
"""The quantities of a block's outputs, by port or ``port.field``; ``None`` while not known."""
