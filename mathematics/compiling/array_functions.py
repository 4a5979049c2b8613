"""Calls of NumPy's functions in kernels, as products, loops and functions of numbers.

``y[:] = np.sin(u) / np.linalg.norm(v)`` becomes an equation with a function of numbers, behind a loop for
the sum of squares. What makes an array, such as ``np.zeros(3)`` or ``a + b``, gets an array of the kernel's own,
of a constant size.
"""

from __future__ import annotations

import ast
import copy
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .array_equations import ArrayEquations
from .expressions import NUMBERS, cloned, numbers, shown
from .kernel_registry import is_kernel
from .kinds import NUMBER, ArrayKind, Kind, NumberKind
from .slices import called

LARGEST = 4096
"""The largest number of elements of an array of a kernel's own, which stands on the stack."""

_PRODUCTS = {np.dot, np.matmul, np.inner, np.vdot}
_NUMBER_FUNCTIONS: dict[Any, str] = {
    getattr(np, name): name
    for name in (
        "maximum", "minimum", "clip", "sign", "sqrt", "sin", "cos", "tan", "exp", "expm1", "log", "tanh", "arccos",
        "arcsin", "arctan", "arctan2", "hypot", "floor", "ceil", "trunc", "rint", "isnan", "isfinite", "isinf",
    )
} | {np.round: "rint"}  # fmt: skip
_OPERATIONS: dict[Any, ast.operator] = {
    np.add: ast.Add(),
    np.subtract: ast.Sub(),
    np.multiply: ast.Mult(),
    np.divide: ast.Div(),
    np.power: ast.Pow(),
    np.floor_divide: ast.FloorDiv(),
    np.mod: ast.Mod(),
}
_FACTORS: dict[Any, float] = {
    np.deg2rad: math.pi / 180.0, np.radians: math.pi / 180.0, np.rad2deg: 180.0 / math.pi, np.degrees: 180.0 / math.pi,
}  # fmt: skip
_COMPARISONS: dict[Any, ast.cmpop] = {
    np.less: ast.Lt(), np.greater: ast.Gt(), np.less_equal: ast.LtE(), np.greater_equal: ast.GtE(),
    np.equal: ast.Eq(), np.not_equal: ast.NotEq(),
}  # fmt: skip
_CONVERSIONS: dict[Any, str] = {np.float64: "float", np.int64: "int", np.bool_: "bool"}
_REDUCTIONS: dict[Any, str] = {
    np.sum: "sum", np.prod: "prod", np.max: "max", np.min: "min", np.amax: "max", np.amin: "min", np.argmax: "argmax",
    np.argmin: "argmin", np.any: "any", np.all: "all", np.mean: "mean", np.linalg.norm: "norm",
    np.count_nonzero: "count", sum: "sum", max: "largest", min: "least", any: "any", all: "all",
}  # fmt: skip
_METHODS = ("sum", "prod", "max", "min", "argmax", "argmin", "any", "all", "mean")
_TEXTS = {
    "sum": ("total = 0.0", "total += E"),
    "whole sum": ("total = 0", "total += E"),
    "count": ("total = 0", "if E: total += 1"),
    "prod": ("total = 1.0", "total *= E"),
    "whole prod": ("total = 1", "total *= E"),
    "norm": ("total = 0.0", "x = E\ntotal += x * x"),
    "max": ("total = FIRST", "x = E\nif x > total or x != x: total = x"),
    "min": ("total = FIRST", "x = E\nif x < total or x != x: total = x"),
    "largest": ("total = FIRST", "x = E\nif x > total: total = x"),
    "least": ("total = FIRST", "x = E\nif x < total: total = x"),
    "argmax": (
        "most = FIRST\ntotal = 0\nk = 0",
        "x = E\nif most == most and (x > most or x != x):\n    most = x\n    total = k\nk += 1",
    ),
    "argmin": (
        "most = FIRST\ntotal = 0\nk = 0",
        "x = E\nif most == most and (x < most or x != x):\n    most = x\n    total = k\nk += 1",
    ),
    "any": ("total = False", "if E: total = True"),
    "all": ("total = True", "if not E: total = False"),
}
"""The statements before the loop over all elements E of an array, and in it; the result is ``total``."""


_NUMBER_CALLS = {float, int, bool, abs, min, max, len, round, range}
"""Functions of Python that a kernel may call."""


class ArrayFunctions(ArrayEquations):
    """Replaces calls of functions of arrays by what equations are made of."""

    def _canonical(self, node: ast.expr) -> ast.expr:
        """Replace the calls in an expression, the innermost first."""
        if isinstance(
            node, ast.Lambda | ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp
        ):
            return node
        listed = isinstance(node, ast.Call) and self._resolved(node.func) is np.array
        if not listed:
            self._children(node, self._canonical)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            node.func.value = self._canonical(node.func.value)
        if isinstance(node, ast.Call):
            made = self._canonical_call(node)
            if made is not node:
                for each in ast.walk(made):
                    if not hasattr(each, "lineno"):
                        ast.copy_location(each, node)
            return made
        if isinstance(node, ast.Subscript) or (
            isinstance(node, ast.Attribute) and node.attr == "T"
        ):
            inner = node.value
            if isinstance(inner, ast.BinOp | ast.UnaryOp | ast.Call | ast.IfExp) and self._is_array(
                inner
            ):
                node.value = self._new_array(inner)
        return node

    _foreign: set[str]
    """Names of what functions have made that kernels do not know."""

    def _is_array(self, node: ast.expr) -> bool:
        kind = self._kind(node)
        return isinstance(kind, ArrayKind) and kind.rank > 0

    def _canonical_call(self, node: ast.Call) -> ast.expr:
        arguments = node.args
        if isinstance(node.func, ast.Attribute) and self._is_array(node.func.value):
            return self._method(node, node.func)
        function = self._resolved(node.func)
        try:
            hash(function)
        except TypeError:
            return node
        kinds = [self._kind(each) for each in arguments]
        if function in _MAKERS and not self._is_unknown(kinds):
            return _MAKERS[function](self, node)
        if node.keywords:
            return self._along_axis(node, _REDUCTIONS.get(function, ""), arguments)
        known = bool(kinds) and all(isinstance(kind, ArrayKind | NumberKind) for kind in kinds)
        if not known:
            return node
        if function in _PRODUCTS and len(arguments) == 2 and all(map(self._is_array, arguments)):
            return ast.BinOp(arguments[0], ast.MatMult(), arguments[1])
        if function in _OPERATIONS and len(arguments) == 2:
            return ast.BinOp(arguments[0], copy.copy(_OPERATIONS[function]), arguments[1])
        if function in _COMPARISONS and len(arguments) == 2:
            return ast.Compare(arguments[0], [copy.copy(_COMPARISONS[function])], [arguments[1]])
        if function in (np.absolute, np.fabs) and len(arguments) == 1:
            return called("abs", *arguments)
        if function in _FACTORS and len(arguments) == 1:
            return ast.BinOp(arguments[0], ast.Mult(), ast.Constant(_FACTORS[function]))
        if function is np.negative and len(arguments) == 1:
            return ast.UnaryOp(ast.USub(), arguments[0])
        if function is np.square and len(arguments) == 1:
            return ast.BinOp(arguments[0], ast.Pow(), ast.Constant(2))
        if function is np.where and len(arguments) == 3:
            return ast.IfExp(arguments[0], arguments[1], arguments[2])
        if function in (np.logical_and, np.logical_or) and len(arguments) == 2:
            op = ast.And() if function is np.logical_and else ast.Or()
            return ast.BoolOp(op, list(arguments))
        if function is np.logical_not and len(arguments) == 1:
            return ast.UnaryOp(ast.Not(), arguments[0])
        if function in _CONVERSIONS and len(arguments) == 1:
            return called(_CONVERSIONS[function], *arguments)
        if _NUMBER_FUNCTIONS.get(function):
            return self._number_call(node, _NUMBER_FUNCTIONS[function])
        if function in _REDUCTIONS and len(arguments) == 1 and self._is_array(arguments[0]):
            return self._reduced(node, _REDUCTIONS[function], arguments[0])
        if function is np.outer and len(arguments) == 2 and all(map(self._is_array, arguments)):
            return self._outer_product(node)
        return node

    def _is_unknown(self, kinds: Sequence[Kind]) -> bool:
        return any(kind is None for kind in kinds) and not all(kind is None for kind in kinds)

    def _number_call(self, node: ast.Call, name: str) -> ast.expr:
        if len(node.args) != _TAKES.get(name, 1):
            return node
        self._scope.setdefault(NUMBERS, numbers())  # type: ignore[attr-defined]  # a module's names
        return ast.Call(
            ast.Attribute(ast.Name(NUMBERS, ast.Load()), name, ast.Load()), node.args, []
        )

    def _method(self, node: ast.Call, function: ast.Attribute) -> ast.expr:
        """``u.v.sum()`` and so on."""
        array, name = function.value, function.attr
        if node.keywords:
            return self._along_axis(node, name if name in _METHODS else "", [array, *node.args])
        if name == "dot" and len(node.args) == 1 and self._is_array(node.args[0]):
            return ast.BinOp(array, ast.MatMult(), node.args[0])
        if name == "copy" and not node.args:
            return self._new_array(array)
        if name in _METHODS and not node.args:
            return self._reduced(node, name, array)
        if name == "clip" and len(node.args) == 2:
            return self._number_call(ast.Call(function, [array, *node.args], []), "clip")
        return node

    def _outer_product(self, node: ast.Call) -> ast.expr:
        """``np.outer(a, b)``: rows and a column, of which each element is a product."""
        a, b = self._kind(node.args[0]), self._kind(node.args[1])
        assert isinstance(a, ArrayKind) and isinstance(b, ArrayKind)
        if a.rank != 1 or b.rank != 1:
            raise self._error(node, "np.outer takes two vectors")
        made = ast.Call(ast.Name("<outer>", ast.Load()), node.args, [])
        return self._filled(node, ArrayKind((a.shape[0], b.shape[0]), float), made)

    def _write_out(self, node: ast.Assign) -> None:
        """``M[0] = [a, b, c]`` writes an array of these numbers; ``a, b, c = u`` reads the elements of ``u``."""
        target, value = node.targets[0], node.value
        if isinstance(target, ast.Subscript) and isinstance(value, ast.List | ast.Tuple):
            if self._is_array(target):
                call = ast.copy_location(ast.Call(value, [value], []), value)
                node.value = self._made_array(call)
        elif isinstance(target, ast.Tuple):
            kind = self._kind(value)
            if isinstance(kind, ArrayKind) and kind.shape == (len(target.elts),):
                if not isinstance(value, ast.Name | ast.Attribute):
                    value = self._new_array(value)
                places = (ast.Constant(k) for k in range(len(target.elts)))
                elements: list[ast.expr] = [
                    ast.Subscript(cloned(value), place, ast.Load()) for place in places
                ]
                node.value = ast.Tuple(elements, ast.Load())
                for each in ast.walk(node.value):
                    ast.copy_location(each, value)
            elif isinstance(kind, ArrayKind) and kind.rank and not self._root(value):
                text = f"{len(target.elts)} names take an array of shape {shown(kind.shape)}; read its elements one after the other"
                raise self._error(node, text)

    def _is_foreign(self, target: ast.expr, value: ast.expr, whole: bool) -> bool:
        """Return whether an equation has a function that makes an array, and that kernels do not know:
        it stays as it is, for NumPy and plain Python. ``whole``: a target that is an array by itself is written into."""
        if isinstance(target, ast.Name) and not whole:
            foreign = self._makes_foreign(value)
            (self._foreign.add if foreign else self._foreign.discard)(target.id)
            return foreign
        if self._mask_of(target) is not None:
            return False
        if not (self._is_array(target) if whole else self._covers_elements(target)):
            return False
        return self._makes_foreign(value)

    def _mask_of(self, target: ast.expr) -> ast.expr | None:
        """Find the mask of ``y[u > 0.0]``."""
        raise NotImplementedError

    def _makes_foreign(self, value: ast.expr) -> bool:
        for each in ast.walk(value):
            if isinstance(each, ast.Name) and each.id in self._foreign:
                return True
            if (
                isinstance(each, ast.Call)
                and not self._applies_to_elements(each)
                and not self._is_cross(each)
            ):
                function = self._resolved(each.func)
                known = function is not None and (is_kernel(function) or function in _NUMBER_CALLS)
                takes_arrays = any(map(self._is_array, each.args)) or (
                    isinstance(each.func, ast.Attribute) and self._is_array(each.func.value)
                )
                module = getattr(function, "__module__", "") or ""
                if not known and (takes_arrays or module.startswith("numpy")):
                    return True
        return False

    # Numbers of whole arrays

    def _reduced(self, node: ast.expr, name: str, value: ast.expr) -> ast.expr:
        """Write the loop ahead that finds one number of an array, and return its name."""
        kind = self._kind(value)
        assert isinstance(kind, ArrayKind)
        if name == "sum" and kind.element is not float:
            name = "count" if kind.element is bool else "whole sum"
        if name == "prod" and kind.element is not float:
            name = "whole prod"
        if kind.shape == (0,) and "max" in name + "min":
            raise self._error(node, f"{ast.unparse(node)} of an array without elements")
        before, within = _TEXTS["sum" if name == "mean" else name]
        value = self._settle(self._without_cross(cloned(value)), "")
        sizes = [self._size_of(value, k) for k in range(kind.rank)]
        if any(size is None for size in sizes):
            raise self._error(node, f"the size of {ast.unparse(value)} is not known")
        self._demand_lengths(value, [size for size in sizes if size is not None])
        names = {each: self._name(each) for each in ("total", "most", "x", "k")}
        variables = [self._name("i") for _ in sizes]

        def written(text: str, places: list[ast.expr]) -> list[ast.stmt]:
            outer, self._ahead = self._ahead, []
            element = self._element(cloned(value), places)
            ahead, self._ahead = self._ahead, outer
            return [*ahead, *_filled_in(text, names, element)]

        zeros: list[ast.expr] = [ast.Constant(0) for _ in sizes]
        for statement in written(before, zeros) if "FIRST" in before else _filled_in(before, names):
            self._put_ahead(statement, node)
        body = written(within, [ast.Name(v, ast.Load()) for v in variables])
        for variable, size in zip(reversed(variables), reversed(sizes), strict=True):
            assert size is not None
            loop = called("range", size)
            body = [ast.For(ast.Name(variable, ast.Store()), loop, body, [], None)]
        for statement in body:
            self._put_ahead(statement, node)
        total: ast.expr = ast.Name(names["total"], ast.Load())
        self._kinds[names["total"]] = NUMBER
        if name == "mean":
            first, *others = (cloned(size) for size in sizes if size is not None)
            count = first
            for size in others:
                count = ast.BinOp(count, ast.Mult(), size)
            total = ast.BinOp(total, ast.Div(), count)
        if name == "norm":
            total = self._number_call(ast.Call(total, [total], []), "sqrt")
        if name in ("mean", "norm"):
            total = self._kept("number", total, node)
            assert isinstance(total, ast.Name)
            self._kinds[total.id] = NUMBER
        return total

    def _along_axis(self, node: ast.Call, name: str, arguments: Sequence[ast.expr]) -> ast.expr:
        """``np.sum(A, axis=1)``: one number for each row, or for each column."""
        keyword = node.keywords[0]
        axis = self._constant_of(keyword.value) if keyword.arg == "axis" else None
        if not name or axis not in (0, 1, -1) or len(node.keywords) + len(arguments) > 2:
            return node
        kind = self._kind(arguments[0])
        if not isinstance(kind, ArrayKind) or kind.rank != 2:
            return node
        array = arguments[0]
        if not isinstance(array, ast.Name | ast.Attribute):
            array = self._new_array(array)
        kept = 1 if axis == 0 else 0
        element: type = bool if name in ("any", "all") else int if name.startswith("arg") else float
        if kind.element is not float and name in ("sum", "prod", "max", "min"):
            element = kind.element if name in ("max", "min") else int
        made = self._room(node, ArrayKind((kind.shape[kept],), element))
        row = self._name("i")
        self._kinds[row] = NUMBER
        self._counters.add(row)
        place, whole = ast.Name(row, ast.Load()), ast.Slice()
        index = ast.Tuple([whole, place] if axis == 0 else [place, whole], ast.Load())
        part = ast.Subscript(cloned(array), index, ast.Load())
        for each in ast.walk(part):
            ast.copy_location(each, node)
        ahead, self._ahead = self._ahead, []
        total = self._reduced(node, name, part)
        target = ast.Subscript(ast.Name(made.id, ast.Load()), cloned(place), ast.Store())
        self._put_ahead(ast.Assign([target], self._expression(total)), node)
        body, self._ahead = self._ahead, ahead
        size = ast.Constant(int(kind.shape[kept] or 0))
        self._put_ahead(
            ast.For(ast.Name(row, ast.Store()), called("range", size), body, [], None), node
        )
        return made

    def _without_cross(self, value: ast.expr) -> ast.expr:
        """Compute the cross products in a value ahead, where no equation does."""
        rewriter = self

        class Products(ast.NodeTransformer):
            def visit_Call(self, node: ast.Call) -> ast.AST:
                self.generic_visit(node)
                return rewriter._new_array(node) if rewriter._is_cross(node) else node

        made: ast.expr = Products().visit(value)
        return made

    # Arrays of the kernel's own

    def _new_array(self, value: ast.expr) -> ast.expr:
        """Compute an array ahead, in memory of the kernel's own."""
        kind = self._kind(value)
        assert isinstance(kind, ArrayKind)
        return self._filled(value, kind, value)

    def _filled(self, node: ast.expr, kind: ArrayKind, value: ast.expr | None) -> ast.Name:
        """Make an array of the kernel's own, and write a value into it."""
        name = self._room(node, kind)
        if value is not None:
            whole = ast.Tuple([ast.Slice() for _ in kind.shape], ast.Load())
            target = ast.Subscript(ast.Name(name.id, ast.Load()), whole, ast.Store())
            for each in ast.walk(target):
                ast.copy_location(each, node)
            statement = ast.copy_location(ast.Assign([target], value), node)
            self._check_products(value)
            for each in self._loops(statement, target, value):
                self._put_ahead(each, node)
        return name

    def _room(self, node: ast.expr, kind: ArrayKind) -> ast.Name:
        sizes = [size for size in kind.shape if size is not None]
        if len(sizes) < kind.rank:
            raise self._error(
                node,
                f"{ast.unparse(node)[:60]}: this makes a new array: assign it into one, as in scratch.x[:] = ..., "
                "or make its size a constant",
            )
        count = 1
        for size in sizes:
            count *= size
        if count > LARGEST:
            raise self._error(
                node, f"an array of {count} elements belongs in Scratch, as in scratch.x[:] = ..."
            )
        self._scope.setdefault(NUMBERS, numbers())  # type: ignore[attr-defined]  # a module's names
        room = ast.Attribute(ast.Name(NUMBERS, ast.Load()), "room", ast.Load())
        dtype = {float: "float64", int: "int64", bool: "bool"}[kind.element]
        shape = ast.Tuple([ast.Constant(int(size)) for size in sizes], ast.Load())
        made = self._kept("array", ast.Call(room, [shape, ast.Constant(dtype)], []), node)
        assert isinstance(made, ast.Name)
        self._kinds[made.id] = kind._replace(shape=tuple(int(size) for size in sizes))
        self._own.add(made.id)
        return made

    def _shape_in(self, node: ast.Call) -> tuple[int, ...]:
        """Read the shape that a call asks for. Raises ``EquationError``: it is not constant."""
        first = node.args[0] if node.args else None
        parts = first.elts if isinstance(first, ast.Tuple | ast.List) else [first]
        sizes = [None if part is None else self._constant_of(part) for part in parts]
        if None in sizes or any(size is not None and size < 0 for size in sizes):
            raise self._error(
                node, f"{ast.unparse(node)}: the size of an array in a kernel is a constant; "
                "else declare a field of Scratch")  # fmt: skip
        return tuple(size for size in sizes if size is not None)

    def _made_zeros(self, node: ast.Call) -> ast.expr:
        return self._filled(node, ArrayKind(self._shape_in(node), self._dtype_in(node, 1)), None)

    def _dtype_in(self, node: ast.Call, place: int, otherwise: type = float) -> type:
        given = [each.value for each in node.keywords if each.arg == "dtype"] or node.args[
            place : place + 1
        ]
        others = [each.arg for each in node.keywords if each.arg != "dtype"]
        if others or len(node.args) > place + 1:
            raise self._error(
                node, f"{ast.unparse(node)}: a kernel knows its size and its dtype only"
            )
        if not given:
            return otherwise
        found = self._resolved(given[0])
        for kind, names in (
            (float, (float, np.float64)),
            (int, (int, np.int64)),
            (bool, (bool, np.bool_)),
        ):
            if found in names:
                return kind
        raise self._error(node, f"{ast.unparse(node)}: a dtype is float, int or bool")

    def _made_ones(self, node: ast.Call) -> ast.expr:
        kind = self._dtype_in(node, 1)
        return self._filled(node, ArrayKind(self._shape_in(node), kind), ast.Constant(kind(1)))

    def _made_full(self, node: ast.Call) -> ast.expr:
        if len(node.args) != 2:
            raise self._error(node, "np.full takes a shape and a number")
        return self._filled(
            node, ArrayKind(self._shape_in(node), self._dtype_in(node, 2)), node.args[1]
        )

    def _made_eye(self, node: ast.Call) -> ast.expr:
        size = self._shape_in(node)[0]
        made = self._filled(node, ArrayKind((size, size), self._dtype_in(node, 1)), None)
        text = f"for {(i := self._name('i'))} in range({size}): {made.id}[{i}, {i}] = 1"
        self._put_ahead(ast.parse(text).body[0], node)
        return made

    def _made_like(self, node: ast.Call) -> ast.expr:
        kind = self._kind(node.args[0])
        if not isinstance(kind, ArrayKind):
            return node
        one = self._resolved(node.func) is np.ones_like
        return self._filled(
            node,
            ArrayKind(kind.shape, self._dtype_in(node, 1, kind.element)),
            ast.Constant(1) if one else None,
        )

    def _made_copy(self, node: ast.Call) -> ast.expr:
        return self._new_array(node.args[0]) if self._is_array(node.args[0]) else node

    def _made_array(self, node: ast.Call) -> ast.expr:
        """``np.array([x, y, z])``, also with rows."""
        if not node.args or not isinstance(node.args[0], ast.List | ast.Tuple):
            node.args = [self._canonical(each) for each in node.args]
            return self._made_copy(node) if node.args and not node.keywords else node
        rows = node.args[0].elts
        nested = [each for each in rows if isinstance(each, ast.List | ast.Tuple)]
        lines = [each.elts for each in nested] if nested else [rows]
        if (
            not rows
            or (nested and len(nested) < len(rows))
            or len({len(line) for line in lines}) != 1
        ):
            raise self._error(node, f"{ast.unparse(node)}: rows of one length are needed")
        lines = [[self._canonical(each) for each in line] for line in lines]
        if any(self._is_array(each) for line in lines for each in line):
            raise self._error(node, f"{ast.unparse(node)}: write numbers into it, or assign rows")
        kinds = {self._number_type(each) for line in lines for each in line}
        otherwise = int if kinds == {int} else bool if kinds == {bool} else float
        shape = (len(lines), len(lines[0])) if nested else (len(rows),)
        kind = ArrayKind(shape, self._dtype_in(node, 1, otherwise))
        # all numbers first: they may read what the name stands for that the array gets
        numbers = [
            [self._kept("element", self._expression(each), node) for each in line] for line in lines
        ]
        made = self._room(node, kind)
        for i, line in enumerate(numbers):
            for j, each in enumerate(line):
                place: ast.expr = ast.Constant(j)
                if nested:
                    place = ast.Tuple([ast.Constant(i), place], ast.Load())
                target = ast.Subscript(ast.Name(made.id, ast.Load()), place, ast.Store())
                self._put_ahead(ast.Assign([target], each), node)
        return made

    def _number_type(self, node: ast.expr) -> type | None:
        """Return the type of a number where it can be seen."""
        if isinstance(node, ast.Constant):
            return type(node.value)
        if isinstance(node, ast.UnaryOp):
            return self._number_type(node.operand)
        if self._constant_of(node) is not None:
            return int
        return self._element_type(node)


def _filled_in(text: str, names: dict[str, str], element: ast.expr | None = None) -> list[ast.stmt]:
    """Parse some statements, with other names and the element of an array in place of ``E`` or ``FIRST``."""

    class Names(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.AST:
            if node.id in ("E", "FIRST") and element is not None:
                return cloned(element)
            return ast.Name(names.get(node.id, node.id), node.ctx)

    parsed = Names().visit(ast.parse(text)).body
    for statement in parsed:
        for each in ast.walk(statement):
            for attribute in ("lineno", "col_offset", "end_lineno", "end_col_offset"):
                if attribute in getattr(each, "__dict__", {}):
                    delattr(each, attribute)
    made: list[ast.stmt] = parsed
    return made


_TAKES = {"maximum": 2, "minimum": 2, "clip": 3, "arctan2": 2, "hypot": 2}
_MAKERS: dict[Any, Callable[[Any, ast.Call], ast.expr]] = {
    np.zeros: ArrayFunctions._made_zeros, np.empty: ArrayFunctions._made_zeros, np.ones: ArrayFunctions._made_ones,
    np.full: ArrayFunctions._made_full, np.eye: ArrayFunctions._made_eye, np.identity: ArrayFunctions._made_eye,
    np.zeros_like: ArrayFunctions._made_like, np.empty_like: ArrayFunctions._made_like,
    np.ones_like: ArrayFunctions._made_like, np.copy: ArrayFunctions._made_copy, np.array: ArrayFunctions._made_array,
}  # fmt: skip
"""Functions that make an array."""
