"""Writes LLVM's language: values of a kernel, arithmetic on them as in Python, and places in arrays.

A value is a type of ``arguments`` and its operands: a number is one, an array is its address, its
shape and, where they do not follow from the shape, its strides in bytes; a tuple is its parts.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from .arguments import ArgumentType, ArrayType, NumberType, RecordType

BOOL, INT, FLOAT = NumberType("bool"), NumberType("int"), NumberType("float")
_LARGEST_POWER = 8
"""Greater powers of whole numbers mostly do not fit into 64 bits."""
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
    """

    type: ArgumentType
    parts: tuple[str, ...]
    constant: float | int | bool | None = None
    counts: bool = False

    @property
    def kind(self) -> str:
        """Kind of the number.

        Raises:
            NotCompilable: it is none.
        """
        if isinstance(self.type, NumberType):
            return self.type.kind
        raise NotCompilable(f"this takes a number, not {_described(self.type)}")

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
        raise NotCompilable(f"this takes an array, not {_described(self.type)}")

    @property
    def members(self) -> tuple[Value, ...]:
        """The parts of a tuple.

        Raises:
            NotCompilable: it is none.
        """
        if not isinstance(self.type, RecordType):
            raise NotCompilable(f"this takes a tuple, not {_described(self.type)}")
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
        return Value(INT, (str(int(value)),), int(value), int(value) >= 0)
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
    raise NotCompilable(f"this is {_described(a)} here and {_described(b)} elsewhere")


def _described(kind: ArgumentType) -> str:
    if isinstance(kind, NumberType):
        return f"a number ({kind.kind})"
    if isinstance(kind, ArrayType):
        return f"an array of {kind.dimensions} dimensions ({kind.dtype})"
    names = ", ".join(getattr(kind.kind, "_fields", ()))
    return f"{kind.kind.__name__}({names})" if names else f"a tuple of {len(kind.parts)}"


class Slice(NamedTuple):
    """``first:end`` in an index; None where it is left out."""

    first: Value | None
    end: Value | None


class FunctionCode:
    """The body of one function, written from its beginning to its end.

    Attributes:
        reachable: whether what is written next can be reached.
        fails: whether the function can report a division by zero.
        declared: the functions of LLVM and of C that it calls, by name.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.entry: list[str] = []
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

    def fail_if(self, condition: str) -> None:
        """Report a division by zero where a condition holds."""
        onward = self.name("on")
        self.write(f"br i1 {condition}, label %fail, label %{onward}, !prof !0")
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

    # Numbers

    def convert(self, value: Value, kind: ArgumentType) -> Value:
        """Convert a value to a wider type; numbers also to narrower ones, as Python's types do."""
        if value.type == kind:
            return value
        if isinstance(kind, RecordType):
            parts = tuple(map(self.convert, value.members, kind.parts))
            return Value(kind, tuple(operand for part in parts for operand in part.parts))
        if isinstance(kind, ArrayType):
            strides = tuple(self.strides(value))
            return Value(kind, (*value.parts[: 1 + kind.dimensions], *strides))
        if value.constant is not None:
            return number({"bool": bool, "int": int, "float": float}[kind.kind](value.constant))
        ways = {
            ("bool", "int"): "zext i1 {} to i64", ("bool", "float"): "uitofp i1 {} to double",
            ("int", "float"): "sitofp i64 {} to double", ("float", "int"): "fptosi double {} to i64",
            ("int", "bool"): "icmp ne i64 {}, 0", ("float", "bool"): "fcmp une double {}, 0.0",
        }  # fmt: skip
        text = ways[value.kind, kind.kind].format(value.parts[0])
        return Value(kind, (self.result(text),), counts=value.kind == "bool")

    def operation(self, name: str, a: Value, b: Value) -> Value:
        """Write ``a + b`` and so on; ``name`` is that of the class in ``ast``."""
        if name in _BITS and a.kind == b.kind == "bool":
            return Value(BOOL, (self.result(f"{_BITS[name]} i1 {a.parts[0]}, {b.parts[0]}"),))
        kind = join(INT, join(a.type, b.type))
        if name == "Pow":
            return self._power(a, b)
        if name == "Div":
            kind = FLOAT
        a, b = self.convert(a, kind), self.convert(b, kind)
        if a.constant is not None and b.constant is not None and name in _FOLDED:
            return number(_FOLDED[name](a.constant, b.constant))
        if kind == FLOAT:
            return Value(FLOAT, (self._real(name, a, b),))
        counts = a.counts and b.counts and name in ("Add", "Mult", "FloorDiv", "Mod", "RShift")
        counts = counts or (name == "BitAnd" and (a.counts or b.counts))
        counts = counts or (name == "Mod" and b.counts)
        return Value(INT, (self._whole(name, a, b),), counts=counts)

    def _real(self, name: str, a: Value, b: Value) -> str:
        x, y = a.parts[0], b.parts[0]
        if name in ("Add", "Sub", "Mult"):
            return self.result(f"{_REAL[name]} double {x}, {y}")
        if name not in ("Div", "Mod", "FloorDiv"):
            raise NotCompilable(f"numbers with a fraction have no {name}")
        if not b.constant:
            self.fail_if(self.result(f"fcmp oeq double {y}, 0.0"))
        if name == "Div":
            return self.result(f"fdiv double {x}, {y}")
        return self._divide_with_rest(x, y)[0 if name == "FloorDiv" else 1]

    def _divide_with_rest(self, x: str, y: str) -> tuple[str, str]:
        """Write the quotient and rest of two numbers, as Python's ``float.__divmod__`` finds
        them."""
        r = self.result
        rest = self.call("fmod", "double", f"double {x}", f"double {y}")
        exact = r(f"fcmp oeq double {rest}, 0.0")
        below, under = r(f"fcmp olt double {y}, 0.0"), r(f"fcmp olt double {rest}, 0.0")
        opposite = r(f"xor i1 {below}, {under}")
        added = r(f"fadd double {rest}, {y}")
        moved = r(f"select i1 {opposite}, double {added}, double {rest}")
        zero = self.call("llvm.copysign.f64", "double", "double 0.0", f"double {y}")
        difference = r(f"fsub double {x}, {rest}")
        quotient = r(f"fdiv double {difference}, {y}")
        lower = r(f"fsub double {quotient}, 1.0")
        inexact = r(f"xor i1 {exact}, true")
        lowered = r(f"and i1 {opposite}, {inexact}")
        quotient = r(f"select i1 {lowered}, double {lower}, double {quotient}")
        whole = self.call("llvm.floor.f64", "double", f"double {quotient}")
        rest_of_whole = r(f"fsub double {quotient}, {whole}")
        far = r(f"fcmp ogt double {rest_of_whole}, 0.5")
        above = r(f"fadd double {whole}, 1.0")
        whole = r(f"select i1 {far}, double {above}, double {whole}")
        ratio = r(f"fdiv double {x}, {y}")
        nothing = self.call("llvm.copysign.f64", "double", "double 0.0", f"double {ratio}")
        none = r(f"fcmp oeq double {quotient}, 0.0")
        return (
            r(f"select i1 {none}, double {nothing}, double {whole}"),
            r(f"select i1 {exact}, double {zero}, double {moved}"),
        )

    def _whole(self, name: str, a: Value, b: Value) -> str:
        x, y, r = a.parts[0], b.parts[0], self.result
        if name in _WHOLE:
            return r(f"{_WHOLE[name]} i64 {x}, {y}")
        if name not in ("Mod", "FloorDiv"):
            raise NotCompilable(f"whole numbers have no {name}")
        if not b.constant:
            self.fail_if(r(f"icmp eq i64 {y}, 0"))
        rest = r(f"srem i64 {x}, {y}")
        if a.counts and b.counts:
            return rest if name == "Mod" else r(f"sdiv i64 {x}, {y}")
        signs, inexact = r(f"xor i64 {rest}, {y}"), r(f"icmp ne i64 {rest}, 0")
        other = r(f"icmp slt i64 {signs}, 0")
        below = r(f"and i1 {other}, {inexact}")
        if name == "Mod":
            moved = r(f"add i64 {rest}, {y}")
            return r(f"select i1 {below}, i64 {moved}, i64 {rest}")
        quotient, one = r(f"sdiv i64 {x}, {y}"), r(f"zext i1 {below} to i64")
        return r(f"sub i64 {quotient}, {one}")

    def _power(self, a: Value, b: Value) -> Value:
        if a.constant is not None and b.constant is not None:
            return number(a.constant**b.constant)
        if b.constant == 1:
            return self.convert(a, join(INT, a.type))
        if b.constant == 2:
            return self.operation("Mult", a, a)
        if a.kind != "float" and b.kind != "float":
            if b.constant is not None and 0 < b.constant <= _LARGEST_POWER:
                return self.operation("Mult", self._power(a, number(b.constant - 1)), a)
            if a.constant != 2 or not (b.counts or b.type == INT):
                raise NotCompilable("of powers of whole numbers there are x ** 3 and 2 ** n")
            return Value(INT, (self.result(f"shl i64 1, {b.parts[0]}"),), counts=True)
        x, y = self.convert(a, FLOAT).parts[0], self.convert(b, FLOAT).parts[0]
        return Value(FLOAT, (self.call("pow", "double", f"double {x}", f"double {y}"),))

    def negative(self, value: Value) -> Value:
        """``-value``."""
        if value.constant is not None:
            return number(-value.constant)
        value = self.convert(value, join(INT, value.type))
        text = "sub i64 0," if value.kind == "int" else "fneg double"
        return Value(value.type, (self.result(f"{text} {value.parts[0]}"),))

    def compare(self, name: str, a: Value, b: Value) -> Value:
        """Write ``a < b`` and so on; ``name`` is that of the class in ``ast``."""
        if name not in _COMPARISONS:
            raise NotCompilable(f"numbers are compared by < <= > >= == !=, not by {name}")
        kind = join(INT, join(a.type, b.type))
        x, y = self.convert(a, kind).parts[0], self.convert(b, kind).parts[0]
        whole, real = _COMPARISONS[name]
        text = f"icmp {whole} i64" if kind == INT else f"fcmp {real} double"
        return Value(BOOL, (self.result(f"{text} {x}, {y}"),))

    def truth(self, value: Value) -> Value:
        """``bool(value)``."""
        return self.convert(value, BOOL) if value.kind != "bool" else value

    def opposite(self, value: Value) -> Value:
        """``not value``."""
        value = self.truth(value)
        if value.constant is not None:
            return number(not value.constant)
        return Value(BOOL, (self.result(f"xor i1 {value.parts[0]}, true"),))

    def select(self, condition: Value, a: Value, b: Value) -> Value:
        """One of two numbers of one type."""
        leaf = leaves(a.type)[0]
        text = f"select i1 {condition.parts[0]}, {leaf} {a.parts[0]}, {leaf} {b.parts[0]}"
        return Value(a.type, (self.result(text),), counts=a.counts and b.counts)

    def call(self, name: str, returns: str, *arguments: str) -> str:
        """Call a function of LLVM or of C's mathematical library, without side effects."""
        kinds = ", ".join(argument.split()[0] for argument in arguments)
        self.declared[name] = f"declare {returns} @{name}({kinds}) #1"
        return self.result(f"call {returns} @{name}({', '.join(arguments)})")

    # Arrays

    def size(self, value: Value, dimension: int) -> Value:
        """``value.shape[dimension]``."""
        return Value(INT, (value.shape[dimension],), counts=True)

    def strides(self, value: Value) -> Iterator[str]:
        """Yield the bytes between neighbours in each dimension of an array."""
        kind = value.array
        if kind.order == "A":
            yield from value.parts[1 + kind.dimensions :]
            return
        step = str(np.dtype(kind.dtype).itemsize)
        found = [step]
        inner = value.shape[:0:-1] if kind.order == "C" else value.shape[:-1]
        for size in inner:
            step = self.result(f"mul nsw i64 {step}, {size}")
            found.append(step)
        yield from (found[: kind.dimensions])[:: -1 if kind.order == "C" else 1]

    def place(self, value: Value, indices: Sequence[Value]) -> str:
        """Return the address of an element; negative indices count from the end."""
        kind, leaf = value.array, memory_type(value.array)
        indices = [self._from_start(i, value.shape[k]) for k, i in enumerate(indices)]
        if kind.order == "A":
            offset = "0"
            for index, stride in zip(indices, self.strides(value), strict=False):
                offset = self._sum(offset, self._times(index.parts[0], stride))
            return self.result(f"getelementptr inbounds i8, ptr {value.parts[0]}, i64 {offset}")
        order = range(len(indices)) if kind.order == "C" else range(len(indices))[::-1]
        offset = "0"
        for k in order:
            offset = self._sum(self._times(offset, value.shape[k]), indices[k].parts[0])
        return self.result(f"getelementptr inbounds {leaf}, ptr {value.parts[0]}, i64 {offset}")

    def _times(self, a: str, b: str) -> str:
        return "0" if "0" in (a, b) else self.result(f"mul nsw i64 {a}, {b}")

    def _sum(self, a: str, b: str) -> str:
        return b if a == "0" else a if b == "0" else self.result(f"add nsw i64 {a}, {b}")

    def _from_start(self, index: Value, size: str) -> Value:
        if index.kind != "int":
            raise NotCompilable("an index is a whole number; write int(...)")
        if index.counts:
            return index
        wrapped = self.result(f"add nsw i64 {index.parts[0]}, {size}")
        if index.constant is not None:
            return Value(INT, (wrapped,))
        below = self.result(f"icmp slt i64 {index.parts[0]}, 0")
        return Value(INT, (self.result(f"select i1 {below}, i64 {wrapped}, i64 {index.parts[0]}"),))

    def element(self, value: Value, indices: Sequence[Value]) -> Value:
        """One element of an array as a number."""
        return self.read(value.array, self.place(value, indices))

    def read(self, kind: ArrayType, place: str) -> Value:
        """Read the element at an address."""
        dtype, leaf = np.dtype(kind.dtype), memory_type(kind)
        loaded = self.result(f"load {leaf}, ptr {place}")
        if dtype.kind == "b":
            return Value(BOOL, (self.result(f"icmp ne i8 {loaded}, 0"),))
        if dtype.kind == "f":
            return Value(FLOAT, (_same(self, loaded, leaf, "double", "fpext"),))
        text = "zext" if dtype.kind == "u" else "sext"
        return Value(INT, (_same(self, loaded, leaf, "i64", text),), counts=dtype.kind == "u")

    def assign(self, kind: ArrayType, place: str, value: Value) -> None:
        """Write a number to the element at an address, as NumPy converts it."""
        dtype, leaf = np.dtype(kind.dtype), memory_type(kind)
        wanted = {"b": BOOL, "f": FLOAT}.get(dtype.kind, INT)
        operand = self.convert(value, wanted).parts[0]
        if wanted == BOOL:
            operand = self.result(f"zext i1 {operand} to i8")
        elif leaf not in ("double", "i64"):
            text = "fptrunc double" if leaf == "float" else "trunc i64"
            operand = self.result(f"{text} {operand} to {leaf}")
        self.write(f"store {leaf} {operand}, ptr {place}")

    def view(self, value: Value, indices: Sequence[Value | Slice]) -> Value:
        """``value[i, a:b]``: a part of an array, in the same memory."""
        kind = value.array
        full = [*indices, *[Slice(None, None)] * (kind.dimensions - len(indices))]
        if len(full) > kind.dimensions:
            raise NotCompilable(f"{len(indices)} indices for {_described(kind)}")
        begins: list[Value] = []
        shape: list[str] = []
        kept: list[int] = []
        for k, index in enumerate(full):
            if isinstance(index, Value):
                begins.append(self._from_start(index, value.shape[k]))
                continue
            first, size = self._range(index, value.shape[k])
            begins.append(Value(INT, (first,), counts=True))
            shape.append(size)
            kept.append(k)
        address = self.place(value, begins)
        order = "A"
        inner = full if kind.order == "C" else full[::-1]
        if kind.order != "A" and _is_contiguous(inner):
            order = kind.order if len(kept) > 1 else "C"
        made = ArrayType(kind.dtype, len(kept), order)
        if order != "A":
            return Value(made, (address, *shape))
        strides = list(self.strides(value))
        return Value(made, (address, *shape, *(strides[k] for k in kept)))

    def _range(self, index: Slice, size: str) -> tuple[str, str]:
        """Return the first place and the length of a slice, as Python limits them."""
        first = "0" if index.first is None else self._limited(index.first, size)
        last = size if index.end is None else self._limited(index.end, size)
        if first == "0":
            return first, last
        length = self.result(f"sub nsw i64 {last}, {first}")
        return first, self.call("llvm.smax.i64", "i64", f"i64 {length}", "i64 0")

    def _limited(self, bound: Value, size: str) -> str:
        place = self._from_start(bound, size).parts[0]
        if place == "0":
            return place
        if not bound.counts:
            place = self.call("llvm.smax.i64", "i64", f"i64 {place}", "i64 0")
        return self.call("llvm.smin.i64", "i64", f"i64 {place}", f"i64 {size}")

    def transposed(self, value: Value) -> Value:
        """``value.T``."""
        kind = value.array
        if kind.dimensions < 2:
            return value
        order = {"C": "F", "F": "C", "A": "A"}[kind.order]
        strides = value.parts[1 + kind.dimensions :][::-1]
        made = ArrayType(kind.dtype, kind.dimensions, order)
        return Value(made, (value.parts[0], *value.shape[::-1], *strides))

    def loop(self, sizes: Sequence[str], body: Callable[[list[Value]], None]) -> None:
        """Write a body for each place of an array of some sizes, row after row."""
        self._nested(list(sizes), [], body)

    def _nested(
        self, sizes: list[str], places: list[Value], body: Callable[[list[Value]], None]
    ) -> None:
        if not sizes:
            body(places)
            return
        counter = self.variable(INT)
        head, inside, end = self.name("head"), self.name("body"), self.name("end")
        self.store(number(0), counter)
        self.label(head)
        place = self.load(INT, counter)
        more = self.result(f"icmp slt i64 {place.parts[0]}, {sizes[0]}")
        self.branch(Value(BOOL, (more,)), inside, end)
        self.label(inside)
        self._nested(sizes[1:], [*places, Value(INT, place.parts, counts=True)], body)
        self.store(Value(INT, (self.result(f"add nsw i64 {place.parts[0]}, 1"),)), counter)
        self.jump(head)
        self.label(end)


def memory_type(kind: ArrayType) -> str:
    """LLVM's type of an element in memory."""
    dtype = np.dtype(kind.dtype)
    if dtype.kind == "f" and dtype.itemsize in (4, 8):
        return "double" if dtype.itemsize == 8 else "float"
    if dtype.kind in "iub":
        return f"i{8 * dtype.itemsize}"
    raise NotCompilable(f"an array of {kind.dtype} cannot be read")


def _same(code: FunctionCode, operand: str, leaf: str, wanted: str, text: str) -> str:
    return operand if leaf == wanted else code.result(f"{text} {leaf} {operand} to {wanted}")


def _is_contiguous(indices: Sequence[Any]) -> bool:
    """Return whether a part of an array in the order of C has no gaps: numbers, one slice, whole
    slices."""
    sliced = False
    for index in indices:
        if isinstance(index, Value):
            if sliced:
                return False
        elif sliced and index != Slice(None, None):
            return False
        else:
            sliced = True
    return True


_ZERO = {"double": "0.0", "i64": "0", "i1": "false", "ptr": "null"}
_REAL = {"Add": "fadd", "Sub": "fsub", "Mult": "fmul"}
_WHOLE = {
    "Add": "add nsw", "Sub": "sub nsw", "Mult": "mul nsw", "BitAnd": "and", "BitOr": "or",
    "BitXor": "xor", "LShift": "shl", "RShift": "ashr",
}  # fmt: skip
_BITS = {"BitAnd": "and", "BitOr": "or", "BitXor": "xor"}
_FOLDED: dict[str, Callable[[Any, Any], Any]] = {
    "Add": lambda a, b: a + b, "Sub": lambda a, b: a - b, "Mult": lambda a, b: a * b,
}  # fmt: skip
_COMPARISONS = {
    "Lt": ("slt", "olt"), "LtE": ("sle", "ole"), "Gt": ("sgt", "ogt"), "GtE": ("sge", "oge"),
    "Eq": ("eq", "oeq"), "NotEq": ("ne", "une"),
}  # fmt: skip
