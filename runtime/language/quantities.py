"""Quantities of the numbers on a wire: their unit and their frame, also behind general blocks.

A general block such as ``Gain`` takes vectors of every unit. Its fields are ``inferred``: the graph
decides what they are, and the block's ``infer_units`` method derives outputs from inputs.
Loading applies these methods from block to block, and then checks every wire.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from .signals import Field
from .unit_algebra import ONE, times
from .units import Unit, parse_unit


@dataclass(frozen=True)
class Quantity:
    """A unit and a frame. ``unit`` is ``None`` where it is not checked; ``frame`` is ``None`` where
    a frame has no meaning, or is not checked.

    A vector whose elements have unlike units has them in ``elements``, and no ``unit``. ``quaternion`` says
    that the last axis is a unit quaternion x, y, z, w.
    """

    unit: Unit | None = ONE
    frame: str | None = None
    elements: tuple[Unit | None, ...] = ()
    quaternion: bool = False

    @classmethod
    def of(cls, units: Iterable[Unit | None], frame: str | None = None) -> Quantity:
        """Return the quantity of a vector with a unit for each element, which may all be alike."""
        elements = tuple(units)
        alike = elements and all(unit == elements[0] for unit in elements)
        return cls(elements[0], frame) if alike else cls(None, frame, elements)

    def units(self, size: int) -> tuple[Unit | None, ...]:
        """Return the unit of each of ``size`` elements, the last axis of a matrix."""
        return self.elements or (self.unit,) * size

    def times(self, unit: Unit | None, power: int = 1) -> Quantity:
        """Return this quantity times a unit to a power; not checked if either of the two is not."""
        if self.elements:
            return Quantity.of((_times(each, unit, power) for each in self.elements), self.frame)
        return Quantity(_times(self.unit, unit, power), self.frame)

    def product(self, other: Quantity, power: int = 1) -> Quantity:
        """Return the product with another quantity, element by element, in the frame of either."""
        frame = self.frame or other.frame
        size = len(self.elements or other.elements)
        if not size:
            return Quantity(_times(self.unit, other.unit, power), frame)
        pairs = zip(
            self.units(size), other.units(size), strict=False
        )  # widths are checked elsewhere
        return Quantity.of((_times(a, b, power) for a, b in pairs), frame)

    def agrees(self, other: Quantity) -> bool:
        """Return whether numbers of one may be used as numbers of the other."""
        return self.units_agree(other) and (
            not self.frame or not other.frame or self.frame == other.frame
        )

    def units_agree(self, other: Quantity) -> bool:
        """Return whether the units of both are the same, or one of them is not checked."""
        size = len(self.elements or other.elements) or 1
        pairs = zip(self.units(size), other.units(size), strict=False)
        return all(a is None or b is None or a.matches(b) for a, b in pairs)

    @property
    def unit_text(self) -> str:
        """The unit, or those of the elements as ``[V, rad/s]``; empty where it is not checked."""
        if self.elements:
            return f"[{', '.join('unchecked' if u is None else str(u) for u in self.elements)}]"
        return "" if self.unit is None else str(self.unit)

    def __str__(self) -> str:
        unit = self.unit_text or "a unit that is not checked"
        return f"{unit} in {self.frame}" if self.frame else unit


def _times(a: Unit | None, b: Unit | None, power: int) -> Unit | None:
    return None if a is None or b is None else times(a, b, power)


UNCHECKED = Quantity(None)
"""Quantity of numbers without a declared unit or frame."""


def quantity_of(field: Field) -> Quantity | None:
    """Return the quantity that a field declares; ``None`` for one that carries whatever is
    wired."""
    return (
        None if field.inferred else Quantity(field.unit, field.frame, quaternion=field.quaternion)
    )


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
        self.questions: list[tuple[str, str]] = []
        """Inputs, as ``port.field``, that may be meant but should be said, and what to write."""

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
                better = found if result.unit is None and not result.elements else result
                result = replace(better, frame=result.frame or found.frame)
            else:
                self.disagreements.append(Disagreement(name, result, found, first))
        return result

    def agree(
        self,
        port: str,
        expected: Quantity | None,
        reason: str,
        found: Quantity | None = None,
    ) -> None:
        """Say what an input must be; ``None`` while that is not known. ``found`` is what of the input is
        read, if not all."""
        found = found or self[port]
        if found is not None and expected is not None and not found.agrees(expected):
            self.disagreements.append(
                Disagreement(self._name(port), expected, found, reason=reason)
            )

    def demand(self, port: str, units: Iterable[str], reason: str) -> None:
        """Say that an input must have one of these units."""
        found = self[port]
        if found is None:
            return
        wanted = [parse_unit(unit) for unit in units]
        if not any(found.units_agree(Quantity(unit)) for unit in wanted):
            expected = Quantity(wanted[0])
            self.disagreements.append(
                Disagreement(self._name(port), expected, found, reason=reason)
            )

    def question(self, port: str, fix: str) -> None:
        """Ask about an input whose elements have unlike units, where the block takes them for one."""
        found = self[port]
        if found is not None and len({str(u) for u in found.elements if u is not None}) > 1:
            self.questions.append((self._name(port), fix))

    def refuse(self, port: str, reason: str) -> None:
        """Say that what an input is cannot be used, for instance that it has no square root."""
        found = self[port] or UNCHECKED
        self.disagreements.append(Disagreement(self._name(port), None, found, reason=reason))


OutputQuantities = Mapping[str, Quantity | None]
"""The quantities of a block's outputs, by port or ``port.field``; ``None`` while not known."""
