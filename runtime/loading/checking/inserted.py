"""The blocks that loading inserts, and the values that they hold.

There is a delay for each delayed wire, a constant for each value that stands in place of a wire, and a ``Gather``
for each wire that is composed of parts of other signals.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from ....files.nodes import ListNode, MapNode, Node, ScalarNode, plain, text_of
from ....files.problems import Code, Problems, listing, nearest
from ...language.block import Block, Input, Output
from ...language.delay import DelayParameters, copy_call, delay_block_type
from ...language.errors import UnitError
from ...language.flat_graph import FlatWire
from ...language.parameters import Parameters, parameter
from ...language.quantities import UNCHECKED, InputQuantities, OutputQuantities, Quantity
from ...language.signals import Field, Signal
from ...language.stages import BlockSpec, Wire
from ...language.unit_algebra import ONE
from ...language.units import QUANTITY, Unit, parse_quantity, parse_unit, unit_in
from .block_check import BlockDraft


@dataclass(frozen=True)
class GatherPiece:
    """Some elements of one source, or numbers, and where they go in the field ``target``.

    ``copies`` are stretches (first in the source, first in the target, length), both in row order.
    """

    target: str
    port: str = ""
    field: str = ""
    copies: tuple[tuple[int, int, int], ...] = ()
    numbers: tuple[float, ...] = ()
    start: int = 0

    def places(self) -> list[int]:
        """Return the elements of the target that it writes, in the order of the source."""
        if self.numbers:
            return list(range(self.start, self.start + len(self.numbers)))
        return [to + k for _, to, length in self.copies for k in range(length)]

    def quantity(self, whole: Quantity | None) -> Quantity | None:
        """Return the quantity of the elements that it takes of a source."""
        if whole is None or not whole.elements:
            return whole
        taken = (first + k for first, _, length in self.copies for k in range(length))
        size = len(whole.elements)
        return Quantity.of((whole.elements[k % size] for k in taken), whole.frame)


class Gather(Block):
    """Copies parts of its inputs into one signal; a wire such as ``u: robot.joints.position`` is one.

    Subclasses made by ``gather_block_type`` fix its ports. It raises no errors: what is selected is
    checked at load.
    """

    Params = Parameters
    pieces: ClassVar[tuple[GatherPiece, ...]] = ()
    wanted: ClassVar[Mapping[str, Quantity | None]] = {}
    """Quantities of the reader's fields; ``None`` for one that takes any."""

    wire_text: ClassVar[str] = ""
    """The wire as the graph has it."""

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Infer the common quantity of the parts of a field.

        They must have the quantity of the reader. If it takes any and they differ, each element of a
        vector keeps its own unit; a matrix's are not checked.
        """
        return {f"y.{name}": cls._quantity(name, inputs) for name in cls.wanted}

    @classmethod
    def _quantity(cls, target: str, inputs: InputQuantities) -> Quantity | None:
        wanted = cls.wanted[target]
        pieces = [piece for piece in cls.pieces if piece.target == target]
        found = {p: p.quantity(inputs[f"{p.port}.{p.field}"]) for p in pieces if p.port}
        if wanted is not None:
            for piece, quantity in found.items():
                name = f"{piece.port}.{piece.field}"
                inputs.agree(name, wanted, f"the reader's {target} is {wanted}", quantity)
            return wanted
        known = [quantity for quantity in found.values() if quantity is not None]
        if len(known) < len(found):
            return None
        plain = any(any(piece.numbers) for piece in pieces)  # zero is zero in every unit
        first = known[0] if known else UNCHECKED
        if not plain and not first.elements and all(each == first for each in known):
            return first
        if len(cls.outputs["y"].signal.fields[target].shape) != 1:
            return UNCHECKED
        units: dict[int, Unit | None] = {}
        for piece in pieces:
            quantity = found.get(piece) or UNCHECKED
            units.update(zip(piece.places(), quantity.units(len(piece.places())), strict=True))
        frames = {each.frame for each in known}
        return Quantity.of(
            (units[k] for k in sorted(units)), first.frame if len(frames) == 1 else None
        )

    def setup(self) -> None:
        """Write the numbers, and make a call for every stretch."""
        target: Signal = self.__dict__["y"]
        calls = []
        for piece in self.pieces:
            out = target.views()[piece.target].reshape(-1)
            if piece.numbers:
                out[piece.start : piece.start + len(piece.numbers)] = piece.numbers
                continue
            source = self.__dict__[piece.port].views()[piece.field].reshape(-1)
            for first, to, length in piece.copies:
                calls.append(copy_call(source[first : first + length], out[to : to + length]))
        self.kernel_calls = calls

    def step(self) -> None:
        """Copy."""
        for call in self.kernel_calls:
            call.run()


def gather_block_type(
    pieces: tuple[GatherPiece, ...],
    inputs: Mapping[str, type[Signal]],
    output: type[Signal],
    wanted: Mapping[str, Quantity | None],
    *,
    wire_text: str,
    reads_truth: bool,
) -> type[Gather]:
    """Return the block type that makes the signal ``output`` of these pieces.

    ``wire_text`` is the wire as the graph has it, and ``reads_truth`` whether its reader may do that.
    """
    ports: dict[str, Any] = {
        name: Input(signal, text="the vector to select from", reads_truth=reads_truth)
        for name, signal in inputs.items()
    }
    body = {
        "__doc__": Gather.__doc__,
        "pieces": pieces,
        "wanted": dict(wanted),
        "wire_text": wire_text,
        "y": Output(output, text="the parts together"),
        **ports,
    }
    return type("Gather", (Gather,), body)


def selected_signal(
    name: str,
    fields: Mapping[str, tuple[tuple[int, ...], str]],
    quaternions: Container[str] = (),
) -> type[Signal]:
    """Return a signal whose fields have these shapes and types, and carry their units.

    ``quaternions`` names the fields that are quaternions where they have four numbers last.
    """
    body: dict[str, Any] = {
        field: Field(
            shape, dtype=dtype, inferred=True, text="what was selected",
            quaternion=field in quaternions and shape[-1:] == (4,) and dtype == "float64",
        )
        for field, (shape, dtype) in fields.items()
    }  # fmt: skip
    return type(name, (Signal,), {"__doc__": "Parts of other signals.", **body})


class ConstantParameters(Parameters):
    """The parameters of every constant."""

    value: Mapping[str, Any] = parameter({}, text="values by field; fields not named are zero")


class ConstantSignal(Block):
    """Holds constant values: y[n] = value, and zero in the fields that are not named, or no turn.

    A graph makes it by ``{value: {field: number}}`` in place of a source. Subclasses made by
    ``constant_block_type`` fix the signal. It raises no errors: the values are checked at load.
    """

    Params = ConstantParameters
    params: ConstantParameters

    def setup(self) -> None:
        """Write the values once; no other code writes to the output."""
        signal: Signal = self.__dict__["y"]
        for name, value in self.params.value.items():
            signal.views()[name][...] = value

    def step(self) -> None:
        """Do nothing: the output is constant."""


@lru_cache(maxsize=256)
def constant_block_type(signal: type[Signal]) -> type[ConstantSignal]:
    """Return the block type that holds a constant ``signal`` in its output ``y``."""
    text = "the values"
    body = {"__doc__": ConstantSignal.__doc__, "y": Output(signal, text=text)}
    return type(f"Constant{signal.__name__}", (ConstantSignal,), body)


def insert_delay(
    reader: BlockDraft, name: str, wire: FlatWire, source: BlockDraft, values: Any
) -> BlockSpec:
    """Return the block that delays a wire; it runs in the same ticks as the wire's source."""
    signal = source.outputs[wire.source_port].signal
    return BlockSpec(
        path=f"{reader.flat.path}/{name}~delay",
        block_type=delay_block_type(signal, wire.delay),
        params=DelayParameters(initial=values),
        wires={"u": Wire(wire.source, f"{reader.flat.path}/{name}~delay.u", where=wire.where)},
        dimensions=source.dimensions,
        period_ticks=source.period_ticks,
        offset_ticks=source.offset_ticks,
        where=wire.where,
    )


def insert_constant(reader: BlockDraft, name: str, wire: FlatWire, values: Any) -> BlockSpec:
    """Return the block that writes a constant which stands in place of a source."""
    signal: type[Any] = reader.inputs[name].signal
    return BlockSpec(
        path=f"{reader.flat.path}/{name}~constant",
        block_type=constant_block_type(signal),  # type: ignore[arg-type]  # a class made here
        params=ConstantParameters(value=values),
        wires={},
        dimensions=reader.dimensions,
        period_ticks=reader.period_ticks,
        offset_ticks=reader.offset_ticks,
        where=wire.where,
    )


def read_values(
    values: MapNode, signal: type[Signal], owner: BlockDraft, at: str, problems: Problems
) -> dict[str, Any]:
    """Values by field of ``signal``: numbers, nested lists, or texts with a unit, all checked."""
    found: dict[str, Any] = {}
    for entry in values:
        field = signal.fields.get(entry.key)
        if field is None:
            similar = nearest(entry.key, signal.fields)
            problems.add(
                Code.INITIAL,
                f"{signal.__name__} has no field {entry.key!r}",
                entry.key_where,
                at=at,
                expected=listing(signal.fields),
                found=entry.key,
                nearest=similar,
                fix=similar[0] if similar else f"remove {entry.key!r}",
            )
            continue
        value, expected = _array(entry.value, field, owner)
        if expected:
            problems.add(
                Code.INITIAL,
                f"{at}: {entry.key} cannot be {_short(entry.value)}",
                entry.value.where,
                at=at,
                expected=expected,
                found=_short(entry.value),
            )
        else:
            found[entry.key] = value
    return found


def own_unit(node: Node) -> Unit | None:
    """Return the unit of a constant for an input that takes any: that of its first number with a
    unit.

    Numbers without a unit are plain; zeros alone have a unit that is not checked, because zero
    means the same in all of them.
    """
    if isinstance(node, ScalarNode):
        if isinstance(node.value, str) and QUANTITY.match(node.value) is not None:
            try:
                return parse_unit(unit_in(node.value))
            except UnitError:
                return ONE  # reported with the value
        return None if node.value in (0, False) else ONE
    found = [own_unit(item) for item in (node.items if isinstance(node, ListNode) else ())]
    units = [unit for unit in found if unit is not None]
    return next((unit for unit in units if unit is not ONE), units[0] if units else None)


def _array(node: Node, field: Field, owner: BlockDraft) -> tuple[Any, str]:
    """Read the value, with an empty text; or return ``None`` with a text of what was expected."""
    shape = owner.shape(field)
    unit = f" in {field.unit}" if field.unit is not None and str(field.unit) != "1" else ""
    types: tuple[type, ...]
    if field.dtype_name == "bool":
        types = (bool,)
        expected = "true or false"
    elif field.dtype_name == "int64":
        types = (int,)
        expected = "a whole number"
    else:
        types = (int, float)
        expected = f"a finite number{unit}"
    if shape:
        expected = f"{expected}, or a list of shape [{', '.join(map(str, shape))}]"
    own = field.unit
    if field.inferred:
        own = own_unit(node) or ONE
    names = {} if field.values is None else {each.name: int(each) for each in field.values}
    if names:
        expected = f"{listing(names)}, or {expected}"
    try:
        value = _numbers(node, own, types, names)
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        return None, expected
    if not np.isfinite(array).all() or (shape is not None and array.shape not in ((), shape)):
        return None, expected
    if field.dtype_name == "int64" and np.abs(array).max(initial=0.0) >= 2.0**63:
        return None, expected
    return value, ""


def _numbers(
    node: Node, unit: Unit | None, types: tuple[type, ...], names: Mapping[str, int]
) -> Any:
    """Plain numbers, also for the ``names`` of an enumeration. Raises ``ValueError`` for anything else."""
    if isinstance(node, ScalarNode):
        value = node.value
        if isinstance(value, str) and value.upper() in names:
            return names[value.upper()]
        if isinstance(value, str) and unit is not None:
            try:
                return parse_quantity(value, unit.text)
            except UnitError as error:
                raise ValueError(str(error)) from error
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
            raise ValueError(f"{value!r} is not a number")
        return value
    if isinstance(node, MapNode):
        raise TypeError("a mapping is not a number")
    return [_numbers(item, unit, types, names) for item in node.items]


def _short(node: Node) -> str:
    text = text_of(plain(node))
    return text if len(text) <= 60 else f"{text[:57]}..."
