"""The block that loading inserts for a wire that is put together from parts of other signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..language.block import Block, Input, Output
from ..language.parameters import Parameters
from ..language.quantities import UNCHECKED, Carried, Given, Quantity
from ..language.signals import Field, Signal


@dataclass(frozen=True)
class Piece:
    """Some elements of one source, or numbers, and where they go in the field ``target``.

    ``copies`` are stretches (first in the source, first in the target, length), both in row order.
    """

    target: str
    port: str = ""
    field: str = ""
    copies: tuple[tuple[int, int, int], ...] = ()
    numbers: tuple[float, ...] = ()
    start: int = 0


class Gather(Block):
    """Copies parts of its inputs into one signal; a wire such as ``u: robot.joints.position`` is one.

    Subclasses made by ``gather_block_type`` fix its ports. It raises no errors: what is selected is
    checked at load.
    """

    Params = Parameters
    pieces: ClassVar[tuple[Piece, ...]] = ()
    wanted: ClassVar[Mapping[str, Quantity | None]] = {}
    """What the reader's fields are; ``None`` for one that takes any."""

    said: ClassVar[str] = ""
    """The wire as the graph has it."""

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """What the parts of a field have in common.

        They must be what the reader says. If it takes any and they differ, the unit of the whole is
        not checked.
        """
        return {f"y.{name}": cls._quantity(name, given) for name in cls.wanted}

    @classmethod
    def _quantity(cls, target: str, given: Given) -> Quantity | None:
        wanted = cls.wanted[target]
        names = [f"{p.port}.{p.field}" for p in cls.pieces if p.target == target and p.port]
        found = [given[name] for name in names]
        if wanted is not None:
            for name in names:
                given.agree(name, wanted, f"the reader's {target} is {wanted}")
            return wanted
        known = [quantity for quantity in found if quantity is not None]
        if len(known) < len(found):
            return None
        numbers = any(any(p.numbers) for p in cls.pieces if p.target == target)
        same = all(quantity == known[0] for quantity in known) and not numbers
        return known[0] if known and same else UNCHECKED

    def setup(self) -> None:
        """Write the numbers, and take a view of every stretch, so that no tick makes one."""
        target: Signal = self.__dict__["y"]
        self._copies: list[tuple[NDArray[Any], NDArray[Any]]] = []
        for piece in self.pieces:
            out = target.views()[piece.target].reshape(-1)
            if piece.numbers:
                out[piece.start : piece.start + len(piece.numbers)] = piece.numbers
                continue
            source = self.__dict__[piece.port].views()[piece.field].reshape(-1)
            for first, to, length in piece.copies:
                self._copies.append((out[to : to + length], source[first : first + length]))

    def step(self) -> None:
        """Copy."""
        for out, source in self._copies:
            np.copyto(out, source)


def gather_block_type(
    pieces: tuple[Piece, ...],
    inputs: Mapping[str, type[Signal]],
    output: type[Signal],
    wanted: Mapping[str, Quantity | None],
    *,
    said: str,
    reads_truth: bool,
) -> type[Gather]:
    """The block type that makes the signal ``output`` of these pieces.

    ``said`` is the wire as the graph has it, and ``reads_truth`` whether its reader may do that.
    """
    ports: dict[str, Any] = {
        name: Input(signal, text="what is selected from", reads_truth=reads_truth)
        for name, signal in inputs.items()
    }
    body = {
        "__doc__": Gather.__doc__,
        "pieces": pieces,
        "wanted": dict(wanted),
        "said": said,
        "y": Output(output, text="the parts together"),
        **ports,
    }
    return type("Gather", (Gather,), body)


def part_signal(name: str, fields: Mapping[str, tuple[tuple[int, ...], str]]) -> type[Signal]:
    """A signal whose fields have these shapes and types, and carry their units."""
    body: dict[str, Any] = {
        field: Field(shape, dtype=dtype, carried=True, text="what was selected")
        for field, (shape, dtype) in fields.items()
    }
    return type(name, (Signal,), {"__doc__": "Parts of other signals.", **body})
