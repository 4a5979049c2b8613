"""Writes LLVM's language: values of a kernel, and the lines of a function.

A value is a type of ``arguments`` and its operands: a number is one, an array is its address, its
shape and, where they do not follow from the shape, its strides in bytes; a tuple is its parts.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from .arguments import ArgumentType, ArrayType, NumberType, RecordType
from .failures import MOST_SITES, Failure, Site

BOOL, INT, FLOAT = NumberType("bool"), NumberType("int"), NumberType("float")
_RANK = {"bool": 0, "int": 1, "float": 2}
_NUMBER = {"bool": "i1", "int": "i64", "float": "double"}


class NotCompilable(Exception):
    """A kernel does something that compiled code cannot."""


@dataclass(frozen=True)
class Value:
    """A value of a kernel.

    Attributes:
        type: what it is.
        parts: its operands in LLVM's language.
        constant: of a number that is known, else None.
        counts: whether it is a whole number that cannot be negative.
        bits: a whole number is at least ``-2**bits`` and less than ``2**bits``.
    """

    type: ArgumentType
    parts: tuple[str, ...]
    constant: float | int | bool | None = None
    counts: bool = False
    bits: int = 63

    @property
    def kind(self) -> str:
        """Kind of the number.

        Raises:
            NotCompilable: it is none.
        """
        if isinstance(self.type, NumberType):
            return self.type.kind
        raise NotCompilable(f"this takes a number, not {described(self.type)}")

    @property
    def shape(self) -> tuple[str, ...]:
        """The operands with the sizes of an array."""
        return self.parts[1 : 1 + self.array.dimensions]

    @property
    def array(self) -> ArrayType:
        """The type of an array.

        Raises:
            NotCompilable: it is none.
        """
        if isinstance(self.type, ArrayType):
            return self.type
        raise NotCompilable(f"this takes an array, not {described(self.type)}")

    @property
    def members(self) -> tuple[Value, ...]:
        """The parts of a tuple.

        Raises:
            NotCompilable: it is none.
        """
        if not isinstance(self.type, RecordType):
            raise NotCompilable(f"this takes a tuple, not {described(self.type)}")
        made, first = [], 0
        for part in self.type.parts:
            count = len(leaves(part))
            made.append(Value(part, self.parts[first : first + count]))
            first += count
        return tuple(made)


NOTHING = Value(RecordType(tuple, ()), ())
"""Result of a kernel that returns nothing."""


def number(value: float | bool) -> Value:
    """Make a constant."""
    if isinstance(value, bool | np.bool_):
        return Value(BOOL, ("true" if value else "false",), bool(value))
    if isinstance(value, int | np.integer):
        value = int(value)
        if not -(2**63) <= value < 2**63:
            raise NotCompilable(f"{value} does not fit into 64 bits")
        bits = (value if value >= 0 else ~value).bit_length()
        return Value(INT, (str(value),), value, value >= 0, bits)
    (bits,) = struct.unpack("<Q", struct.pack("<d", float(value)))
    return Value(FLOAT, (f"0x{bits:016X}",), float(value))


def tuple_of(values: Sequence[Value]) -> Value:
    """Several values in one."""
    parts = tuple(part for value in values for part in value.parts)
    return Value(RecordType(tuple, tuple(value.type for value in values)), parts)


@cache
def leaves(kind: ArgumentType) -> tuple[str, ...]:
    """LLVM's types of the operands of a value."""
    if isinstance(kind, NumberType):
        return (_NUMBER[kind.kind],)
    if isinstance(kind, ArrayType):
        words = kind.dimensions * (2 if kind.order == "A" else 1)
        return ("ptr", *["i64"] * words)
    return tuple(leaf for part in kind.parts for leaf in leaves(part))


def join(a: ArgumentType, b: ArgumentType) -> ArgumentType:
    """Return the type of a value that is of one type or the other.

    Raises:
        NotCompilable: there is none.
    """
    if a == b:
        return a
    match a, b:
        case NumberType(), NumberType():
            return max(a, b, key=lambda kind: _RANK[kind.kind])
        case ArrayType(), ArrayType() if (a.dtype, a.dimensions) == (b.dtype, b.dimensions):
            return ArrayType(a.dtype, a.dimensions, "A")
        case RecordType(), RecordType() if a.kind is b.kind and len(a.parts) == len(b.parts):
            return RecordType(a.kind, tuple(map(join, a.parts, b.parts)))
    raise NotCompilable(f"this is {described(a)} here and {described(b)} elsewhere")


def described(kind: ArgumentType) -> str:
    if isinstance(kind, NumberType):
        return f"a number ({kind.kind})"
    if isinstance(kind, ArrayType):
        return f"an array of {kind.dimensions} dimensions ({kind.dtype})"
    names = ", ".join(getattr(kind.kind, "_fields", ()))
    return f"{kind.kind.__name__}({names})" if names else f"a tuple of {len(kind.parts)}"


class Slice(NamedTuple):
    """``first:end:step`` in an index; None where it is left out."""

    first: Value | None
    end: Value | None
    step: int = 1


class CodeLines:
    """The body of one function, written from its beginning to its end.

    Attributes:
        reachable: whether what is written next can be reached.
        fails: whether the function can report a failure.
        sites: where it does so itself.
        line: of the source, which is translated at present.
        declared: the functions of LLVM and of C that it calls, by name.
    """

    def __init__(self, origin: int = 0) -> None:
        self.lines: list[str] = []
        self.entry: list[str] = []
        self.exits: list[str] = []
        self.sites: list[Site] = []
        self.line = 0
        self._origin = origin
        self.declared: dict[str, str] = {}
        self.reachable = True
        self.fails = False
        self._count = 0

    # Lines and labels

    def name(self, stem: str = "t") -> str:
        """Make a new name."""
        self._count += 1
        return f"{stem}{self._count}"

    def write(self, text: str) -> None:
        """Add an instruction without a result."""
        if self.reachable:
            self.lines.append(f"  {text}")

    def result(self, text: str) -> str:
        """Add an instruction, and return the operand with its result."""
        name = f"%{self.name()}"
        self.write(f"{name} = {text}")
        return name

    def label(self, name: str) -> None:
        """Begin a basic block."""
        if self.reachable:
            self.lines.append(f"  br label %{name}")
        self.lines.append(f"{name}:")
        self.reachable = True

    def jump(self, name: str) -> None:
        """Go to a basic block."""
        self.write(f"br label %{name}")
        self.reachable = False

    def branch(self, condition: Value, yes: str, no: str) -> None:
        """Go to one of two basic blocks."""
        if condition.constant is not None:
            self.jump(yes if condition.constant else no)
            return
        self.write(f"br i1 {condition.parts[0]}, label %{yes}, label %{no}")
        self.reachable = False

    def fail_if(self, condition: str, failure: Failure = Failure.DIVIDED_BY_ZERO) -> None:
        """Report a failure where a condition holds."""
        if len(self.sites) < MOST_SITES:
            self.sites.append(Site(failure, self.line))
        self._leave_if(condition, str(self._origin << 12 | len(self.sites) << 4 | failure))

    def pass_on(self, status: str) -> None:
        """Report the failure of a called function, whose status is an operand."""
        self._leave_if(self.result(f"icmp ne i32 {status}, 0"), status)

    def _leave_if(self, condition: str, status: str) -> None:
        onward, failed = self.name("on"), self.name("failed")
        self.write(f"br i1 {condition}, label %{failed}, label %{onward}, !prof !0")
        if self.reachable:
            self.exits += [f"{failed}:", f"  ret i32 {status}"]
        self.fails = True
        self.reachable = False
        self.label(onward)

    def variable(self, kind: ArgumentType) -> tuple[str, ...]:
        """Allocate a variable, with one address for each of its operands."""
        places = []
        for leaf in leaves(kind):
            place = f"%{self.name('v')}"
            self.entry.append(f"  {place} = alloca {leaf}")
            self.entry.append(f"  store {leaf} {_ZERO[leaf]}, ptr {place}")
            places.append(place)
        return tuple(places)

    def store(self, value: Value, places: tuple[str, ...]) -> None:
        """Write a value into its room."""
        for leaf, part, place in zip(leaves(value.type), value.parts, places, strict=True):
            self.write(f"store {leaf} {part}, ptr {place}")

    def load(self, kind: ArgumentType, places: tuple[str, ...]) -> Value:
        """Read a value from its room."""
        pairs = zip(leaves(kind), places, strict=True)
        return Value(kind, tuple(self.result(f"load {leaf}, ptr {place}") for leaf, place in pairs))


_ZERO = {"double": "0.0", "i64": "0", "i1": "false", "ptr": "null"}
