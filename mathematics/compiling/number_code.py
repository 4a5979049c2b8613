"""Writes arithmetic on numbers in LLVM's language, as Python computes it.

A whole number that would not fit into 64 bits ends the run with an error, where Python would go on with
a longer one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from .arguments import ArgumentType, ArrayType, RecordType
from .failures import Failure
from .llvm_code import BOOL, FLOAT, INT, CodeLines, NotCompilable, Value, join, leaves, number

_MANTISSA = 53
"""Whole numbers of more bits are not all floats."""
_LARGEST_SHIFT = 5
"""Counts of more bits may be beyond 62."""
_LARGEST_POWER = 8
"""Greater powers of whole numbers mostly do not fit into 64 bits."""


class NumberCode(CodeLines):
    """Numbers of a function."""

    def strides(self, value: Value) -> Iterator[str]:
        """Yield the bytes between neighbours in each dimension of an array."""
        raise NotImplementedError

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
        if (value.kind, kind.kind) == ("float", "int"):
            least, beyond = number(-(2.0**63)).parts[0], number(2.0**63).parts[0]
            low = self.result(f"fcmp oge double {value.parts[0]}, {least}")
            high = self.result(f"fcmp olt double {value.parts[0]}, {beyond}")
            fits = self.result(f"and i1 {low}, {high}")
            self.fail_if(self.result(f"xor i1 {fits}, true"), Failure.TOO_LARGE)
        flag = value.kind == "bool"
        return Value(kind, (self.result(text),), counts=flag, bits=1 if flag else 63)

    def exact(self, value: Value) -> Value:
        """Check that a float has room for a whole number; a larger one ends the run, where Python would go
        on with the whole number."""
        if value.kind == "int" and value.bits > _MANTISSA and value.constant is None:
            moved = self.result(f"add i64 {value.parts[0]}, {2**_MANTISSA}")
            beyond = self.result(f"icmp ugt i64 {moved}, {2 ** (_MANTISSA + 1)}")
            self.fail_if(beyond, Failure.TOO_LARGE)
        return value

    def operation(self, name: str, a: Value, b: Value) -> Value:
        """Write ``a + b`` and so on; ``name`` is that of the class in ``ast``."""
        if name in _BITS and a.kind == b.kind == "bool":
            return Value(BOOL, (self.result(f"{_BITS[name]} i1 {a.parts[0]}, {b.parts[0]}"),))
        kind = join(INT, join(a.type, b.type))
        if name == "Pow":
            return self._power(a, b)
        if name == "Div":
            if kind == INT:
                a, b = self.exact(a), self.exact(b)
            kind = FLOAT
        if a.type == b.type == BOOL:
            text = "flags have no arithmetic in a kernel; combine them by 'and', 'or', or write int(...)"
            raise NotCompilable(text)
        a, b = self.convert(a, kind), self.convert(b, kind)
        if a.constant is not None and b.constant is not None and name in _FOLDED:
            return number(_FOLDED[name](a.constant, b.constant))
        if kind == FLOAT:
            return Value(FLOAT, (self._real(name, a, b),))
        counts = a.counts and b.counts and name in ("Add", "Mult", "FloorDiv", "Mod", "RShift")
        counts = counts or (name == "BitAnd" and (a.counts or b.counts))
        counts = counts or (name == "Mod" and b.counts)
        operand, bits = self._whole(name, a, b)
        return Value(INT, (operand,), counts=counts, bits=bits)

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

    def _whole(self, name: str, a: Value, b: Value) -> tuple[str, int]:
        """Write an operation on whole numbers; returns the operand and how many bits it may have."""
        x, y, r = a.parts[0], b.parts[0], self.result
        if name in _CHECKED:
            least = a.bits + b.bits + (not (a.counts and b.counts))
            bits = least if name == "Mult" else max(a.bits, b.bits) + 1
            if bits <= 63:
                return r(f"{_CHECKED[name]} nsw i64 {x}, {y}"), bits
            called = f"llvm.s{_CHECKED[name]}.with.overflow.i64"
            pair = self.call(called, "{ i64, i1 }", f"i64 {x}", f"i64 {y}")
            beyond = r(f"extractvalue {{ i64, i1 }} {pair}, 1")
            self.fail_if(beyond, Failure.TOO_LARGE)
            return r(f"extractvalue {{ i64, i1 }} {pair}, 0"), 63
        if name in _BITS:
            bits = max(a.bits, b.bits)
            if name == "BitAnd" and (a.counts or b.counts):
                bits = min(each.bits for each in (a, b) if each.counts)
            return r(f"{_BITS[name]} i64 {x}, {y}"), bits
        if name in ("LShift", "RShift"):
            return self._shift(name, a, b)
        if name not in ("Mod", "FloorDiv"):
            raise NotCompilable(f"whole numbers have no {name}")
        if not b.constant:
            self.fail_if(r(f"icmp eq i64 {y}, 0"))
        if not b.counts and b.constant is None:  # no processor divides the least number by -1
            back = r(f"icmp eq i64 {y}, -1")
            if name == "Mod":
                y = r(f"select i1 {back}, i64 1, i64 {y}")
            elif a.bits == 63:
                least_of_all = r(f"icmp eq i64 {x}, {-(2**63)}")
                self.fail_if(r(f"and i1 {back}, {least_of_all}"), Failure.TOO_LARGE)
        elif b.constant == -1 and a.bits == 63:
            self.fail_if(r(f"icmp eq i64 {x}, {-(2**63)}"), Failure.TOO_LARGE)
        bits = b.bits if name == "Mod" else min(a.bits + (not b.counts), 63)
        rest = r(f"srem i64 {x}, {y}")
        if a.counts and b.counts:
            return (rest if name == "Mod" else r(f"sdiv i64 {x}, {y}")), bits
        signs, inexact = r(f"xor i64 {rest}, {y}"), r(f"icmp ne i64 {rest}, 0")
        other = r(f"icmp slt i64 {signs}, 0")
        below = r(f"and i1 {other}, {inexact}")
        if name == "Mod":
            moved = r(f"add i64 {rest}, {y}")
            return r(f"select i1 {below}, i64 {moved}, i64 {rest}"), bits
        quotient, one = r(f"sdiv i64 {x}, {y}"), r(f"zext i1 {below} to i64")
        return r(f"sub i64 {quotient}, {one}"), bits

    def _shift(self, name: str, a: Value, b: Value) -> tuple[str, int]:
        x, y, r = a.parts[0], b.parts[0], self.result
        if b.constant is None and not b.counts:
            self.fail_if(r(f"icmp slt i64 {y}, 0"), Failure.OUT_OF_DOMAIN)
        elif not b.counts:
            raise NotCompilable("a shift goes by no negative number")
        if name == "RShift":
            y = self.call("llvm.umin.i64", "i64", f"i64 {y}", "i64 63")
            return r(f"ashr i64 {x}, {y}"), a.bits
        if b.constant is not None and a.bits + b.constant <= 63:
            return r(f"shl i64 {x}, {y}"), int(a.bits + b.constant)
        self.fail_if(r(f"icmp ugt i64 {y}, 63"), Failure.TOO_LARGE)
        moved = r(f"shl i64 {x}, {y}")
        back = r(f"ashr i64 {moved}, {y}")
        self.fail_if(r(f"icmp ne i64 {back}, {x}"), Failure.TOO_LARGE)
        return moved, 63

    def _power(self, a: Value, b: Value) -> Value:
        if a.constant is not None and b.constant is not None:
            try:
                return number(a.constant**b.constant)
            except (ZeroDivisionError, OverflowError, TypeError) as error:
                raise NotCompilable(f"this power cannot be computed: {error}") from error
        if b.constant == 1:
            return self.convert(a, join(INT, a.type))
        if b.constant == 2:
            return self.operation("Mult", a, a)
        if a.kind != "float" and b.kind != "float":
            if b.constant is not None and 0 < b.constant <= _LARGEST_POWER:
                return self.operation("Mult", self._power(a, number(b.constant - 1)), a)
            if a.constant != 2 or not (b.counts or b.type == INT):
                raise NotCompilable("of powers of whole numbers there are x ** 3 and 2 ** n")
            if not b.counts:  # Python makes a fraction of it
                self.fail_if(self.result(f"icmp slt i64 {b.parts[0]}, 0"), Failure.OUT_OF_DOMAIN)
            if b.bits > _LARGEST_SHIFT:
                beyond = self.result(f"icmp sgt i64 {b.parts[0]}, 62")
                self.fail_if(beyond, Failure.TOO_LARGE)
            return Value(INT, (self.result(f"shl i64 1, {b.parts[0]}"),), counts=True)
        x, y = self.convert(a, FLOAT), self.convert(b, FLOAT)
        # not 'pow', which LLVM would replace by a root or a division that round otherwise
        operands = f"double {x.parts[0]}", f"double {y.parts[0]}"
        made = Value(FLOAT, (self.call("pow", "double", *operands, attributes=" #2"),))
        self.in_domain(made, [x, y])
        return made

    def in_domain(
        self, result: Value, arguments: Sequence[Value], pole: Failure = Failure.OUT_OF_RANGE
    ) -> None:
        """Report a result that is no number although the arguments are, and one that is infinite
        although they are finite, as Python's ``math`` does."""
        r, (made,) = self.result, result.parts
        numbers = [r(f"fcmp ord double {each.parts[0]}, 0.0") for each in arguments]
        none = r(f"fcmp uno double {made}, 0.0")
        for each in numbers:
            none = r(f"and i1 {none}, {each}")
        self.fail_if(none, Failure.OUT_OF_DOMAIN)
        infinity = number(math.inf).parts[0]
        sizes = [
            self.call("llvm.fabs.f64", "double", f"double {each}")
            for each in (made, *(a.parts[0] for a in arguments))
        ]
        beyond = r(f"fcmp oeq double {sizes[0]}, {infinity}")
        for each in sizes[1:]:
            finite = r(f"fcmp olt double {each}, {infinity}")
            beyond = r(f"and i1 {beyond}, {finite}")
        self.fail_if(beyond, pole)

    def negative(self, value: Value) -> Value:
        """``-value``."""
        if value.constant is not None:
            return number(-value.constant)
        value = self.convert(value, join(INT, value.type))
        if value.kind == "int":
            return self.operation("Sub", number(0), value)
        return Value(value.type, (self.result(f"fneg double {value.parts[0]}"),))

    def inverted(self, value: Value) -> Value:
        """``~value``."""
        if value.kind != "int":
            raise NotCompilable("~ takes a whole number; of a flag write 'not'")
        return Value(INT, (self.result(f"xor i64 {value.parts[0]}, -1"),), bits=value.bits)

    def compare(self, name: str, a: Value, b: Value) -> Value:
        """Write ``a < b`` and so on; ``name`` is that of the class in ``ast``."""
        if name not in _COMPARISONS:
            raise NotCompilable(f"numbers are compared by < <= > >= == !=, not by {name}")
        kind = join(INT, join(a.type, b.type))
        if kind == FLOAT:  # Python compares a whole number with a float exactly
            a, b = (self.exact(each) if each.kind == "int" else each for each in (a, b))
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
        made = (self.result(text),)
        return Value(a.type, made, counts=a.counts and b.counts, bits=max(a.bits, b.bits))

    def call(self, name: str, returns: str, *arguments: str, attributes: str = "") -> str:
        """Call a function of LLVM or of C's mathematical library, without side effects."""
        kinds = ", ".join(argument.split()[0] for argument in arguments)
        self.declared[name] = f"declare {returns} @{name}({kinds}) #1"
        return self.result(f"call {returns} @{name}({', '.join(arguments)}){attributes}")


_REAL = {"Add": "fadd", "Sub": "fsub", "Mult": "fmul"}
_CHECKED = {"Add": "add", "Sub": "sub", "Mult": "mul"}
_BITS = {"BitAnd": "and", "BitOr": "or", "BitXor": "xor"}
_FOLDED: dict[str, Callable[[Any, Any], Any]] = {
    "Add": lambda a, b: a + b, "Sub": lambda a, b: a - b, "Mult": lambda a, b: a * b,
}  # fmt: skip
_COMPARISONS = {
    "Lt": ("slt", "olt"), "LtE": ("sle", "ole"), "Gt": ("sgt", "ogt"), "GtE": ("sge", "oge"),
    "Eq": ("eq", "oeq"), "NotEq": ("ne", "une"),
}  # fmt: skip
