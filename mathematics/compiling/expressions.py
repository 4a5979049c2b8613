"""Kinds of the expressions in a kernel, as far as they follow from the types of its arguments."""

from __future__ import annotations

import ast
import copy
from collections.abc import Mapping
from typing import Any

from ..arrays import Array
from .kinds import NUMBER, ArrayKind, Kind, NumberKind, RecordKind, argument_kinds


class EquationError(Exception):
    """A statement of a kernel cannot be rewritten; the text gives place and reason."""


def cross(a: Array, b: Array) -> Array:
    """Declare the cross product of two vectors of three in an equation: ``out[:] = cross(a, b) +
    c``."""
    raise EquationError(
        "cross(a, b) belongs in an equation of a kernel, such as out[:] = cross(a, b)"
    )


class Expressions:
    """The kinds of the expressions of one function."""

    def __init__(self, function: Any, file: str) -> None:
        self._function = function
        self._file = file
        self._scope: Mapping[str, Any] = function.__globals__
        self._kinds: dict[str, Kind] = dict(argument_kinds(function))

    def _expression(self, node: ast.expr) -> ast.expr:
        """Rewrite an expression as a number."""
        raise NotImplementedError

    def _inside(self, node: ast.expr) -> ast.expr:
        """Rewrite only the indices of an array that is handed on."""
        raise NotImplementedError

    def _kind(self, node: ast.expr) -> Kind:
        """Find the kind of an expression, as far as it follows from the arguments."""
        if isinstance(node, ast.Name):
            return self._kinds.get(node.id)
        if isinstance(node, ast.Attribute):
            whole = self._kind(node.value)
            if isinstance(whole, RecordKind):
                if node.attr not in whole.parts and not node.attr.startswith("_"):
                    known = ", ".join(whole.parts)
                    raise self._error(
                        node, f"{whole.name} has no field {node.attr!r}; it has {known}"
                    )
                return whole.parts.get(node.attr)
            if isinstance(whole, ArrayKind) and node.attr == "T":
                return ArrayKind(whole.shape[::-1], whole.element)
            return None
        if isinstance(node, ast.Subscript):
            return self._kind_of_part(node)
        if isinstance(node, ast.BinOp):
            return self._kind_of_operation(node)
        if isinstance(node, ast.UnaryOp):
            return self._kind(node.operand)
        if isinstance(node, ast.IfExp):
            return self._widest([node.body, node.orelse, node.test])
        if isinstance(node, ast.Compare):
            return self._widest([node.left, *node.comparators])
        if isinstance(node, ast.BoolOp):
            return self._widest(node.values)
        if isinstance(node, ast.Call):
            if self._is_cross(node):
                return ArrayKind((3,))
            kinds = [kind for each in node.args if isinstance(kind := self._kind(each), ArrayKind)]
            if self._applies_to_elements(node) and kinds:
                return max(kinds, key=lambda kind: kind.rank)
            return NUMBER
        return NUMBER if isinstance(node, ast.Constant) else None

    def _widest(self, nodes: list[ast.expr]) -> Kind:
        """Return the kind of what is made of each element of some expressions: an array if one
        is."""
        arrays = [kind for each in nodes if isinstance(kind := self._kind(each), ArrayKind)]
        arrays = [kind for kind in arrays if kind.rank]
        if arrays:
            return max(arrays, key=lambda kind: kind.rank)
        kind = self._kind(nodes[0])
        return NUMBER if isinstance(kind, ArrayKind) else kind

    def _kind_of_part(self, node: ast.Subscript) -> Kind:
        whole = self._kind(node.value)
        if not isinstance(whole, ArrayKind):
            return None
        shape: list[int | None] = []
        indices = indices_of(node)
        for size, index in zip(whole.shape, indices, strict=False):
            if isinstance(index, ast.Slice):
                shape.append(_length_of_slice(index, size))
        shape += whole.shape[len(indices) :]
        return ArrayKind(tuple(shape), whole.element) if shape else NUMBER

    def _kind_of_operation(self, node: ast.BinOp) -> Kind:
        left, right = self._kind(node.left), self._kind(node.right)
        arrays = [kind for kind in (left, right) if isinstance(kind, ArrayKind) and kind.rank]
        if (
            isinstance(node.op, ast.MatMult)
            and isinstance(left, ArrayKind)
            and isinstance(right, ArrayKind)
        ):
            shape = left.shape[:-1] + (right.shape[1:] if right.rank > 1 else ())
            return ArrayKind(shape) if shape else NUMBER
        if arrays:
            return max(arrays, key=lambda kind: kind.rank)
        return NUMBER if left is not None and right is not None else None

    def _element_type(self, node: ast.expr) -> type | None:
        """Return the type of the number that a place holds; none where it is no number of an
        array."""
        if isinstance(node, ast.Attribute):
            kind = self._kind(node)
            return kind.element if isinstance(kind, ArrayKind) and kind.rank == 0 else None
        if isinstance(node, ast.Subscript):
            whole = self._kind(node.value)
            if isinstance(whole, ArrayKind) and isinstance(self._kind_of_part(node), NumberKind):
                return whole.element
        return None

    def _covers_elements(self, target: ast.expr) -> bool:
        """Return whether a statement writes several elements: ``x[:]`` where the dimensions are
        known."""
        if not isinstance(target, ast.Subscript):
            return False
        if not any(isinstance(index, ast.Slice) for index in indices_of(target)):
            return False
        return isinstance(self._kind(target.value), ArrayKind)

    def _is_cross(self, node: ast.Call) -> bool:
        return isinstance(node.func, ast.Name) and self._scope.get(node.func.id) is cross

    def _applies_to_elements(self, node: ast.Call) -> bool:
        """Return whether a call is of a function of numbers, which an equation applies to each
        element."""
        name = node.func
        if isinstance(name, ast.Attribute):
            return isinstance(name.value, ast.Name) and name.value.id == "math"
        if not isinstance(name, ast.Name):
            return False
        if name.id in ("float", "int", "bool", "abs", "min", "max", "round"):
            return True
        function = self._scope.get(name.id)
        notes = getattr(function, "__annotations__", {})
        return bool(notes) and all(note in _NUMBERS for note in notes.values())

    def _size_of(self, node: ast.expr, dimension: int) -> ast.expr | None:
        """Return the number of elements of an array in a dimension, as an expression."""
        kind = self._kind(node)
        if not isinstance(kind, ArrayKind) or kind.rank == 0:
            return None
        known = kind.shape[dimension]
        if known is not None:
            return ast.copy_location(ast.Constant(known), node)
        if isinstance(node, ast.Attribute) and node.attr == "T":
            return self._size_of(node.value, kind.rank - 1 - dimension)
        if isinstance(node, ast.Subscript):
            return self._size_of_part(node, dimension)
        if isinstance(node, ast.Name | ast.Attribute):
            shape = ast.Attribute(self._inside(copy.deepcopy(node)), "shape", ast.Load())
            part = ast.Subscript(shape, ast.Constant(dimension), ast.Load())
            return ast.copy_location(part, node)
        for each in ast.iter_child_nodes(node):
            if isinstance(each, ast.expr):
                size = self._size_of(each, dimension)
                if size is not None:
                    return size
        return None

    def _size_of_part(self, node: ast.Subscript, dimension: int) -> ast.expr | None:
        whole = self._kind(node.value)
        assert isinstance(whole, ArrayKind)
        indices = indices_of(node)
        kept = [
            k for k in range(whole.rank) if k >= len(indices) or isinstance(indices[k], ast.Slice)
        ]
        k = kept[dimension]
        full = self._size_of(node.value, k)
        if k >= len(indices):
            return full
        part = indices[k]
        assert isinstance(part, ast.Slice)
        upper = full if part.upper is None else self._expression(copy.deepcopy(part.upper))
        if upper is None or part.lower is None:
            return upper
        lower = self._expression(copy.deepcopy(part.lower))
        return ast.copy_location(ast.BinOp(upper, ast.Sub(), lower), node)

    def _error(self, node: ast.AST, text: str) -> EquationError:
        where = f"{self._file}:{getattr(node, 'lineno', 0)}"
        return EquationError(f"{where}: kernel {self._function.__qualname__}: {text}")


_NUMBERS = ("float", "int", "bool", float, int, bool)


def indices_of(node: ast.Subscript) -> list[ast.expr]:
    return list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]


def _length_of_slice(part: ast.Slice, size: int | None) -> int | None:
    lower, upper = part.lower, part.upper
    first = 0 if lower is None else lower.value if isinstance(lower, ast.Constant) else None
    last = size if upper is None else upper.value if isinstance(upper, ast.Constant) else None
    if isinstance(first, int) and isinstance(last, int):
        return last - first
    return None
