"""Kernels drawn at random from the whole language, for ``judge_kernels``."""

from __future__ import annotations

import random

HEAD = """
import math
from typing import NamedTuple
import numpy as np
from aloft.mathematics.arrays import Array1D, Array2D, Flags1D, Indices1D, Matrix3, Vector3
from aloft.mathematics.compiling.expressions import cross
from aloft.mathematics.kernel import kernel

TABLE = np.array([0.5, -1.25, 2.0])
LIMITS = (0.5, 1.5, 2.5)
LAST = 2


class Inner(NamedTuple):
    v: Vector3
    c: Indices1D


class Body(NamedTuple):
    R: Matrix3
    x: Array1D
    inner: Inner


@kernel
def half(x: float, gain: float = 0.5) -> float:
    return gain * x


@kernel
def scaled(a: Array1D, out: Array1D, gain: float = 2.0) -> None:
    out[:] = gain * a[::-1]


@kernel
def both(x: float, y: float) -> tuple[float, float]:
    return x + y, x - y

"""
ARGUMENTS = (
    "v: Vector3, w: Vector3, x: Array1D, A: Matrix3, B: Array2D, n: Indices1D, on: Flags1D, body: Body, s: float, "
    "k: int, p: Vector3, q: Array1D, M: Matrix3, r: Array1D, m: Indices1D"
)
CONSTANTS = ("0.5", "2.0", "-1.5", "0.25", "3.0", "1")


class Drawn:
    """One kernel, drawn at random."""

    def __init__(self, name: str, chance: random.Random) -> None:
        self.name, self.chance = name, chance
        self.lines: list[str] = []
        self.floats: list[str] = ["s"]
        self.ints: list[str] = ["k"]
        self.own: dict[str, int] = {}
        self.indent = 1
        self.count = 0

    def pick(self, *choices: str) -> str:
        return self.chance.choice(choices)

    def below(self, share: float) -> bool:
        return self.chance.random() < share

    # Numbers

    def number(self, depth: int = 2) -> str:
        """Draw an exact number: multiples of powers of two, without a division."""
        if depth == 0 or self.below(0.3):
            return self.pick(
                *CONSTANTS, *self.floats, "v[0]", "w[-1]", "x[k]", "x[-2]", "A[1, 2]", "A[-1, 0]", "B[k, 3]", "q[1]",
                "p[2]", "body.x[0]", "body.inner.v[k]", "body.R[k, k]", "LIMITS[1]", "TABLE[2]", "float(n[1])", "A[0][1]",
            )  # fmt: skip
        a, b = self.number(depth - 1), self.number(depth - 1)
        form = self.chance.randrange(12)
        if form < 6:
            return f"({a} {self.pick('+', '-', '*')} {b})"
        return (
            f"(-{a})", f"abs({a})", f"{self.pick('min', 'max')}({a}, {b})", f"({a} if {self.flag()} else {b})",
            f"half({a}{self.pick('', ', 0.25', ', gain=2.0')})", f"({a} {self.pick('//', '%')} 0.75)",
        )[form - 6]  # fmt: skip

    def whole(self, depth: int = 2) -> str:
        if depth == 0 or self.below(0.3):
            return self.pick(
                *self.ints,
                "n[0]",
                "n[-1]",
                "n[k]",
                "2",
                "-3",
                "7",
                "body.inner.c[1]",
                "len(x)",
                "A.shape[0]",
                "LAST",
            )
        a, b = self.whole(depth - 1), self.whole(depth - 1)
        form = self.chance.randrange(9)
        if form < 5:
            return f"({a} {self.pick('+', '-', '*')} {b})"
        return (
            f"({a} {self.pick('//', '%')} {self.pick('3', '-4', '(abs(' + b + ') + 1)')})", f"(-{a})",
            f"({a} {self.pick('&', '|', '^')} {b})", f"int({self.number(1)})",
        )[form - 5]  # fmt: skip

    def flag(self, depth: int = 1) -> str:
        form = self.chance.randrange(6)
        if form < 2 or depth == 0:
            return (
                f"({self.number(1)} {self.pick('<', '<=', '>', '>=', '==', '!=')} {self.number(1)})"
            )
        if form == 2:
            return (
                f"({self.whole(1)} {self.pick('<', '>', '==')} {self.whole(1)} <= {self.whole(1)})"
            )
        if form == 3:
            return f"(not {self.flag(0)})"
        if form == 4:
            return f"bool(on[{self.pick('0', 'k', '-1')}])"
        return f"({self.flag(0)} {self.pick('and', 'or')} {self.flag(0)})"

    # Arrays

    def part(self, length: int) -> str:
        """Draw a part of an array, of some length."""
        found = [name for name, size in self.own.items() if size == length]
        whole = {
            "x": 6,
            "q": 6,
            "v": 3,
            "w": 3,
            "p": 3,
            "body.x": 5,
            "body.inner.v": 3,
            "TABLE": 3,
        } | self.own
        found += [name for name, size in whole.items() if size == length]
        for _ in range(8):
            name = self.chance.choice(list(whole))
            size = whole[name]
            text, count = self.cut(size)
            if count == length:
                found.append(f"{name}[{text}]")
        if length == 3:
            found += [
                "A[k]",
                "A[:, 1]",
                "A[::-1, k]",
                "B[:, 2]",
                "B[::-1, -1]",
                "A.T[0]",
                "M[1]",
                "body.R[:, 0]",
                "B[1, 1:]",
                "A[2, ::-1]",
            ]
        if length == 1:
            found += ["v[k : k + 1]", "A[1, 1:2]", "x[k : k + 1]"]
        if length == 2:
            found += [
                "A[0, 1:]",
                "A[:2, k]",
                "B[k, ::2]",
                "B[1, 1:3]",
                "x[k : k + 2]",
                "A.T[1, ::2]",
            ]
        if length == 4:
            found += ["B[k]", "B[-1, :]", "B[0][::-1]", "x[k : k + 4]", "x[2:]"]
        if length == 6:
            found += ["x[::-1]", "q[::-1]"]
        return self.chance.choice(found) if found else f"x[0:{length}]"

    def cut(self, size: int) -> tuple[str, int]:
        bounds = [self.pick("", *map(str, range(-size - 1, size + 2))) for _ in range(2)]
        step = self.pick("", "", ":1", ":2", ":-1", ":-2", ":3", ":-3")
        text = f"{bounds[0]}:{bounds[1]}{step}"
        first, last = (int(b) if b else None for b in bounds)
        places = range(size)[slice(first, last, int(step[1:]) if step else None)]
        return text, len(places)

    def vector(self, length: int, depth: int = 2) -> str:
        if depth == 0 or self.below(0.25):
            return self.part(length)
        a, b = self.vector(length, depth - 1), self.vector(length, depth - 1)
        form = self.chance.randrange(20)
        if form < 6:
            return f"({a} {self.pick('+', '-', '*')} {b})"
        if form < 9:
            return f"({self.number(1)} {self.pick('*', '+', '-')} {a})"
        if length == 3 and form < 13:
            return (
                f"(A @ {b})", f"({a} @ {self.pick('A', 'M.T', 'body.R')})", f"cross({a}, {b})",
                self.pick(f"(B @ {self.vector(4, 0)})", "np.sum(A, axis=1)", "(A * 2.0 - M).max(axis=0)", "np.mean(M, axis=-1)"),
            )[form - 9]  # fmt: skip
        return self.pick(
            f"(-{a})", f"abs({a})", f"np.minimum({a}, {b})", f"np.maximum({a}, 0.5)", f"np.clip({a}, -1.0, {self.pick('1.0', 's * s')})",
            f"np.where({a} > {b}, {a}, 0.0)", f"({a} / 4.0)", f"np.sqrt(np.abs({a}))", f"np.sin({a})", f"({a} / (1.0 + abs({b})))",
            f"half({a})", f"({a} ** 2)", f"({a} % 0.75)", f"np.floor({a})", f"np.arctan2({a}, {b})", f"({a} * np.sum({b}))",
            f"({a} if {self.flag()} else {b})", f"np.tanh({a})", f"({a} - np.dot({b}, {b}))", f"np.sign({a})",
            f"np.clip({a}, -math.pi, np.pi / 2)", f"np.mod({a}, 0.75)", f"np.round({a})", f"np.deg2rad({a})",
        )  # fmt: skip

    def matrix(self, depth: int = 2) -> str:
        base = self.pick(
            "A",
            "M",
            "A.T",
            "body.R",
            "A[::-1]",
            "A[:, ::-1]",
            "B[:, 1:]",
            "B[:, :3]",
            "np.eye(3)",
            "np.outer(v, w)",
        )
        if depth == 0 or self.below(0.3):
            return base
        a, b = self.matrix(depth - 1), self.matrix(0)
        return self.pick(
            f"({a} + {b})",
            f"({a} * {self.number(1)})",
            f"({a} @ {b})",
            f"({a} - {self.vector(3, 1)})",
            f"(-{a}.T)",
        )

    def reduction(self) -> str:
        a = self.vector(self.chance.choice((2, 3, 6)), 1)
        return self.pick(
            f"np.sum({a})", f"({a}).max()", f"np.min({a})", f"np.argmax({a})", f"np.linalg.norm({a})", f"sum({self.part(3)})",
            f"np.mean({a})", "np.sum(A)", "np.any(on)", "np.all(v < 3.0)", f"({self.part(3)} @ {self.vector(3, 1)})",
            "np.max(n)", "np.sum(n)", f"np.prod({self.part(2)})", f"np.argmin({a})", "(v @ A) @ w",
            f"np.sum({self.pick('x', 'q', 'body.x', 'v')}[{self.cut_open()}])", f"({a} - np.dot({a}, {a})).min()",
            f"sum({self.pick('x', 'q')}[{self.cut_open()}])", f"np.abs({a}).max()", f"np.sum(B {self.pick('+', '*')} {self.part(4)})",
            f"np.sum({self.part(3)} * {self.part(1)})", f"np.mean(B[{self.cut_open()}, 1] - {self.number(1)})",
        )  # fmt: skip

    def cut_open(self) -> str:
        """Draw the bounds of a slice, of which one or both are known in the run only, and may be beyond."""
        last = self.pick(
            "", "k", "k + 2", "k + 3", "k + 7", "9", "3", "-1", "-k", "k - 2", "len(x)", "n[0]"
        )
        return f"{self.pick('', '0', '1', '4', '7', 'k', '-k', '-2', 'k + 2', 'n[1]')}:{last}"

    # Statements

    def write(self, text: str) -> None:
        self.lines.append("    " * self.indent + text)

    def new(self, stem: str) -> str:
        self.count += 1
        return f"{stem}{self.count}"

    def statement(self, depth: int = 2) -> None:
        form = self.chance.randrange(24)
        if form == 22:
            cut, gain = self.cut_open(), self.pick("*", "+", "-")
            source = self.pick(
                self.number(1), f"q[{cut}] {gain} 2.0", f"x[{cut}]", f"x[{cut}] {gain} q[{cut}]"
            )
            self.write(f"q[{cut}] {self.pick('=', '+=', '*=')} {source}")
        elif form == 23:
            self.write(
                f"r[{self.chance.randrange(8)}] = ({self.part(self.chance.choice((2, 3, 4)))}).copy().sum()"
            )
        elif form < 4:
            name, size = self.chance.choice([("p", 3), ("q", 6), *self.own.items()])
            text, length = self.cut(size) if self.below(0.6) else (":", size)
            value = self.number() if self.below(0.2) else self.vector(length)
            self.write(f"{name}[{text}] {self.pick('=', '=', '=', '+=', '-=', '*=')} {value}")
        elif form < 6:
            target, length = self.chance.choice(
                [
                    ("M[:]", 0),
                    ("M[1, :]", 3),
                    ("M[:, k]", 3),
                    ("M[::-1, 0]", 3),
                    ("M[0, 1:]", 2),
                    ("M[2]", 3),
                ]
            )
            self.write(
                f"{target} {self.pick('=', '+=')} {self.vector(length) if length else self.matrix()}"
            )
        elif form < 8:
            self.write(f"r[{self.chance.randrange(8)}] = {self.reduction()}")
        elif form == 8:
            name = self.new("t")
            self.write(f"{name} = {self.number()}")
            if self.indent == 1:
                self.floats.append(name)
        elif form == 9:
            name = self.new("j")
            self.write(f"{name} = {self.whole()}")
            self.write(f"m[{self.chance.randrange(4)}] = {name}")
        elif form == 10:
            target = self.pick("m[:]", "m[::2]", "m[1:3]", "m[-1::-1]")
            length = 4 if target in ("m[:]", "m[-1::-1]") else 2
            source = self.pick(
                *(("n", "n[::-1]", "m") if length == 4 else ("n[1:3]", "n[::2]", "n[:2]"))
            )
            self.write(
                f"{target} {self.pick('=', '+=')} {source} {self.pick('+', '*', '//', '%', '-')} {self.pick('3', '-2', '5')}"
            )
        elif form == 11 and self.indent == 1:
            name, length = self.new("c"), self.chance.choice((1, 2, 3, 4))
            self.write(
                f"{name} = " + self.pick(
                    f"np.zeros({length})", f"np.array([{', '.join(self.number(1) for _ in range(length))}])",
                    f"np.ones({length}) * 0.5", f"np.full({length}, {self.number(0)})",
                    f"{self.part(3)}.copy()" if length == 3 else f"np.zeros({length})",
                    "A[k] * 2.0 + v" if length == 3 else f"np.empty({length}) * 0.0",
                )
            )  # fmt: skip
            if "empty" in self.lines[-1]:
                self.lines[-1] = f"    {name} = np.zeros({length})"
            self.own[name] = length
        elif form == 12:
            self.write(
                f"p[{self.pick('v > 0.0', 'on', 'w <= v', 'p == w')}] {self.pick('=', '+=', '*=')} {self.number(1)}"
            )
        elif form == 13:
            self.write("p[on] = " + self.pick("v[on]", "v[on] * 2.0 - w[on]", "w[on]"))
        elif form == 14:
            self.write(self.pick(
                f"p[0], p[2] = {self.number(1)}, {self.number(1)}", f"M[1] = [{self.number(1)}, p[2], {self.number(1)}]",
                f"p[2], p[0], r[5] = {self.vector(3, 1)}", f"p[:] += [{self.number(1)}, p[0], {self.number(0)}]",
            ))  # fmt: skip
        elif form == 15:
            self.write(f"r[0], r[1] = both({self.number(1)}, {self.number(1)})")
        elif form == 16:
            self.write(
                self.pick(
                    "scaled(v, p)",
                    "scaled(x[1:4], q[::2])",
                    "scaled(w, M[1], gain=0.5)",
                    "scaled(x[::-2], p, 4.0)",
                    "scaled(a=v, out=M[:, 0])",
                )
            )
        elif depth == 0:
            self.write(f"r[{self.chance.randrange(8)}] = {self.number()}")
        else:
            self.block(depth)

    def carried(self) -> None:
        """Write a loop of which each round makes an array anew of that of the round before."""
        name, other, i = self.new("c"), self.new("c"), self.new("i")
        matrix = self.below(0.2)
        begin = self.pick("A", "np.eye(3)", "M.copy()") if matrix else self.pick("v", "np.zeros(3)", "w + 0.5", "v.copy()")  # fmt: skip
        self.write(f"{name} = {begin}")
        self.write(f"{other} = {begin}")
        if self.below(0.3):
            self.write(f"{i} = 0")
            self.write(f"while {i} < 3:")
            self.write(f"    {i} += 1")
        else:
            self.write(f"for {i} in range({self.pick('3', '2', 'k')}):")
        self.indent += 1
        if matrix:
            self.write(f"{name} = 0.5 * ({name} @ {self.pick('A', 'M.T', 'body.R')}) + {other}")
        elif self.below(0.3):
            self.write(f"{name}, {other} = {other} + {self.vector(3, 0)}, {name} - {self.vector(3, 0)}")  # fmt: skip
        else:
            if guarded := self.below(0.3):
                self.write(f"if on[{i} - 1]:")
                self.indent += 1
            before, self.own = self.own, {name: 3, other: 3}
            self.write(f"{name} = {self.vector(3, 1)} {self.pick('+', '-')} {name}{self.pick('', '[::-1]')}")  # fmt: skip
            self.indent -= guarded
            if self.below(0.5):
                self.write(f"{other} = {self.pick(f'np.array([{name}[2], {other}[0], {name}[1]])', f'np.maximum({other}, {name})', f'A @ {other}')}")  # fmt: skip
            self.own = before
        self.indent -= 1
        self.write(f"M[:] = {name} - {other}" if matrix else f"p[:] = {name} - 0.5 * {other}")

    def block(self, depth: int) -> None:
        form = self.chance.randrange(10)
        if form > 7:
            self.carried()
            return
        if form < 3:
            self.write(f"if {self.flag()}:")
            self.inside(depth)
            if self.below(0.5):
                self.write("else:")
                self.inside(depth)
            return
        i = self.new("i")
        if form == 3:
            e = self.new("e")
            self.write(
                f"for {i}, {e} in enumerate({self.pick('v', 'x[:3]', 'x[::-2]', 'A[1]', 'v + w')}):"
            )
            self.indent += 1
            self.write(f"p[{i}] {self.pick('=', '+=')} {e} * {self.number(1)}")
        elif form == 4:
            a, b = self.new("e"), self.new("e")
            self.write(
                f"for {a}, {b} in zip({self.pick('v', 'x', 'TABLE')}, {self.pick('w', 'q[1:]', 'A[0]')}):"
            )
            self.indent += 1
            self.write(f"r[2] += {a} * {b}" if self.below(0.6) else f"r[3] = max({a}, {b} - r[3])")
        elif form == 5:
            self.write(f"{i} = 0")
            self.write(f"while {i} < {self.pick('3', 'k + 1', 'len(v)')}:")
            self.indent += 1
            self.write(f"r[4] {self.pick('+=', '=')} {self.number(1)} * {i}")
            if self.below(0.3):
                self.write(f"if r[4] > {self.number(0)}:")
                self.write("    break")
            self.write(f"{i} += 1")
        elif form == 6:
            j = self.new("i")
            self.write(f"for {i} in range({self.pick('3', '2', 'A.shape[0]')}):")
            self.write(f"    for {j} in range({self.pick('3', i + ', 3', '2, -1, -1')}):")
            self.write(
                f"        M[{i}, {j}] {self.pick('=', '+=')} A[{j}, {i}] * {self.pick('v', 'w')}[-{j} - 1] + {i} - {j}"
            )
            return
        else:
            self.write(
                f"for {i} in {self.pick('range(3)', 'range(2, -1, -1)', 'range(0, 3, 2)', 'range(1, 3)')}:"
            )
            self.indent += 1
            if self.below(0.3):
                self.write(f"if on[{i}]:")
                self.write("    continue")
            self.write(
                f"q[{self.pick(i, i + ' + 1', '-' + i + ' - 1')}] = x[{i}] {self.pick('*', '+', '-')} {self.number(1)}"
            )
            if self.below(0.3):
                self.write(f"q[{i} : {i} + 2] = x[{i} : {i} + 2] * 0.5")
        self.indent -= 1

    def inside(self, depth: int) -> None:
        self.indent += 1
        for _ in range(self.chance.randrange(1, 3)):
            self.statement(depth - 1)
        self.indent -= 1

    def source(self) -> str:
        for _ in range(self.chance.randrange(1, 6)):
            self.statement()
        return f"@kernel\ndef {self.name}({ARGUMENTS}) -> None:\n" + "\n".join(self.lines) + "\n\n"
