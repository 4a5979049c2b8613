"""Loops over numbers for equations on arrays: ``out[:] = R @ v + s * x``."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from typing import NamedTuple

from .expressions import NUMBERS, cloned, indices_of, numbers, repeats, shown
from .kinds import NUMBER, ArrayKind
from .slices import Cut, Slices, called, minus, plus


class ArraySelection(NamedTuple):
    """A part of an array that an expression is: for each dimension a number or a slice."""

    array: str
    indices: tuple[tuple[str, ...], ...]


class ArrayEquations(Slices):
    """Writes the loops for one equation."""

    _products: set[str]
    """Names of cross products, whose elements are numbers: ``cross_1__0`` and so on."""

    def _loops(
        self, node: ast.stmt, target: ast.expr, value: ast.expr, mask: ast.expr | None = None
    ) -> list[ast.stmt]:
        """Write the loops for ``target = value``, where the target is a part of an array, and only for
        elements that a mask selects."""
        assert isinstance(target, ast.Subscript)
        kind = self._kind(target)
        assert isinstance(kind, ArrayKind)
        self._check_products(value)
        self._check_shapes(node, kind, value)
        target = self._settled_target(target)
        value = self._settle(value, self._path(target))
        if mask is not None:
            mask = self._settle(mask, self._path(target))
            self._check_overlap(node, target, mask)
        unrolled = any(
            isinstance(each, ast.Call) and self._is_cross(each) for each in ast.walk(value)
        )
        if unrolled:
            if kind.rank != 1 or mask is not None:
                raise self._error(node, "a cross product is assigned to a vector of three")
            value = self._with_cross_products(value)
        self._check_overlap(node, target, value)
        if unrolled:
            return [
                ast.copy_location(self._element_statement(target, value, [ast.Constant(k)]), node)
                for k in range(3)
            ]  # fmt: skip
        sizes = self._sizes(target)
        self._demand_lengths(value, sizes)
        variables = [self._name("i") for _ in sizes]
        places: list[ast.expr] = [ast.Name(v, ast.Load()) for v in variables]
        outer, self._ahead = self._ahead, []
        inner: ast.stmt = self._element_statement(target, value, places)
        body = [*self._ahead, inner]
        if mask is not None:
            self._ahead = []
            test = self._element(mask, places)
            body = [*self._ahead, ast.If(test, body, [])]
        self._ahead = outer
        for variable, size in zip(reversed(variables), reversed(sizes), strict=True):
            loop = ast.For(ast.Name(variable, ast.Store()), called("range", size), body, [], None)
            body = [loop]
        for statement in body:
            ast.copy_location(statement, node)
            for each in ast.walk(statement):
                if not hasattr(each, "lineno"):
                    ast.copy_location(each, node)
        return body

    def _demand_lengths(self, node: ast.expr, sizes: list[ast.expr]) -> None:
        """End the run where a slice in a value, whose length only the run knows, is shorter or longer than
        the loops over its elements."""
        kind = self._kind(node)
        if not isinstance(kind, ArrayKind) or not kind.rank or isinstance(node, ast.IfExp):
            return
        sizes = sizes[len(sizes) - kind.rank :]
        if isinstance(node, ast.Attribute) and node.attr == "T":
            self._demand_lengths(node.value, sizes[::-1])
        elif isinstance(node, ast.Subscript):
            self._settle_indices(node)
            lengths = [each.length for each in indices_of(node) if isinstance(each, Cut)]
            for size, wanted, length in zip(kind.shape, sizes, lengths, strict=False):
                if repeats(size) and not isinstance(length, ast.Constant):
                    wanted = (
                        wanted if ast.unparse(length) == ast.unparse(wanted) else ast.Constant(1)
                    )
                same = ast.unparse(length) == ast.unparse(wanted)
                if not same and not isinstance(length, ast.Constant):
                    function = ast.Attribute(ast.Name(NUMBERS, ast.Load()), "demand", ast.Load())
                    test = ast.Call(function, [cloned(length), cloned(wanted)], [])
                    self._scope.setdefault(NUMBERS, numbers())  # type: ignore[attr-defined]  # a module's names
                    self._put_ahead(ast.Expr(test), node)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            self._demand_product(node, sizes)
        elif not isinstance(node, ast.Name):
            for each in ast.iter_child_nodes(node):
                if isinstance(each, ast.expr):
                    self._demand_lengths(each, sizes)

    def _demand_product(self, node: ast.BinOp, sizes: list[ast.expr]) -> None:
        """Do so with the factors of a product, which has these sizes."""
        left, inner = self._kind(node.left), self._inner_size(node)
        assert isinstance(left, ArrayKind)
        if inner is not None:
            rows = left.rank - 1
            self._demand_lengths(node.left, [*sizes[:rows], inner])
            self._demand_lengths(node.right, [inner, *sizes[rows:]])

    def _inner_size(self, node: ast.BinOp) -> ast.expr | None:
        """Return the number of products that each element of a product is the sum of."""
        left = self._kind(node.left)
        assert isinstance(left, ArrayKind)
        return self._size_of(node.left, left.rank - 1) or self._size_of(node.right, 0)

    def _settled_target(self, target: ast.Subscript) -> ast.Subscript:
        target = cloned(target)
        self._settle_indices(target)
        return target

    def _settle(self, node: ast.expr, target: str) -> ast.expr:
        """Compute what is one number for all elements in front of the loops: bounds of slices,
        products of two vectors, and elements of the array that the loops write to."""
        kind = self._kind(node)
        if isinstance(kind, ArrayKind) and kind.rank:
            return self._settle_array(node, target)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            return self._kept_sum(node)
        if isinstance(node, ast.Subscript | ast.Attribute):
            if target and self._element_type(node) is not None and self._path(node) == target:
                return self._kept("element", self._expression(node), node)
            return node
        if isinstance(
            node, ast.BinOp | ast.UnaryOp | ast.BoolOp | ast.Compare | ast.IfExp | ast.Call
        ):
            return self._children(node, lambda each: self._settle(each, target))
        return node

    def _settle_array(self, node: ast.expr, target: str) -> ast.expr:
        if isinstance(node, ast.Name):
            return node
        if isinstance(node, ast.Attribute):
            if node.attr == "T":
                node.value = self._settle_array(node.value, target)
            return node
        if isinstance(node, ast.Subscript):
            self._settle_indices(node)
            return node
        return self._children(node, lambda each: self._settle(each, target))

    def _kept_sum(self, node: ast.BinOp) -> ast.expr:
        product = self._without_cross(node)
        assert isinstance(product, ast.BinOp)
        self._demand_product(product, [])
        made = self._sum(product, [])
        assert isinstance(made, ast.Name)
        self._kinds[made.id] = NUMBER
        return made

    def _without_cross(self, value: ast.expr) -> ast.expr:
        """Compute the cross products in a value ahead."""
        raise NotImplementedError

    def _element_statement(
        self, target: ast.expr, value: ast.expr, places: list[ast.expr]
    ) -> ast.stmt:
        written = self._part(cloned(target), places)
        assert isinstance(written, ast.Subscript)
        written.ctx = ast.Store()
        return ast.Assign([written], self._element(cloned(value), places))

    def _element(self, node: ast.expr, places: list[ast.expr]) -> ast.expr:
        """Return the element of an expression at some places, or the number that it is."""
        kind = self._kind(node)
        if not isinstance(kind, ArrayKind) or kind.rank == 0:
            return self._expression(node)
        if isinstance(node, ast.Name) and node.id in self._products:
            assert isinstance(places[-1], ast.Constant)
            return ast.copy_location(ast.Name(f"{node.id}_{places[-1].value!r}", ast.Load()), node)
        if isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
            places = places[len(places) - kind.rank :]
            places = [
                ast.Constant(0) if repeats(size) else place
                for size, place in zip(kind.shape, places, strict=True)
            ]
            part = self._part(node, places)
            return part if kind.element is bool else _number(kind.element, part, node)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            return self._sum(node, places[len(places) - kind.rank :])
        if (
            isinstance(node, ast.UnaryOp)
            and isinstance(node.op, ast.Invert)
            and kind.element is bool
        ):
            node.op = ast.Not()
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id == "<outer>"
        ):
            a, b = (
                self._element(each, [place]) for each, place in zip(node.args, places, strict=True)
            )
            return ast.copy_location(ast.BinOp(a, ast.Mult(), b), node)
        if isinstance(node, ast.Call):
            self._complete(node)
            node.args = [self._element(each, places) for each in node.args]
            return node
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            node.left, node.right = (
                self._element(node.left, places),
                self._element(node.right, places),
            )
            return self._power(node)
        return self._children(node, lambda each: self._element(each, places))

    def _complete(self, node: ast.Call) -> None:
        """Put the arguments of a call of a kernel in their order, with those that are left out."""
        raise NotImplementedError

    def _power(self, node: ast.BinOp) -> ast.expr:
        """``x ** 2`` is ``x * x``, as NumPy computes it: C's ``pow`` may round it otherwise."""
        if isinstance(node.right, ast.Constant) and node.right.value == 2:
            simple = not any(
                isinstance(each, ast.Call) and not self._is_conversion(each)
                for each in ast.walk(node.left)
            )
            left = (
                node.left if simple or self._ahead is None else self._kept("base", node.left, node)
            )
            return ast.copy_location(ast.BinOp(left, ast.Mult(), cloned(left)), node)
        return node

    def _is_conversion(self, node: ast.Call) -> bool:
        return isinstance(node.func, ast.Name) and node.func.id in ("float", "int", "bool")

    def _part(self, node: ast.expr, places: Sequence[ast.expr]) -> ast.expr:
        """Return the element of an array, or of a part of one, at some places."""
        places = [cloned(place) for place in places]
        if isinstance(node, ast.Attribute) and node.attr == "T":
            return self._part(node.value, places[::-1])
        indices: list[ast.expr] = []
        if isinstance(node, ast.Subscript):
            self._settle_indices(node)
            for index in indices_of(node):
                if isinstance(index, Cut):
                    indices.append(_place_in(index, places.pop(0)))
                else:
                    indices.append(self._expression(index))
            base = node.value
        else:
            base = node
        indices += places
        base = self._inside(base)
        index = indices[0] if len(indices) == 1 else ast.Tuple(indices, ast.Load())
        return ast.copy_location(ast.Subscript(base, index, ast.Load()), node)

    def _sum(self, node: ast.BinOp, places: list[ast.expr]) -> ast.expr:
        """One element of a product with ``@``: a loop ahead of the statement, and its sum."""
        if self._ahead is None:
            raise self._error(
                node, "a product with @ cannot stand here; assign it to a name before"
            )
        left, right = self._kind(node.left), self._kind(node.right)
        assert isinstance(left, ArrayKind) and isinstance(right, ArrayKind)
        own = left.rank - 1
        total = self._name("sum")
        outer = self._ahead

        def term(j: ast.expr) -> list[ast.stmt]:
            self._ahead = []
            a = self._element(cloned(node.left), [*places[:own], j])
            b = self._element(cloned(node.right), [j, *places[own:]])
            product = ast.BinOp(a, ast.Mult(), b)
            return [*self._ahead, ast.AugAssign(ast.Name(total, ast.Store()), ast.Add(), product)]

        statements: list[ast.stmt] = [ast.Assign([ast.Name(total, ast.Store())], ast.Constant(0.0))]
        if any(isinstance(each, ast.Name) and each.id in self._products for each in ast.walk(node)):
            # a cross product is three numbers, which no index finds
            statements += [each for k in range(3) for each in term(ast.Constant(k))]
        else:
            size = self._inner_size(node)
            if size is None:
                raise self._error(node, "the length of this product is not known")
            j = self._name("j")
            within = term(ast.Name(j, ast.Load()))
            loop = called("range", size)
            statements.append(ast.For(ast.Name(j, ast.Store()), loop, within, [], None))
        self._ahead = outer
        for statement in statements:
            self._put_ahead(statement, node)
        return ast.copy_location(ast.Name(total, ast.Load()), node)

    def _with_cross_products(self, value: ast.expr) -> ast.expr:
        """Replace each cross product in the value by three numbers that are computed ahead."""
        rewriter = self

        class Products(ast.NodeTransformer):
            def visit_Call(self, node: ast.Call) -> ast.AST:
                self.generic_visit(node)
                if not rewriter._is_cross(node):
                    return node
                if len(node.args) != 2 or rewriter._ahead is None:
                    raise rewriter._error(node, "cross takes two vectors")
                name = rewriter._name("cross")
                for k in range(3):
                    a, b = (k + 1) % 3, (k + 2) % 3
                    terms = [
                        ast.BinOp(
                            rewriter._element(cloned(node.args[0]), [ast.Constant(i)]),
                            ast.Mult(),
                            rewriter._element(cloned(node.args[1]), [ast.Constant(j)]),
                        )
                        for i, j in ((a, b), (b, a))
                    ]
                    difference = ast.BinOp(terms[0], ast.Sub(), terms[1])
                    made = ast.Assign([ast.Name(f"{name}_{k}", ast.Store())], difference)
                    rewriter._put_ahead(made, node)
                rewriter._kinds[name] = ArrayKind((3,))
                rewriter._products.add(name)
                return ast.copy_location(ast.Name(name, ast.Load()), node)

        made: ast.expr = Products().visit(value)
        return made

    def _sizes(self, target: ast.Subscript) -> list[ast.expr]:
        """Return the number of elements of a target in each dimension that a loop goes through."""
        kind = self._kind(target)
        assert isinstance(kind, ArrayKind)
        sizes = [self._size_of(target, k) for k in range(kind.rank)]
        if any(size is None for size in sizes):
            raise self._error(target, "say where this slice ends")
        return [size for size in sizes if size is not None]

    # What is refused

    def _check_shapes(self, node: ast.stmt, target: ArrayKind, value: ast.expr) -> None:
        """Refuse sizes that are known not to fit."""
        kind = self._kind(value)
        if isinstance(kind, ArrayKind) and kind.rank > target.rank:
            raise self._error(
                node, f"a value of {kind.rank} dimensions does not fit into {target.rank}"
            )
        if isinstance(kind, ArrayKind) and kind.rank:
            pairs = zip(target.shape[::-1], kind.shape[::-1], strict=False)
            if any(None not in (a, b) and a != b and not repeats(b) for a, b in pairs):
                raise self._error(
                    node,
                    f"a value of shape {shown(kind.shape)} does not fit into {shown(target.shape)}",
                )

    def _check_products(self, value: ast.expr) -> None:
        """Refuse products with ``@`` whose factors do not fit."""
        for each in ast.walk(value):
            if isinstance(each, ast.BinOp) and isinstance(each.op, ast.MatMult):
                left, right = self._kind(each.left), self._kind(each.right)
                for side, found in ((each.left, left), (each.right, right)):
                    if not isinstance(found, ArrayKind) or not found.rank:
                        text = "takes arrays whose dimensions are known"
                        raise self._error(each, f"@ {text}; {ast.unparse(side)} is not one")
                    if found.rank > 2:
                        raise self._error(
                            each,
                            f"@ takes vectors and matrices; {ast.unparse(side)} has {found.rank} dimensions",
                        )
                assert isinstance(left, ArrayKind) and isinstance(right, ArrayKind)
                sizes = left.shape[-1], right.shape[0]
                if None not in sizes and sizes[0] != sizes[1]:
                    raise self._error(
                        each, f"shapes {shown(left.shape)} and {shown(right.shape)} have no product"
                    )

    def _check_overlap(self, node: ast.stmt, target: ast.Subscript, value: ast.expr) -> None:
        """Refuse a target that the value still reads after it has been written."""
        written = self._place_of(target)
        shown = self._root(target) if written.array in self._own else written.array

        def visit(each: ast.expr, summed: bool) -> None:
            if isinstance(each, ast.Name | ast.Attribute | ast.Subscript):
                kind = self._kind(each)
                if not isinstance(kind, ArrayKind) or self._path(each) != written.array:
                    return
                if summed:
                    text = f"{shown} is written while @ still reads it; use another array"
                    raise self._error(node, text)
                roots = {self._root(each), self._root(target)}
                if len(roots) > 1 and roots & self._partial:
                    text = f"{shown} is written while a part of it is read by another name"
                    raise self._error(node, f"{text}; use another array")
                turned = any(isinstance(a, ast.Attribute) and a.attr == "T" for a in ast.walk(each))
                if turned or not _apart_or_same(written, self._place_of(each)):
                    text = f"{shown} is written while another part of it is read"
                    raise self._error(node, f"{text}; use another array")
                return
            within = summed or (isinstance(each, ast.BinOp) and isinstance(each.op, ast.MatMult))
            for part in ast.iter_child_nodes(each):
                if isinstance(part, ast.expr):
                    visit(part, within)

        visit(value, False)

    def _place_of(self, node: ast.expr) -> ArraySelection:
        whole, indices = node, list[tuple[str, ...]]()
        while isinstance(whole, ast.Subscript):
            found: list[tuple[str, ...]] = []
            for index in indices_of(whole):
                if isinstance(index, Cut):
                    length = ast.unparse(index.length) if index.most is None else str(index.most)
                    bounds = ast.unparse(index.first), str(index.step), length
                    found.append(bounds)
                else:
                    found.append((ast.unparse(index),))
            indices, whole = found + indices, whole.value
        kind = self._kind(whole)
        rank = kind.rank if isinstance(kind, ArrayKind) else 0
        for k in range(len(indices), rank):
            size = self._size_of(whole, k)
            indices.append(("0", "1", "?" if size is None else ast.unparse(size)))
        return ArraySelection(self._path(node), tuple(indices))

    def _path(self, node: ast.expr) -> str:
        """Return the array that an expression is, or is a part of, as text; empty where it is
        neither."""
        while isinstance(node, ast.Subscript) or (
            isinstance(node, ast.Attribute) and node.attr == "T"
        ):
            node = node.value
        if not isinstance(node, ast.Name | ast.Attribute):
            return ""
        text = ast.unparse(node)
        name, _, rest = text.partition(".")
        return self._aliases.get(name, name) + (f".{rest}" if rest else "")

    def _root(self, node: ast.expr) -> str:
        while isinstance(node, ast.Subscript | ast.Attribute):
            node = node.value
        return node.id if isinstance(node, ast.Name) else ""

    _own: set[str]
    """Names of arrays of the kernel's own."""
    _partial: set[str]
    """Names of parts of arrays: ``x`` of ``x = state.x[1:]``."""
    _aliases: dict[str, str]
    """Arrays under other names: ``x`` of ``x = state.x``."""

    def _children(self, node: ast.expr, visit: Callable[[ast.expr], ast.expr]) -> ast.expr:
        """Replace the parts of an expression."""
        for field, value in ast.iter_fields(node):
            if field == "func":
                continue
            if isinstance(value, ast.expr):
                setattr(node, field, visit(value))
            elif isinstance(value, list):
                setattr(node, field, [visit(v) if isinstance(v, ast.expr) else v for v in value])
        return node


def _place_in(bounds: Cut, place: ast.expr) -> ast.expr:
    """Return the index of place ``k`` of a slice."""
    first = cloned(bounds.first)
    if bounds.step == 1:
        return plus(first, place)
    if isinstance(place, ast.Constant):
        return plus(first, ast.Constant(bounds.step * place.value))  # type: ignore[operator]  # a number
    gone = (
        place
        if abs(bounds.step) == 1
        else ast.BinOp(ast.Constant(abs(bounds.step)), ast.Mult(), place)
    )
    return plus(first, gone) if bounds.step > 0 else minus(first, gone)


def _apart_or_same(a: ArraySelection, b: ArraySelection) -> bool:
    """Return whether two parts of an array are the same, or have no element in common.

    Rows ``A[i, :]`` and ``A[j, :]`` count as such: element k of one is no other element of the other.
    """
    pairs = zip(a.indices, b.indices, strict=False)
    if len(a.indices) == len(b.indices) and all(len(p) == len(q) == 1 or p == q for p, q in pairs):
        return True
    for one, other in zip(a.indices, b.indices, strict=False):
        first, second = _numbers(one), _numbers(other)
        if first is not None and second is not None and not first & second:
            return True
    return False


def _numbers(index: tuple[str, ...]) -> set[int] | None:
    """Return the places that an index stands for, where they are known."""
    try:
        first, *rest = map(int, index)
    except ValueError:
        return None
    if first < 0 or (rest and rest[1] > 10_000):
        return None
    return {first + rest[0] * k for k in range(rest[1])} if rest else {first}


def _number(kind: type, part: ast.expr, place: ast.AST) -> ast.expr:
    made = called(kind.__name__, part)
    for each in (made, made.func):
        ast.copy_location(each, place)
    return made
