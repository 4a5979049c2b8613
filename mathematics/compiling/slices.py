"""Slices in equations: their first place, step and length, as ``slice.indices`` of Python finds them."""

from __future__ import annotations

import ast
from collections.abc import Callable
from enum import IntEnum

from .expressions import Expressions, cloned, indices_of
from .kinds import ArrayKind, GreatestLength, RuntimeSize


class Cut(ast.expr):
    """A slice in place of an ``ast.Slice``: place k of it is element ``first + step * k``.

    Attributes:
        most: its length, unless its array ends before; ``None`` where that is not known.
    """

    _fields = ("first", "length")

    def __init__(
        self, first: ast.expr, step: int, length: ast.expr, most: int | None = None
    ) -> None:
        super().__init__()
        self.first, self.step, self.length, self.most = first, step, length, most


class Slices(Expressions):
    """Finds the elements of parts of arrays."""

    _ahead: list[ast.stmt] | None
    """Statements to put in front of the present one; None where none can be put there."""

    def _name(self, stem: str) -> str:
        """Make a new name of a variable."""
        raise NotImplementedError

    def _put_ahead(self, statement: ast.stmt, place: ast.AST) -> None:
        """Put a statement in front of the present one."""
        if self._ahead is None:
            raise self._error(
                place, f"{ast.unparse(place)} cannot stand here; assign it to a name before"
            )
        for each in ast.walk(statement):
            if not hasattr(each, "lineno"):
                ast.copy_location(each, place)
        self._ahead.append(statement)

    def _kept(self, stem: str, value: ast.expr, place: ast.AST) -> ast.expr:
        """Compute a number in front of the present statement, and return its name."""
        name = self._name(stem)
        self._put_ahead(ast.Assign([ast.Name(name, ast.Store())], value), place)
        return ast.copy_location(ast.Name(name, ast.Load()), place)

    def _settle_indices(self, node: ast.Subscript) -> None:
        """Replace the slices in an index by cuts, whose bounds are computed once."""
        whole = self._kind(node.value)
        if not isinstance(whole, ArrayKind):
            return
        inner = node.value
        while isinstance(inner, ast.Subscript):
            if any(isinstance(each, ast.Slice) for each in indices_of(inner)):
                raise self._error(node, "take a part of the array itself, not of a part of it")
            inner = inner.value
        indices = [
            self._cut(each, whole.shape[k], node, k) if isinstance(each, ast.Slice) else each
            for k, each in enumerate(indices_of(node))
        ]
        node.slice = indices[0] if len(indices) == 1 else ast.Tuple(indices, ast.Load())

    def _cut(self, part: ast.Slice, size: int | None, node: ast.Subscript, dimension: int) -> Cut:
        """Find the places of a slice in a dimension of ``size`` elements, or of as many as there are."""
        size = None if isinstance(size, GreatestLength) else size
        key = f"{ast.dump(part)} {ast.dump(node.value)} {dimension}"
        if key not in self._cuts:
            self._cuts[key] = self._new_cut(part, size, node, dimension)
        return cloned(self._cuts[key])

    _cuts: dict[str, Cut]
    """The slices of the present statement, so that equal ones have bounds of one name."""

    def _new_cut(
        self, part: ast.Slice, size: int | None, node: ast.Subscript, dimension: int
    ) -> Cut:
        step = 1 if part.step is None else self._constant_of(part.step)
        if step is None:
            raise self._error(node, f"the step of {ast.unparse(node)} is not a constant")
        if step == 0:
            raise self._error(node, f"the step of {ast.unparse(node)} is zero")
        lower = None if part.lower is None else self._constant_of(part.lower)
        upper = None if part.upper is None else self._constant_of(part.upper)
        known = (part.lower is None or lower is not None) and (
            part.upper is None or upper is not None
        )
        if known and size is not None:
            places = range(*slice(lower, upper, step).indices(size))
            bounds = Cut(ast.Constant(places.start), step, ast.Constant(len(places)))
        else:
            bounds = (
                self._simple_cut(part, lower, upper, node, dimension) if step == 1 else None
            ) or self._general_cut(part, step, node, dimension)
            if not (isinstance(bounds.first, ast.Constant) and bounds.first.value == 0):
                bounds.length = called(
                    "max", bounds.length, ast.Constant(0)
                )  # one may begin beyond
            most = self._length_of(part, size)
            bounds.most = None if most is None else int(most)
        for each in ast.walk(bounds):
            if not hasattr(each, "lineno"):
                ast.copy_location(each, node)
        return bounds

    def _simple_cut(
        self, part: ast.Slice, lower: int | None, upper: int | None, node: ast.Subscript, dimension: int
    ) -> Cut | None:  # fmt: skip
        """Find the places of a slice whose bounds cannot be negative; ``None`` for other slices."""
        if part.lower is not None and not self._is_count(part.lower):
            return None
        first = ast.Constant(0) if part.lower is None else self._bound(part.lower, lower)
        length: ast.expr
        whole = self._size_of(node.value, dimension)
        if whole is None:
            raise self._error(node, "say where this slice ends")
        if part.upper is None or (upper is not None and upper < 0):
            back = first if upper is None else plus(cloned(first), ast.Constant(-upper))
            length = minus(whole, cloned(back))
        elif self._is_count(part.upper):
            last = called("min", self._bound(part.upper, upper), whole)
            length = minus(last, cloned(first))
        else:
            return None
        return Cut(first, 1, length)

    def _bound(self, node: ast.expr, constant: int | None) -> ast.expr:
        return self._expression(cloned(node)) if constant is None else ast.Constant(constant)

    def _general_cut(self, part: ast.Slice, step: int, node: ast.Subscript, dimension: int) -> Cut:
        """Find the places of any slice, by the statements of ``slice.indices``."""
        whole = self._size_of(node.value, dimension)
        if whole is None:
            raise self._error(node, "say where this slice ends")
        least, most = (
            ast.Constant(0 if step > 0 else -1),
            whole if step > 0 else minus(whole, ast.Constant(1)),
        )
        ends = []
        for bound, otherwise in (
            (part.lower, least if step > 0 else most),
            (part.upper, most if step > 0 else least),
        ):
            if bound is None:
                ends.append(otherwise)
                continue
            place = self._kept("bound", self._bound(bound, self._constant_of(bound)), node)
            moved = ast.IfExp(
                ast.Compare(place, [ast.Lt()], [ast.Constant(0)]), plus(place, cloned(whole)), place
            )  # fmt: skip
            limited = called("max", cloned(least), called("min", moved, cloned(most)))
            ends.append(self._kept("bound", limited, node))
        first, last = (cloned(each) for each in ends)
        span = minus(last, first) if step > 0 else minus(first, last)
        if abs(step) > 1:
            up = plus(span, ast.Constant(abs(step) - 1))
            span = ast.BinOp(up, ast.FloorDiv(), ast.Constant(abs(step)))
        return Cut(cloned(first), step, span)

    def _length_of(self, part: ast.expr, size: int | None) -> int | None:
        """Return the length of a slice where it is known."""
        if isinstance(part, Cut):
            if isinstance(part.length, ast.Constant):
                return part.length.value  # type: ignore[return-value]  # a number
            return None if part.most is None else GreatestLength(part.most)
        assert isinstance(part, ast.Slice)
        size = None if isinstance(size, GreatestLength) else size
        bounds = [None if b is None else self._constant_of(b) for b in (part.lower, part.upper)]
        step = 1 if part.step is None else self._constant_of(part.step)
        known = all(b is None or c is not None for b, c in zip((part.lower, part.upper), bounds, strict=True))  # fmt: skip
        if known and size is not None and step:
            length = len(range(*slice(bounds[0], bounds[1], step).indices(size)))
            return RuntimeSize(length) if isinstance(size, RuntimeSize) else length
        if step != 1 or part.upper is None:
            return None
        more, constants = (
            self._more_than(part.lower, part.upper),
            [b for b in bounds if b is not None],
        )
        if more is None or (
            constants and min(constants) < 0 <= max(*constants, 0 if part.lower is None else -1)
        ):
            return None  # one counts from the end, the other from the beginning
        return GreatestLength(more) if more > 0 else 0

    def _more_than(self, lower: ast.expr | None, upper: ast.expr) -> int | None:
        """Find the distance between two bounds, where that is known: 2 of ``k + 1`` and ``k + 3``."""
        first, begin = ("", 0) if lower is None else self._offset(lower)
        last, end = self._offset(upper)
        return end - begin if first == last else None

    def _offset(self, node: ast.expr) -> tuple[str, int]:
        """Split an expression into what is not known and a number: ``k`` and 3 of ``k + 3``."""
        constant = self._constant_of(node)
        if constant is not None:
            return "", constant
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            number = self._constant_of(node.right)
            if number is not None:
                base, more = self._offset(node.left)
                return base, more + number if isinstance(node.op, ast.Add) else more - number
            number = self._constant_of(node.left)
            if number is not None and isinstance(node.op, ast.Add):
                base, more = self._offset(node.right)
                return base, more + number
        return ast.dump(node), 0

    def _constant_of(self, node: ast.expr) -> int | None:
        """Return the whole number that an expression always is; ``None`` where that is not known."""
        match node:
            case ast.Constant(value=int() as value) if not isinstance(value, bool):
                return value
            case ast.UnaryOp(op=ast.USub()):
                operand = self._constant_of(node.operand)
                return None if operand is None else -operand
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult()):
                a, b = self._constant_of(node.left), self._constant_of(node.right)
                if a is None or b is None:
                    return None
                return (
                    a + b
                    if isinstance(node.op, ast.Add)
                    else a - b
                    if isinstance(node.op, ast.Sub)
                    else a * b
                )
            case ast.Call(func=ast.Name(id="len"), args=[array]):
                return self._known_size(array, 0)
            case ast.Subscript(
                value=ast.Attribute(attr="shape"), slice=ast.Constant(value=int() as k)
            ):
                return self._known_size(node.value.value, k)  # type: ignore[attr-defined]  # an attribute
            case ast.Name() if node.id not in self._locals:
                found = self._scope.get(node.id)
                return (
                    int(found) if isinstance(found, int) and not isinstance(found, bool) else None
                )
            case ast.Attribute(value=ast.Name(id=owner)) if owner not in self._locals:
                kind = self._scope.get(owner)
                if (
                    isinstance(kind, type)
                    and issubclass(kind, IntEnum)
                    and node.attr in kind.__members__
                ):
                    return int(kind[node.attr])
        return None

    def _known_size(self, array: ast.expr, dimension: int) -> int | None:
        kind = self._kind(array)
        if isinstance(kind, ArrayKind) and dimension < kind.rank:
            size = kind.shape[dimension]
            return None if isinstance(size, GreatestLength) else size
        return None

    def _is_count(self, node: ast.expr) -> bool:
        """Return whether a whole number can be seen not to be negative."""
        constant = self._constant_of(node)
        return constant >= 0 if constant is not None else is_count(node, self._counters)


def is_count(node: ast.expr, counters: set[str]) -> bool:
    """Return whether an expression is made of names that are not negative so that it is not either."""
    match node:
        case ast.Constant(value=int() as value):
            return value >= 0
        case ast.Name():
            return node.id in counters
        case ast.BinOp(op=ast.Add() | ast.Mult() | ast.FloorDiv()):
            return is_count(node.left, counters) and is_count(node.right, counters)
        case ast.BinOp(op=ast.Mod()):
            return is_count(node.right, counters)
        case ast.Subscript(value=ast.Attribute(attr="shape")) | ast.Attribute(attr="size"):
            return True
        case ast.Call(func=ast.Name(id="len")):
            return True
    return False


def counters_of(definition: ast.FunctionDef) -> set[str]:
    """Return the variables of a function that are whole numbers and never negative."""
    bound: dict[str, list[Callable[[set[str]], bool]]] = {}

    def bind(target: ast.AST, test: Callable[[set[str]], bool]) -> None:
        for each in ast.walk(target):
            if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store):
                bound.setdefault(each.id, []).append(test)

    plain: set[int] = set()
    for node in ast.walk(definition):
        if isinstance(node, ast.For) and _is_enumerate(node):
            assert isinstance(node.target, ast.Tuple)
            plain.add(id(node.target.elts[0]))
            bind(node.target.elts[0], lambda _: True)
        elif isinstance(node, ast.For) and isinstance(node.target, ast.Name):
            plain.add(id(node.target))
            bind(node.target, lambda names, loop=node.iter: _counts_up(loop, names))  # type: ignore[misc]
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            plain.add(id(node.targets[0]))
            bind(node.targets[0], lambda names, value=node.value: is_count(value, names))  # type: ignore[misc]
    for node in ast.walk(definition):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and id(node) not in plain:
            bind(node, lambda _: False)
    names = set(bound) - {each.arg for each in definition.args.args}
    while True:
        kept = {name for name in names if all(test(names) for test in bound[name])}
        if kept == names:
            return names
        names = kept


def _is_enumerate(node: ast.For) -> bool:
    return isinstance(node.target, ast.Tuple) and ast.unparse(node.iter).startswith("enumerate(")


def _counts_up(loop: ast.expr, names: set[str]) -> bool:
    """Return whether a loop goes over whole numbers that are not negative."""
    if not (
        isinstance(loop, ast.Call) and isinstance(loop.func, ast.Name) and loop.func.id == "range"
    ):
        return False
    match loop.args:
        case [_]:
            return True
        case [start, _]:
            return is_count(start, names)
        case [start, _, ast.Constant(value=int() as step)] if step > 0:
            return is_count(start, names)
        case [_, stop, ast.UnaryOp(op=ast.USub())]:
            text = ast.unparse(stop)
            return text == "-1" or is_count(stop, names)
    return False


def plus(a: ast.expr, b: ast.expr) -> ast.expr:
    """Write ``a + b``."""
    return _sum(a, ast.Add(), b, 1)


def minus(a: ast.expr, b: ast.expr) -> ast.expr:
    """Write ``a - b``."""
    return _sum(a, ast.Sub(), b, -1)


def _sum(a: ast.expr, op: ast.operator, b: ast.expr, sign: int) -> ast.expr:
    if isinstance(b, ast.Constant) and isinstance(b.value, int):
        if b.value == 0:
            return a
        if isinstance(a, ast.Constant) and isinstance(a.value, int):
            return ast.Constant(a.value + sign * b.value)
    if sign > 0 and isinstance(a, ast.Constant) and a.value == 0:
        return b
    return ast.BinOp(a, op, b)


def called(name: str, *arguments: ast.expr) -> ast.Call:
    """Write ``name(arguments...)``."""
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])
