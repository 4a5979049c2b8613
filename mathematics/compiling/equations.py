"""Rewrites the equations of a kernel into loops over numbers, which run the same everywhere.

``out[:] = R @ v + s * x`` becomes::

    for i in range(3):
        sum1 = 0.0
        for j in range(3):
            sum1 += float(R[i, j]) * float(v[j])
        out[i] = sum1 + s * float(x[i])

The rewritten function is what plain Python runs and what is compiled, so both round alike, and
nothing is allocated. Which names are arrays, and of how many dimensions, follows from the types of
the arguments: ``Array1D``, signals, and named tuples of these.

Beside that, a scalar field is read and written like a number, each element that is read becomes a
number of Python (which is faster there), and a member of an ``IntEnum`` becomes its number.
"""

from __future__ import annotations

import ast
import copy
import linecache
import textwrap
from collections.abc import Callable, Sequence
from enum import IntEnum
from types import CodeType
from typing import Any

from .expressions import EquationError as EquationError  # noqa: PLC0414  also imported from here
from .expressions import Expressions, indices_of
from .expressions import cross as cross  # noqa: PLC0414
from .kernel_registry import is_kernel
from .kinds import NUMBER, ArrayKind, Kind, NumberKind, RecordKind, argument_kinds

VERSION = 1
"""Counts changes of what a statement is rewritten into: machine code made before is not used."""


def expanded_code(function: Any, code: CodeType) -> CodeType:
    """Rewrite the code of a kernel with loops in place of equations.

    Raises:
        EquationError: a statement cannot be rewritten.
    """
    definition = expanded_definition(function, code)
    if definition is None:
        return code  # typed in where no source is kept: there it can use no equations
    module = ast.fix_missing_locations(ast.Module([definition], []))
    compiled = compile(module, code.co_filename, "exec", dont_inherit=True)
    (made,) = (each for each in compiled.co_consts if isinstance(each, CodeType))
    return made.replace(co_qualname=code.co_qualname, co_firstlineno=code.co_firstlineno)


def expanded_definition(function: Any, code: CodeType) -> ast.FunctionDef | None:
    """Rewrite the definition of a kernel with loops in place of equations; ``None`` where there is
    no source.

    A function that has variables of another function stays as it is written.

    Raises:
        EquationError: a statement cannot be rewritten.
    """
    import inspect  # costs a start of the command line more than all of this module

    # not inspect.getsourcelines: for a code object it looks through the files of all modules
    linecache.checkcache(code.co_filename)
    lines = linecache.getlines(code.co_filename, function.__globals__)
    first = code.co_firstlineno
    if len(lines) < first:
        return None
    tree = ast.parse(textwrap.dedent("".join(inspect.getblock(lines[first - 1 :]))))
    ast.increment_lineno(tree, first - 1)
    (definition,) = (node for node in tree.body if isinstance(node, ast.FunctionDef))
    if function.__closure__ is None:
        rewriter = _Rewriter(function, code.co_filename)
        definition.body = rewriter.body(definition.body)
    if reports_event(function):
        definition.args.args.append(ast.arg(EVENT))
        none = ast.Assign([_event_place()], ast.Constant(False))
        definition.body.insert(0, ast.copy_location(none, definition.body[0]))
    definition.decorator_list, definition.returns = [], None
    for argument in definition.args.args:
        argument.annotation = None
    return definition


EVENT = "event_"
"""Name of the argument by which a block's step requests a call of Python after it."""


def reports_event(function: Any) -> bool:
    """Return whether a kernel is a block's step that returns whether ``on_event`` is to be
    called."""
    returns = function.__annotations__.get("return")
    return hasattr(function, "declared_kinds") and returns in ("bool", bool)


def _event_place() -> ast.expr:
    return ast.Subscript(ast.Name(EVENT, ast.Load()), ast.Constant(0), ast.Store())


class _Rewriter(Expressions):
    """Rewrites the statements of one function, from the first to the last."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._count = 0
        self._products: set[str] = set()
        """Names of cross products, whose elements are numbers: ``cross_1__0`` and so on."""
        self._ahead: list[ast.stmt] | None = []
        """Statements to put in front of the present one; None where none can be put there."""

    # Statements

    def body(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Rewrite some statements that follow each other."""
        made: list[ast.stmt] = []
        for statement in statements:
            outer, self._ahead = self._ahead, []
            rewritten = self._statement(statement)
            made += [*self._ahead, *rewritten]
            self._ahead = outer
        return made

    def _statement(self, node: ast.stmt) -> list[ast.stmt]:
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            return self._assign(node, node.targets[0])
        if isinstance(node, ast.AugAssign):
            return self._augment(node)
        if isinstance(node, ast.For):
            node.iter = self._expression(node.iter)
            self._note(node.target, NUMBER)
            node.body, node.orelse = self.body(node.body), self.body(node.orelse)
            return [node]
        if isinstance(node, ast.While):
            self._ahead = None
            node.test = self._expression(node.test)
            self._ahead = []
            node.body, node.orelse = self.body(node.body), self.body(node.orelse)
            return [node]
        if isinstance(node, ast.If):
            node.test = self._expression(node.test)
            node.body, node.orelse = self.body(node.body), self.body(node.orelse)
            return [node]
        if isinstance(node, ast.Return | ast.Expr):
            if node.value is not None:
                node.value = self._expression(node.value)
            if isinstance(node, ast.Return) and node.value and reports_event(self._function):
                written = ast.Assign([_event_place()], node.value)
                node.value = None
                return [ast.copy_location(written, node), node]
            return [node]
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            plain = ast.copy_location(ast.Assign([node.target], node.value), node)
            return self._assign(plain, node.target)
        for field, value in ast.iter_fields(node):
            if isinstance(value, ast.expr):
                setattr(node, field, self._expression(value))
        return [node]

    def _assign(self, node: ast.Assign, target: ast.expr) -> list[ast.stmt]:
        if self._covers_elements(target):
            return self._loops(node, target, node.value)
        value = node.value
        if (
            isinstance(target, ast.Tuple)
            and isinstance(value, ast.Tuple)
            and len(target.elts) == len(value.elts)
        ):
            if any(self._covers_elements(each) for each in target.elts):
                raise self._error(node, "assign one array in a statement")
            for name, each in zip(target.elts, value.elts, strict=True):
                self._note(name, self._kind(each))
            value.elts = [self._reference(each) for each in value.elts]
            target.elts = [self._target(each) for each in target.elts]
            return [node]
        self._note(target, self._kind(value))
        node.value = (
            self._reference(value) if isinstance(target, ast.Name) else self._expression(value)
        )
        node.targets = [self._target(target)]
        return [node]

    def _augment(self, node: ast.AugAssign) -> list[ast.stmt]:
        if self._covers_elements(node.target):
            left = copy.deepcopy(node.target)
            sum_ = ast.copy_location(ast.BinOp(_loaded(left), node.op, node.value), node)
            return self._loops(node, node.target, sum_)
        node.value = self._expression(node.value)
        element = self._element_type(node.target)
        if element is not None and not isinstance(node.target, ast.Name):
            read = self._expression(_loaded(copy.deepcopy(node.target)))
            value = ast.BinOp(read, node.op, node.value)
            plain: ast.stmt = ast.Assign([self._target(node.target)], value)
            return [ast.copy_location(plain, node)]
        node.target = self._target(node.target)  # type: ignore[assignment]  # stays a target
        return [node]

    def _note(self, target: ast.expr, kind: Kind) -> None:
        if isinstance(target, ast.Name):
            self._kinds[target.id] = kind
        elif isinstance(target, ast.Tuple):
            for each in target.elts:
                self._note(each, NUMBER)

    def _target(self, node: ast.expr) -> ast.expr:
        """Rewrite the place that a statement writes one number to."""
        kind = self._kind(node) if isinstance(node, ast.Attribute) else None
        if isinstance(kind, ArrayKind) and kind.rank == 0:
            loaded = _loaded(node)
            return ast.copy_location(
                ast.Subscript(loaded, ast.Tuple([], ast.Load()), ast.Store()), node
            )
        if isinstance(node, ast.Subscript):
            node.slice = self._expression(node.slice)
            node.value = self._inside(node.value)
        return node

    # Expressions that are one number, or are handed on

    def _expression(self, node: ast.expr) -> ast.expr:
        """Rewrite an expression whose value is a number."""
        if isinstance(node, ast.Attribute):
            number = self._member(node)
            if number is not None:
                return number
        element = self._element_type(node)
        if element is not None:
            return self._read(node, element)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            if isinstance(self._kind(node), NumberKind):
                return self._sum(node, [])
            raise self._error(node, "a product with @ is an array: assign it, as in out[:] = R @ v")
        if isinstance(node, ast.Compare):
            self._replace_words(node)
        if isinstance(node, ast.Call):
            return self._call(node)
        if isinstance(node, ast.Slice):
            for part in ("lower", "upper", "step"):
                if getattr(node, part) is not None:
                    setattr(node, part, self._expression(getattr(node, part)))
            return node
        if isinstance(node, ast.Name | ast.Constant):
            return node
        if isinstance(node, ast.Attribute | ast.Subscript):
            return self._inside(node)
        return self._children(node, self._expression)

    def _children(self, node: ast.expr, visit: Callable[[ast.expr], ast.expr]) -> ast.expr:
        for field, value in ast.iter_fields(node):
            if isinstance(value, ast.expr):
                setattr(node, field, visit(value))
            elif isinstance(value, list):
                setattr(node, field, [visit(v) if isinstance(v, ast.expr) else v for v in value])
        return node

    def _reference(self, node: ast.expr) -> ast.expr:
        """Rewrite an expression that may be an array, which is handed on as it is."""
        kind = self._kind(node)
        if isinstance(kind, ArrayKind | RecordKind) and isinstance(
            node, ast.Attribute | ast.Subscript | ast.Name
        ):
            if isinstance(kind, ArrayKind) and kind.rank == 0:
                return self._expression(node)
            return self._inside(node)
        if isinstance(kind, ArrayKind) and kind.rank and not isinstance(node, ast.IfExp):
            raise self._error(
                node, "this makes a new array: assign it into one, as in scratch.x[:] = ..."
            )
        return self._expression(node)

    def _inside(self, node: ast.expr) -> ast.expr:
        """Rewrite the array that a part is taken of: only its indices are numbers."""
        if isinstance(node, ast.Attribute):
            node.value = self._inside(node.value)
        elif isinstance(node, ast.Subscript):
            node.slice = self._expression(node.slice)
            node.value = self._inside(node.value)
        return node

    def _call(self, node: ast.Call) -> ast.expr:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name in ("float", "int", "bool") and len(node.args) == 1:
            element = self._element_type(node.args[0])
            if element is not None:
                read = self._read(node.args[0], element)
                return read if element.__name__ == name else _called(name, read, node)
        function = self._scope.get(name)
        kinds: list[Kind] = [NUMBER] * len(node.args)
        if (
            function is not None
            and hasattr(function, "__annotations__")
            and not isinstance(function, type)
        ) and is_kernel(function):
            kinds = list(argument_kinds(function).values())
        node.args = [
            self._argument(each, kind)
            for each, kind in zip(node.args, [*kinds, *[NUMBER] * len(node.args)], strict=False)
        ]
        return node

    def _argument(self, node: ast.expr, wanted: Kind) -> ast.expr:
        """Rewrite an argument of a call; a kernel may take a scalar field as the array that it
        is."""
        kind = self._kind(node)
        if isinstance(kind, ArrayKind) and kind.rank == 0 and not isinstance(wanted, NumberKind):
            return self._inside(node)
        return self._reference(node)

    def _read(self, node: ast.expr, element: type) -> ast.expr:
        """Read the number in an element or in a scalar field."""
        if isinstance(node, ast.Attribute):
            inner: ast.expr = ast.Subscript(
                self._inside(node), ast.Tuple([], ast.Load()), ast.Load()
            )
            ast.copy_location(inner, node)
        else:
            inner = self._inside(node)
        return inner if element is bool else _called(element.__name__, inner, node)

    def _member(self, node: ast.Attribute) -> ast.expr | None:
        """Return the number of a member of an enumeration, such as ``Phase.FLIGHT``."""
        owner = node.value
        if isinstance(owner, ast.Name) and owner.id not in self._kinds:
            found = self._scope.get(owner.id)
            if isinstance(found, type) and issubclass(found, IntEnum):
                if node.attr not in found.__members__:
                    known = ", ".join(found.__members__)
                    raise self._error(node, f"{found.__name__} has no {node.attr}; it has {known}")
                return ast.copy_location(ast.Constant(int(found[node.attr])), node)
        return None

    def _replace_words(self, node: ast.Compare) -> None:
        """``params.law == "paper"``: a word among those that a parameter may have is its place."""
        sides = [node.left, *node.comparators]
        words = [
            kind.words
            for side in sides
            if isinstance(kind := self._kind(side), ArrayKind) and kind.words
        ]
        if not words:
            return
        for side in sides:
            for each in ast.walk(side):
                if isinstance(each, ast.Constant) and isinstance(each.value, str):
                    if each.value not in words[0]:
                        raise self._error(
                            each, f"{each.value!r} is not one of {', '.join(words[0])}"
                        )
                    each.value = words[0].index(each.value)

    # Equations on arrays

    def _loops(self, node: ast.stmt, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        """Write the loops for ``target = value``, where the target is a part of an array."""
        assert isinstance(target, ast.Subscript)
        kind = self._kind(target)
        assert isinstance(kind, ArrayKind)
        self._check_shapes(node, kind, value)
        self._check_overlap(node, target, value)
        unrolled = any(
            isinstance(each, ast.Call) and self._is_cross(each) for each in ast.walk(value)
        )
        if unrolled:
            value = self._with_cross_products(value)
        sizes = self._sizes(target)
        if unrolled:
            return [
                ast.copy_location(self._element_statement(target, value, [ast.Constant(k)]), node)
                for k in range(3)
            ]  # fmt: skip
        variables = [self._name("i") for _ in sizes]
        places: list[ast.expr] = [ast.Name(v, ast.Load()) for v in variables]
        outer, self._ahead = self._ahead, []
        inner: ast.stmt = self._element_statement(target, value, places)
        body = [*self._ahead, inner]
        self._ahead = outer
        for variable, size in zip(reversed(variables), reversed(sizes), strict=True):
            loop = ast.For(
                ast.Name(variable, ast.Store()), _called("range", size, node), body, [], None
            )
            body = [loop]
        for statement in body:
            ast.copy_location(statement, node)
            for each in ast.walk(statement):
                if not hasattr(each, "lineno"):
                    ast.copy_location(each, node)
        return body

    def _element_statement(
        self, target: ast.expr, value: ast.expr, places: list[ast.expr]
    ) -> ast.stmt:
        written = self._part(copy.deepcopy(target), places)
        assert isinstance(written, ast.Subscript)
        written.ctx = ast.Store()
        return ast.Assign([written], self._element(copy.deepcopy(value), places))

    def _element(self, node: ast.expr, places: list[ast.expr]) -> ast.expr:
        """Return the element of an expression at some places, or the number that it is."""
        kind = self._kind(node)
        if not isinstance(kind, ArrayKind) or kind.rank == 0:
            return self._expression(node)
        if isinstance(node, ast.Name) and node.id in self._products:
            assert isinstance(places[0], ast.Constant)
            return ast.copy_location(ast.Name(f"{node.id}_{places[0].value!r}", ast.Load()), node)
        if isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
            if kind.rank < len(places):
                places = places[len(places) - kind.rank :]
            part = self._part(node, places)
            return part if kind.element is bool else _called(kind.element.__name__, part, node)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            return self._sum(node, places)
        if isinstance(node, ast.Call):
            node.args = [self._element(each, places) for each in node.args]
            return node
        return self._children(node, lambda each: self._element(each, places))

    def _part(self, node: ast.expr, places: Sequence[ast.expr]) -> ast.expr:
        """Return the element of an array, or of a part of one, at some places."""
        places = [copy.deepcopy(place) for place in places]
        if isinstance(node, ast.Attribute) and node.attr == "T":
            return self._part(node.value, places[::-1])
        indices: list[ast.expr] = []
        if isinstance(node, ast.Subscript):
            for index in indices_of(node):
                if isinstance(index, ast.Slice):
                    place = places.pop(0)
                    lower = index.lower
                    if lower is not None:
                        place = ast.BinOp(self._expression(copy.deepcopy(lower)), ast.Add(), place)
                        ast.copy_location(place, node)
                    indices.append(place)
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
            a = self._element(copy.deepcopy(node.left), [*places[:own], j])
            b = self._element(copy.deepcopy(node.right), [j, *places[own:]])
            product = ast.BinOp(a, ast.Mult(), b)
            return [*self._ahead, ast.AugAssign(ast.Name(total, ast.Store()), ast.Add(), product)]

        statements: list[ast.stmt] = [ast.Assign([ast.Name(total, ast.Store())], ast.Constant(0.0))]
        if any(isinstance(each, ast.Name) and each.id in self._products for each in ast.walk(node)):
            # a cross product is three numbers, which no index finds
            statements += [each for k in range(3) for each in term(ast.Constant(k))]
        else:
            size = self._size_of(node.left, left.rank - 1) or self._size_of(node.right, 0)
            if size is None:
                raise self._error(node, "the length of this product is not known")
            j = self._name("j")
            within = term(ast.Name(j, ast.Load()))
            called = _called("range", size, node)
            statements.append(ast.For(ast.Name(j, ast.Store()), called, within, [], None))
        self._ahead = outer
        for statement in statements:
            for each in ast.walk(statement):
                if not hasattr(each, "lineno"):
                    ast.copy_location(each, node)
            self._ahead.append(statement)
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
                            rewriter._element(copy.deepcopy(node.args[0]), [ast.Constant(i)]),
                            ast.Mult(),
                            rewriter._element(copy.deepcopy(node.args[1]), [ast.Constant(j)]),
                        )
                        for i, j in ((a, b), (b, a))
                    ]
                    difference = ast.BinOp(terms[0], ast.Sub(), terms[1])
                    made = ast.Assign([ast.Name(f"{name}_{k}", ast.Store())], difference)
                    for each in ast.walk(made):
                        if not hasattr(each, "lineno"):
                            ast.copy_location(each, node)
                    rewriter._ahead.append(made)
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
            if any(a is not None and b is not None and a != b for a, b in pairs):
                raise self._error(
                    node, f"a value of shape {kind.shape} does not fit into {target.shape}"
                )
        for each in ast.walk(value):
            if isinstance(each, ast.BinOp) and isinstance(each.op, ast.MatMult):
                left, right = self._kind(each.left), self._kind(each.right)
                for side, found in ((each.left, left), (each.right, right)):
                    if not isinstance(found, ArrayKind) or not found.rank:
                        text = "takes arrays whose dimensions are known"
                        raise self._error(each, f"@ {text}; {ast.unparse(side)} is not one")
                assert isinstance(left, ArrayKind) and isinstance(right, ArrayKind)
                sizes = left.shape[-1], right.shape[0]
                if None not in sizes and sizes[0] != sizes[1]:
                    raise self._error(
                        each, f"shapes {left.shape} and {right.shape} have no product"
                    )

    def _check_overlap(self, node: ast.stmt, target: ast.Subscript, value: ast.expr) -> None:
        """Refuse a target that the value still reads after it has been written."""
        base = _path(target)
        summed = [
            part
            for each in ast.walk(value)
            if isinstance(each, ast.BinOp) and isinstance(each.op, ast.MatMult)
            for part in ast.walk(each)
        ]
        if any(_path(each) == base for each in summed if isinstance(each, ast.expr)):
            raise self._error(node, f"{base} is written while @ still reads it; use another array")
        for each in ast.walk(value):
            if isinstance(each, ast.Subscript) and _path(each) == base:
                slices = any(isinstance(i, ast.Slice) for i in indices_of(each))
                if slices and ast.unparse(each.slice) != ast.unparse(target.slice):
                    raise self._error(node, f"{base} is written while another part of it is read")

    def _name(self, stem: str) -> str:
        self._count += 1
        return f"{stem}_{self._count}_"


def _path(node: ast.expr) -> str:
    """Return the array that an expression is, or is a part of, as text; empty where it is
    neither."""
    while isinstance(node, ast.Subscript) or (isinstance(node, ast.Attribute) and node.attr == "T"):
        node = node.value
    return ast.unparse(node) if isinstance(node, ast.Name | ast.Attribute) else ""


def _loaded(node: ast.expr) -> ast.expr:
    node.ctx = ast.Load()  # type: ignore[attr-defined]  # targets have a context
    return node


def _called(name: str, argument: ast.expr, place: ast.AST) -> ast.expr:
    call = ast.Call(ast.Name(name, ast.Load()), [argument], [])
    for each in (call, call.func):
        ast.copy_location(each, place)
    return call
