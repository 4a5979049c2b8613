"""Writes the places and the elements of arrays in LLVM's language, and loops over them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arguments import ArrayType
from .failures import Failure
from .llvm_code import BOOL, FLOAT, INT, NotCompilable, Slice, Value, described, number
from .number_code import NumberCode

SIZE_BITS = 47
"""Bits of the size of an array; a processor has no memory for more."""


class FunctionCode(NumberCode):
    """The body of one function, written from its beginning to its end."""

    def room(self, shape: tuple[int, ...], dtype: str) -> Value:
        """Make an array of zeros on the stack."""
        kind = ArrayType(dtype, len(shape), "C")
        count = int(np.prod(shape))
        place, leaf = f"%{self.name('room')}", memory_type(kind)
        self.entry.append(f"  {place} = alloca [{max(count, 1)} x {leaf}], align 16")
        made = Value(kind, (place, *map(str, shape)))
        flat = Value(ArrayType(dtype, 1, "C"), (place, str(count)))
        zero = number(False if dtype == "bool" else 0 if dtype == "int64" else 0.0)
        self.loop([str(count)], lambda i: self.assign(flat.array, self.place(flat, i), zero))
        return made

    def constant_array(self, value: NDArray[Any]) -> Value:
        """Return an array that stands in the kernel's module."""
        kind = ArrayType(value.dtype.name, value.ndim, "C")
        content = np.ascontiguousarray(value).tobytes()
        name = f"array_{hashlib.blake2b(content + str(kind).encode(), digest_size=8).hexdigest()}"
        octets = "".join(f"\\{octet:02x}" for octet in content)
        text = f'@{name} = private constant [{len(content)} x i8] c"{octets}", align 16'
        self.declared[name] = text
        return Value(kind, (f"@{name}", *map(str, value.shape)))

    def size(self, value: Value, dimension: int) -> Value:
        """``value.shape[dimension]``."""
        return Value(INT, (value.shape[dimension],), counts=True, bits=SIZE_BITS)

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
        if dtype == np.uint64:
            raise NotCompilable("an array of uint64 cannot be read; use int64")
        text, width = ("zext", 0) if dtype.kind == "u" else ("sext", 1)
        bits = 8 * dtype.itemsize - width
        counts = dtype.kind == "u"
        return Value(INT, (_same(self, loaded, leaf, "i64", text),), counts=counts, bits=bits)

    def assign(self, kind: ArrayType, place: str, value: Value) -> None:
        """Write a number to the element at an address, as NumPy converts it."""
        dtype, leaf = np.dtype(kind.dtype), memory_type(kind)
        wanted = {"b": BOOL, "f": FLOAT}.get(dtype.kind, INT)
        operand = self.convert(value, wanted).parts[0]
        if wanted == BOOL:
            operand = self.result(f"zext i1 {operand} to i8")
        elif leaf not in ("double", "i64"):
            text = "fptrunc double" if leaf == "float" else "trunc i64"
            if leaf != "float":
                self._check_width(self.convert(value, INT), dtype)
            operand = self.result(f"{text} {operand} to {leaf}")
        self.write(f"store {leaf} {operand}, ptr {place}")

    def _check_width(self, value: Value, dtype: np.dtype[Any]) -> None:
        """Report a whole number that an element has no room for."""
        width = 8 * dtype.itemsize - (dtype.kind != "u")
        if value.bits <= width and (value.counts or dtype.kind != "u"):
            return
        limits = np.iinfo(dtype)
        low = self.result(f"icmp slt i64 {value.parts[0]}, {limits.min}")
        high = self.result(f"icmp sgt i64 {value.parts[0]}, {limits.max}")
        self.fail_if(self.result(f"or i1 {low}, {high}"), Failure.TOO_LARGE)

    def view(self, value: Value, indices: Sequence[Value | Slice]) -> Value:
        """``value[i, a:b]``: a part of an array, in the same memory."""
        kind = value.array
        full = [*indices, *[Slice(None, None)] * (kind.dimensions - len(indices))]
        if len(full) > kind.dimensions:
            raise NotCompilable(f"{len(indices)} indices for {described(kind)}")
        begins: list[Value] = []
        shape: list[str] = []
        kept: list[int] = []
        steps: list[int] = []
        for k, index in enumerate(full):
            if isinstance(index, Value):
                begins.append(self._from_start(index, value.shape[k]))
                continue
            first, size = self._range(index, value.shape[k])
            begins.append(Value(INT, (first,), counts=True))
            shape.append(size)
            kept.append(k)
            steps.append(index.step)
        address = self.place(value, begins)
        order = "A"
        inner = full if kind.order == "C" else full[::-1]
        if kind.order != "A" and _is_contiguous(inner):
            order = kind.order if len(kept) > 1 else "C"
        made = ArrayType(kind.dtype, len(kept), order)
        if order != "A":
            return Value(made, (address, *shape))
        strides = list(self.strides(value))
        moved = (self._times_step(strides[k], step) for k, step in zip(kept, steps, strict=True))
        return Value(made, (address, *shape, *moved))

    def _times_step(self, stride: str, step: int) -> str:
        return stride if step == 1 else self.result(f"mul nsw i64 {stride}, {step}")

    def _range(self, index: Slice, size: str) -> tuple[str, str]:
        """Return the first place and the length of a slice, as Python limits them."""
        if index.step != 1:
            return self._range_in_steps(index, size)
        first = "0" if index.first is None else self._limited(index.first, size)
        last = size if index.end is None else self._limited(index.end, size)
        if first == "0":
            return first, last
        length = self.result(f"sub nsw i64 {last}, {first}")
        return first, self.call("llvm.smax.i64", "i64", f"i64 {length}", "i64 0")

    def _range_in_steps(self, index: Slice, size: str) -> tuple[str, str]:
        r, step = self.result, index.step
        least, most = "0" if step > 0 else "-1", size
        if step < 0:
            most = r(f"sub nsw i64 {size}, 1")
        ends = []
        for bound, default in (
            (index.first, least if step > 0 else most),
            (index.end, most if step > 0 else least),
        ):
            if bound is None:
                ends.append(default)
                continue
            place = self._from_start(bound, size).parts[0]
            place = self.call("llvm.smax.i64", "i64", f"i64 {place}", f"i64 {least}")
            ends.append(self.call("llvm.smin.i64", "i64", f"i64 {place}", f"i64 {most}"))
        first, last = ends
        span = r(f"sub nsw i64 {last}, {first}") if step > 0 else r(f"sub nsw i64 {first}, {last}")
        span = self.call("llvm.smax.i64", "i64", f"i64 {span}", "i64 0")
        up = r(f"add nsw i64 {span}, {abs(step) - 1}")
        return first, r(f"sdiv i64 {up}, {abs(step)}")

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
        self._nested(
            sizes[1:], [*places, Value(INT, place.parts, counts=True, bits=SIZE_BITS)], body
        )
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
        elif index.step != 1 or (sliced and index != Slice(None, None)):
            return False
        else:
            sliced = True
    return True
