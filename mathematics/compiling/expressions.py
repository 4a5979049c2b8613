"""Kinds of the expressions in a kernel, as far as they follow from the types of its arguments."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any, TypeVar

import numpy as np

from ..arrays import Array
from .kernel_registry import written_code
from .kinds import (
    NUMBER,
    ArrayKind,
    GreatestLength,
    Kind,
    NumberKind,
    RecordKind,
    RuntimeSize,
    argument_kinds,
)

VERSION = 10
"""Counts changes of what a statement is rewritten into: machine code made before is not used."""

Node = TypeVar("Node", bound=ast.AST)


def cloned(node: Node) -> Node:
    """Copy a piece of source with all its parts, a fifth of the time that ``deepcopy`` takes."""
    kind = type(node)
    made: Node = kind.__new__(kind)
    for name, value in vars(node).items():
        if isinstance(value, list):
            value = [cloned(each) if isinstance(each, ast.AST) else each for each in value]
        elif isinstance(value, ast.AST) and not isinstance(value, _WITHOUT_PARTS):
            value = cloned(value)
        made.__dict__[name] = value
    return made


_WITHOUT_PARTS = (ast.expr_context, ast.operator, ast.unaryop, ast.boolop, ast.cmpop)


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
        code = written_code(function)
        self._locals = {*code.co_varnames, *code.co_cellvars, *code.co_freevars}
        """Names that are the function's own, and not its module's."""
        self._counters: set[str] = set()
        """Whole numbers that are never negative: the variables of most loops, and constants."""

    def _expression(self, node: ast.expr) -> ast.expr:
        """Rewrite an expression as a number."""
        raise NotImplementedError

    def _inside(self, node: ast.expr) -> ast.expr:
        """Rewrite only the indices of an array that is handed on."""
        raise NotImplementedError

    def _kind(self, node: ast.expr) -> Kind:
        """Find the kind of an expression, as far as it follows from the arguments."""
        if isinstance(node, ast.Name):
            return self._kinds[node.id] if node.id in self._kinds else self._kind_outside(node.id)
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
            return NUMBER if isinstance(self._resolved(node), float) else None  # such as np.pi
        if isinstance(node, ast.Subscript):
            return self._kind_of_part(node)
        if isinstance(node, ast.BinOp):
            return self._kind_of_operation(node)
        if isinstance(node, ast.UnaryOp):
            kind = self._kind(node.operand)
            if isinstance(node.op, ast.Not) and isinstance(kind, ArrayKind):
                return ArrayKind(kind.shape, bool)
            return kind
        if isinstance(node, ast.IfExp):
            kind = self._joined_of(node, [node.body, node.orelse, node.test])
            if kind != NUMBER:
                return kind
            # a choice between signals or rows is handed on like one
            return self._without_number(node.body)
        if isinstance(node, ast.Compare):
            return self._joined_of(node, [node.left, *node.comparators], bool)
        if isinstance(node, ast.BoolOp):
            return self._joined_of(node, node.values, bool)
        if isinstance(node, ast.Call):
            if self._is_cross(node):
                return ArrayKind((3,))
            if isinstance(node.func, ast.Name) and node.func.id == "<outer>":
                a, b = (self._kind(each) for each in node.args)
                assert isinstance(a, ArrayKind) and isinstance(b, ArrayKind)
                return ArrayKind((a.shape[0], b.shape[0]))
            if self._applies_to_elements(node):
                return self._joined_of(node, node.args, self._element_of(node))
            return NUMBER
        return NUMBER if isinstance(node, ast.Constant) else None

    def _kind_outside(self, name: str) -> Kind:
        """Find the kind of a constant array, or a number, of the module."""
        value = None if name in self._locals else self._scope.get(name)
        if isinstance(value, np.ndarray) and value.dtype.name in _ELEMENTS:
            return ArrayKind(value.shape, _ELEMENTS[value.dtype.name])
        return NUMBER if isinstance(value, bool | int | float) else None

    def _element_of(self, node: ast.Call) -> type | None:
        """Return the type that a function of numbers answers with; None where it is that of its
        arguments."""
        function = node.func
        if isinstance(function, ast.Name):
            return {"float": float, "int": int, "bool": bool, "round": int, "abs": None, "min": None,
                    "max": None}.get(function.id, float)  # fmt: skip
        assert isinstance(function, ast.Attribute)
        if isinstance(function.value, ast.Name) and function.value.id == "math":
            return (
                int
                if function.attr in ("floor", "ceil", "trunc")
                else (bool if function.attr.startswith("is") else float)
            )
        return bool if function.attr in FLAGS else None if function.attr in KEEPING else float

    def _joined_of(
        self, node: ast.expr, parts: Sequence[ast.expr], element: type | None = None
    ) -> Kind:
        return self._joined(node, [self._kind(each) for each in parts], element)

    def _joined(self, node: ast.expr, kinds: Sequence[Kind], element: type | None = None) -> Kind:
        """Return the kind of what is made of each element of expressions of some kinds, as NumPy repeats
        them: an array if one is.

        Raises:
            EquationError: their sizes do not fit.
        """
        arrays = [kind for kind in kinds if isinstance(kind, ArrayKind) and kind.rank]
        if not arrays:
            return NUMBER
        shape = arrays[0].shape
        for kind in arrays[1:]:
            shape = self._common_shape(node, shape, kind.shape)
        if element is None:
            element = max((kind.element for kind in arrays), key=_WIDTHS.index)
        return ArrayKind(shape, element)

    def _common_shape(
        self, node: ast.expr, a: tuple[int | None, ...], b: tuple[int | None, ...]
    ) -> tuple[int | None, ...]:
        rank = max(len(a), len(b))
        made: list[int | None] = []
        for one, other in zip(
            (*[1] * (rank - len(a)), *a), (*[1] * (rank - len(b)), *b), strict=True
        ):
            if None not in (one, other) and one != other and not (repeats(one) or repeats(other)):
                text = f"shapes {shown(a)} and {shown(b)} do not fit together"
                if 1 in (one, other):
                    text += "; one element is repeated only where its array's declaration says that it is one: take it by its index"
                raise self._error(node, text)
            if repeats(one) or repeats(other):
                made.append(other if repeats(one) else one)
            else:  # what is certain before what may be cut, and that before what is open
                made.append(max(one, other, key=_certainty))
        return tuple(made)

    def _without_number(self, node: ast.expr) -> Kind:
        kind = self._kind(node)
        return NUMBER if isinstance(kind, ArrayKind) and not kind.rank else kind

    def _kind_of_part(self, node: ast.Subscript) -> Kind:
        whole = self._kind(node.value)
        if not isinstance(whole, ArrayKind):
            constant = self._resolved(node.value)
            numbers_only = isinstance(constant, tuple) and all(
                isinstance(each, int | float) for each in constant
            )
            return NUMBER if numbers_only and not is_slice(node.slice) else None
        shape: list[int | None] = []
        indices = indices_of(node)
        if any(isinstance(each, ast.Constant) and each.value is None for each in indices):
            text = f"{ast.unparse(node)}: None adds a dimension; write np.outer, or a loop"
            raise self._error(node, text)
        if len(indices) > whole.rank:
            text = f"{ast.unparse(node)}: {len(indices)} indices for {whole.rank} dimensions"
            raise self._error(node, text)
        for k, (size, index) in enumerate(zip(whole.shape, indices, strict=False)):
            if isinstance(index, ast.expr) and not is_slice(index):
                self._check_index(node, index, size, k)
            else:
                shape.append(self._length_of(index, size))
        shape += whole.shape[len(indices) :]
        return ArrayKind(tuple(shape), whole.element) if shape else NUMBER

    def _check_index(self, node: ast.Subscript, index: ast.expr, size: int | None, k: int) -> None:
        """Refuse an index that is always beyond an array, and one that is an array."""
        kind = self._kind(index)
        if isinstance(index, ast.List):
            text = f"{ast.unparse(node)}: an index is a number; take one row, or element, after the other"
            raise self._error(node, text)
        if isinstance(kind, ArrayKind) and kind.rank:
            text = f"{ast.unparse(node)}: an index is a number; write a loop"
            if kind.element is bool:
                text = f"{ast.unparse(node)}: a mask selects elements in y[mask] = ...; for others write a loop, or np.where"
            raise self._error(node, text)
        place = self._constant_of(index)
        if place is None or size is None or -size <= place < size:
            return
        array = ast.unparse(node.value)
        where = f" in dimension {k}" if k else ""
        most = (
            f"the indices of its {size} elements are {-size} to {size - 1}"
            if size
            else "it has no elements"
        )
        raise self._error(node, f"{ast.unparse(node)} is beyond {array}{where}: {most}")

    def _length_of(self, part: ast.expr, size: int | None) -> int | None:
        """Return the length of a slice where it is known."""
        raise NotImplementedError

    def _constant_of(self, node: ast.expr) -> int | None:
        """Return the whole number that an expression always is, where that is known."""
        raise NotImplementedError

    def _cut(self, part: ast.Slice, size: int | None, node: ast.Subscript, dimension: int) -> Any:
        """Find the places of a slice."""
        raise NotImplementedError

    def _kind_of_operation(self, node: ast.BinOp) -> Kind:
        left, right = self._kind(node.left), self._kind(node.right)
        if (
            isinstance(node.op, ast.MatMult)
            and isinstance(left, ArrayKind)
            and isinstance(right, ArrayKind)
        ):
            shape = left.shape[:-1] + (right.shape[1:] if right.rank > 1 else ())
            return ArrayKind(shape) if shape else NUMBER
        kind = self._joined(node, (left, right))
        if isinstance(kind, ArrayKind):
            return ArrayKind(kind.shape, float) if isinstance(node.op, ast.Div) else kind
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
        if not any(is_slice(index) for index in indices_of(target)):
            return False
        return isinstance(self._kind(target.value), ArrayKind)

    def _is_cross(self, node: ast.Call) -> bool:
        found = self._resolved(node.func)
        return found is cross or (found is np.cross and not node.keywords)

    def _resolved(self, node: ast.expr) -> Any:
        """Return the function of the module, or of a module that it imports; else ``None``."""
        if isinstance(node, ast.Name):
            if node.id in self._locals:
                return None
            builtins = self._scope.get("__builtins__", {})
            builtins = builtins if isinstance(builtins, dict) else vars(builtins)
            return self._scope.get(node.id, builtins.get(node.id))
        if isinstance(node, ast.Attribute):
            owner = self._resolved(node.value)
            return getattr(owner, node.attr, None) if owner is not None else None
        return None

    def _applies_to_elements(self, node: ast.Call) -> bool:
        """Return whether a call is of a function of numbers, which an equation applies to each
        element."""
        name = node.func
        if isinstance(name, ast.Attribute):
            return isinstance(name.value, ast.Name) and name.value.id in ("math", NUMBERS)
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
        if known is not None and not isinstance(known, GreatestLength):
            return ast.copy_location(ast.Constant(known), node)
        if isinstance(node, ast.Attribute) and node.attr == "T":
            return self._size_of(node.value, kind.rank - 1 - dimension)
        if isinstance(node, ast.Subscript):
            return self._size_of_part(node, dimension)
        if isinstance(node, ast.Name | ast.Attribute):
            shape = ast.Attribute(self._inside(cloned(node)), "shape", ast.Load())
            part = ast.Subscript(shape, ast.Constant(dimension), ast.Load())
            return ast.copy_location(part, node)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            left = self._kind(node.left)
            assert isinstance(left, ArrayKind)
            if dimension < left.rank - 1:
                return self._size_of(node.left, dimension)
            return self._size_of(node.right, 1)
        parts = [each for each in ast.iter_child_nodes(node) if isinstance(each, ast.expr)]
        for repeated in (False, True):
            for each in parts:
                found = self._kind(each)
                place = dimension - kind.rank + (found.rank if isinstance(found, ArrayKind) else 0)
                if (
                    isinstance(found, ArrayKind)
                    and place >= 0
                    and repeats(found.shape[place]) == repeated
                ):
                    return self._size_of(each, place)
        return None

    def _size_of_part(self, node: ast.Subscript, dimension: int) -> ast.expr | None:
        whole = self._kind(node.value)
        assert isinstance(whole, ArrayKind)
        indices = indices_of(node)
        kept = [k for k in range(whole.rank) if k >= len(indices) or is_slice(indices[k])]
        k = kept[dimension]
        if k >= len(indices):
            return self._size_of(node.value, k)
        part: Any = indices[k]
        if isinstance(part, ast.Slice):
            part = self._cut(part, whole.shape[k], node, k)
        length: ast.expr = cloned(part.length)
        return length

    def _error(self, node: ast.AST, text: str) -> EquationError:
        where = f"{self._file}:{getattr(node, 'lineno', 0)}"
        return EquationError(f"{where}: kernel {self._function.__qualname__}: {text}")


_NUMBERS = ("float", "int", "bool", float, int, bool)


def indices_of(node: ast.Subscript) -> list[ast.expr]:
    return list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]


def is_slice(index: ast.expr) -> bool:
    """Return whether an index is a slice, or a cut in place of one."""
    return isinstance(index, ast.Slice) or hasattr(index, "length")


def repeats(size: int | None) -> bool:
    """Return whether a dimension of one element stands for all places of another's; one whose size
    only a call tells is not repeated."""
    return size == 1 and not isinstance(size, RuntimeSize)


def _certainty(size: int | None) -> int:
    return 0 if size is None else 1 if isinstance(size, GreatestLength) else 2


def shown(shape: Sequence[int | None]) -> str:
    """Return a shape as text."""
    sizes = ["?" if size is None else str(int(size)) for size in shape]
    return f"({', '.join(sizes)}{',' if len(sizes) == 1 else ''})"


_WIDTHS = (bool, int, float)
_ELEMENTS: Mapping[str, type] = {"float64": float, "int64": int, "bool": bool}
FLAGS = ("isnan", "isfinite", "isinf")
"""NumPy's functions of a number that answer with a flag."""
KEEPING = ("maximum", "minimum", "clip", "sign")
"""NumPy's functions that answer with a whole number for whole numbers."""
NUMBERS = "__aloft_numbers__"
"""Name in a kernel's module under which ``numpy_numbers`` stands for rewritten code."""


def numbers() -> Any:
    """Return the module ``numpy_numbers``, which has kernels and so is imported after what marks them."""
    return import_module(f"{__package__}.numpy_numbers")
