"""A block while it is checked: what is known of it so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...language.block import Block, Input, Output
from ...language.parameters import Parameters
from ...language.quantities import UNCHECKED, Quantity, quantity_of
from ...language.signals import Field
from ..flattening.flat import FlatBlock


@dataclass
class Draft:
    """A block while it is checked.

    ``complete`` is true if all its dimensions are known. ``absent`` holds the outputs that it
    cannot have with the graph's robot, each with the reason.
    """

    flat: FlatBlock
    block_type: type[Block] | None = None
    params: Parameters | None = None
    dimensions: Mapping[str, int] = field(default_factory=dict)
    complete: bool = False
    absent: Mapping[str, str] = field(default_factory=dict)
    quantities: dict[str, Quantity] = field(default_factory=dict)
    """Unit and frame of every output, by ``port.field``; those of blocks that take any are there
    once ``carry`` has been called."""
    period_ticks: int = 1
    offset_ticks: int = 0
    stands_for: str = ""
    """For a block that loading has inserted: the input whose wire it puts together."""

    @property
    def inputs(self) -> Mapping[str, Input[Any]]:
        """The declared inputs."""
        return self.block_type.inputs if self.block_type else {}

    @property
    def outputs(self) -> Mapping[str, Output[Any]]:
        """The declared outputs."""
        return self.block_type.outputs if self.block_type else {}

    def shape(self, item: Field) -> tuple[int, ...] | None:
        """A field's shape in numbers, where it is known."""
        try:
            return item.resolve(self.dimensions)
        except KeyError:
            return None

    def quantity(self, port: str, field_name: str) -> Quantity:
        """Unit and frame of an output's field; not checked where they are not known."""
        known = self.quantities.get(f"{port}.{field_name}")
        if known is None:
            known = quantity_of(self.outputs[port].signal.fields[field_name])
        return known or UNCHECKED
