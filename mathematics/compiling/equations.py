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
import linecache
import textwrap
from collections.abc import Mapping, Sequence
from enum import IntEnum
from types import CodeType
from typing import Any

from .carried_arrays import CarriedArrays
from .expressions import cloned, indices_of, shown
from .kernel_registry import is_kernel, reports_event, written_code
from .kinds import NUMBER, ArrayKind, Kind, NumberKind, RecordKind, argument_kinds
from .slices import Cut, counters_of


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
    # its own first line: the others are counted from there
    return made.replace(co_qualname=code.co_qualname)


def expanded_definition(function: Any, code: CodeType) -> ast.FunctionDef | None:
    """Rewrite the definition of a kernel with loops in place of equations; ``None`` where there is
    no source.

    A function that has variables of another function stays as it is written.

    Raises:
        EquationError: a statement cannot be rewritten.
    """
    definition = _definition(function, code)
    if definition is None:
        return None
    if function.__closure__ is None:
        rewriter = _Rewriter(function, code.co_filename)
        definition.body = rewriter.rewritten(definition)
    if reports_event(function):
        definition.args.args.append(ast.arg(EVENT))
        none = ast.Assign([_event_place()], ast.Constant(False))
        definition.body.insert(0, ast.copy_location(none, definition.body[0]))
    definition.decorator_list, definition.returns = [], None
    for argument in definition.args.args:
        argument.annotation = None
    return definition


def check_equations(function: Any, kinds: Mapping[str, Kind]) -> None:
    """Check the equations of a kernel, and of those that it calls, for arguments of known sizes.

    Raises:
        EquationError: sizes do not fit, or an index is beyond an array.
    """
    seen: set[str] = set()
    pending = [(function, dict(kinds))]
    while pending:
        each, given = pending.pop()
        key = f"{id(each)} {given}"
        code = written_code(each)
        if key in seen or each.__closure__ is not None:
            continue
        seen.add(key)
        definition = _definition(each, code)
        if definition is not None:
            rewriter = _Rewriter(each, code.co_filename)
            rewriter.check_with(given)
            rewriter.rewritten(definition)
            pending += rewriter.calls


def _definition(function: Any, code: CodeType) -> ast.FunctionDef | None:
    """Read the definition of a function from its file; ``None`` where there is no source."""
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
    return definition


EVENT = "event_"
"""Name of the argument by which a block's step requests a call of Python after it."""


def _event_place() -> ast.expr:
    return ast.Subscript(ast.Name(EVENT, ast.Load()), ast.Constant(0), ast.Store())


class _Rewriter(CarriedArrays):
    """Rewrites the statements of one function, from the first to the last."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._count = 0
        self._products: set[str] = set()
        self._aliases: dict[str, str] = {}
        self._cuts: dict[str, Cut] = {}
        self._partial: set[str] = set()
        self._own: set[str] = set()
        self._foreign: set[str] = set()
        self._checks = False
        self.calls: list[tuple[Any, dict[str, Kind]]] = []
        """The kernels that are called, with what they get; of a check only."""
        self._ahead: list[ast.stmt] | None = []

    def check_with(self, kinds: Mapping[str, Kind]) -> None:
        """Take these kinds of the arguments, and note which kernels are called with which."""
        self._kinds.update(kinds)
        self._checks = True

    # Statements

    def rewritten(self, definition: ast.FunctionDef) -> list[ast.stmt]:
        """Rewrite the body of the function."""
        constants = {
            name
            for name in written_code(self._function).co_names
            if name not in self._locals
            and isinstance(self._scope.get(name), int)
            and self._scope[name] >= 0
        }
        self._counters = counters_of(definition) | constants
        body = self.body(definition.body)
        for statement in body:
            for each in ast.walk(statement):
                if isinstance(each, Cut):  # of a call that nothing here knows
                    text = "this slice stands where no element of it is read; assign it to a name before"
                    raise self._error(each, text)
        return body

    def body(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Rewrite some statements that follow each other."""
        made: list[ast.stmt] = []
        for statement in statements:
            outer, self._ahead, self._cuts = self._ahead, [], {}
            if self._depth:
                rewritten = self._statement(statement)
            else:
                before, self._before_loop = self._before_loop, []
                rewritten = self._statement(statement)
                made += self._before_loop
                self._before_loop = before
            made += [*self._ahead, *rewritten]
            self._ahead = outer
        return made

    def _statement(self, node: ast.stmt) -> list[ast.stmt]:
        if isinstance(node, ast.For | ast.While) and not self._depth:
            self._look_through_loop(node)
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            node = ast.copy_location(ast.Assign([node.target], node.value), node)
        if isinstance(node, ast.Assign) and self._depth:
            self._keep_what_is_carried(node)
        if isinstance(node, ast.While):
            self._ahead = None
            node.test = self._expression(self._canonical(node.test))
            self._ahead = []
            self._depth += 1
            node.body, node.orelse = self.body(node.body), self.body(node.orelse)
            self._depth -= 1
            return [node]
        kept = cloned(node) if isinstance(node, ast.Assign | ast.AugAssign | ast.Expr) else None
        for field, value in ast.iter_fields(node):
            if isinstance(value, ast.expr) and field not in ("target", "annotation"):
                setattr(node, field, self._canonical(value))
        if isinstance(node, ast.Assign) and len(node.targets) > 1:
            return self._assign_in_turn(node)
        if isinstance(node, ast.Assign):
            self._write_out(node)
            if kept is not None and self._is_foreign(
                node.targets[0], node.value, isinstance(node.targets[0], ast.Subscript)
            ):
                return [kept]
            return self._assign(node, node.targets[0])
        if isinstance(node, ast.AugAssign):
            if kept is not None and self._is_foreign(node.target, node.value, True):
                return [kept]
            return self._augment(node)
        if isinstance(node, ast.For):
            return self._for(node)
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
        for field, value in ast.iter_fields(node):
            if isinstance(value, ast.expr):
                setattr(node, field, self._expression(value))
        for each in ast.walk(
            node
        ):  # what is not compiled runs in plain Python, which must be right, too
            for name in ("body", "orelse", "finalbody"):
                inner = getattr(each, name, None)
                if (
                    isinstance(inner, list)
                    and each is not node
                    and isinstance(each, ast.ExceptHandler | ast.match_case)
                ):
                    setattr(each, name, self.body(inner))
        if isinstance(node, ast.Try | ast.With):
            node.body = self.body(node.body)
        if isinstance(node, ast.Try):
            node.orelse, node.finalbody = self.body(node.orelse), self.body(node.finalbody)
        return [node]

    def _assign_in_turn(self, node: ast.Assign) -> list[ast.stmt]:
        """Write ``a = b = value``, the targets one after the other."""
        made: list[ast.stmt] = []
        value = node.value
        if not isinstance(value, ast.Name | ast.Constant | ast.Attribute):
            if self._is_array(value):
                value = self._new_array(value)
            else:
                value = self._kept("number", self._expression(value), node)
        for target in node.targets:
            plain = ast.copy_location(ast.Assign([target], cloned(value)), node)
            made += self._assign(plain, target)
        return made

    def _assign(self, node: ast.Assign, target: ast.expr) -> list[ast.stmt]:
        mask = self._mask_of(target)
        if mask is not None:
            assert isinstance(target, ast.Subscript)
            return self._masked(node, target, self._canonical(mask), node.value)
        if self._covers_elements(target):
            return self._loops(node, target, node.value)
        value = node.value
        if isinstance(target, ast.Subscript) and self._is_array(target):
            # A[0] = ... writes a row
            kind = self._kind(target)
            assert isinstance(kind, ArrayKind)
            whole = ast.Tuple([*indices_of(target), *[ast.Slice() for _ in kind.shape]], ast.Load())
            return self._loops(
                node,
                ast.copy_location(ast.Subscript(target.value, whole, ast.Store()), node),
                value,
            )
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
        if isinstance(target, ast.Name):
            self._note_alias(node, target.id, value)
        self._note(target, self._kind(value))
        node.value = (
            self._reference(value) if isinstance(target, ast.Name) else self._expression(value)
        )
        node.targets = [self._target(target)]
        return [node]

    def _augment(self, node: ast.AugAssign) -> list[ast.stmt]:
        mask = self._mask_of(node.target)
        if mask is not None:
            assert isinstance(node.target, ast.Subscript)
            mask = self._canonical(mask)
            sum_ = ast.copy_location(
                ast.BinOp(_loaded(cloned(node.target)), node.op, node.value), node
            )
            return self._masked(node, node.target, mask, sum_)
        if isinstance(node.target, ast.Name | ast.Attribute | ast.Subscript) and self._is_array(
            node.target
        ):
            kind, target = self._kind(node.target), node.target
            assert isinstance(kind, ArrayKind)
            if isinstance(node.value, ast.List | ast.Tuple):
                node.value = self._made_array(
                    ast.copy_location(ast.Call(target, [node.value], []), node)
                )
            if not self._covers_elements(target):  # x += 1.0 of a whole array
                own = indices_of(target) if isinstance(target, ast.Subscript) else []
                base = target.value if isinstance(target, ast.Subscript) else _loaded(target)
                whole = ast.Tuple([*own, *[ast.Slice() for _ in kind.shape]], ast.Load())
                target = ast.copy_location(ast.Subscript(base, whole, ast.Store()), node)
            left = cloned(target)
            sum_ = ast.copy_location(ast.BinOp(_loaded(left), node.op, node.value), node)
            return self._loops(node, target, sum_)
        node.value = self._expression(node.value)
        element = self._element_type(node.target)
        if element is not None and not isinstance(node.target, ast.Name):
            read = self._expression(_loaded(cloned(node.target)))
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
            return self._inside(node)
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
                node = self._without_cross(node)
                assert isinstance(node, ast.BinOp)
                self._demand_product(node, [])
                return self._sum(node, [])
            raise self._error(node, "a product with @ is an array: assign it, as in out[:] = R @ v")
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            self._children(node, self._expression)
            return self._power(node)
        if isinstance(node, ast.NamedExpr):
            self._note(node.target, self._kind(node.value))
            node.value = self._expression(node.value)
            return node
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

    def _reference(self, node: ast.expr) -> ast.expr:
        """Rewrite an expression that may be an array, which is handed on as it is."""
        kind = self._kind(node)
        if isinstance(kind, ArrayKind | RecordKind) and isinstance(
            node, ast.Attribute | ast.Subscript | ast.Name
        ):
            if isinstance(kind, ArrayKind) and kind.rank == 0:
                return self._expression(node)
            return self._inside(node)
        if isinstance(kind, ArrayKind) and kind.rank and not self._chooses(node):
            return self._new_array(node)
        return self._expression(node)

    def _inside(self, node: ast.expr) -> ast.expr:
        """Rewrite the array that a part is taken of: only its indices are numbers."""
        if isinstance(node, ast.Attribute):
            node.value = self._inside(node.value)
        elif isinstance(node, ast.Subscript):
            self._kind(node)  # refuses an index beyond the array
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
            node.args = self._by_position(node, function)
            node.keywords = []
            if self._checks:
                self._note_call(node, function)
        node.args = [
            self._argument(each, kind)
            for each, kind in zip(node.args, [*kinds, *[NUMBER] * len(node.args)], strict=False)
        ]
        return node

    def _note_call(self, node: ast.Call, function: Any) -> None:
        """Note what a kernel gets, where its own declarations are no wiser."""
        kinds: dict[str, Kind] = {}
        for (name, declared), each in zip(
            argument_kinds(function).items(), node.args, strict=False
        ):
            given = self._kind(each)
            if isinstance(declared, ArrayKind) and isinstance(given, ArrayKind):
                if declared.rank != given.rank and given.rank:
                    text = f"{function.__qualname__} takes {name} of {declared.rank} dimensions, and gets {given.rank}"
                    raise self._error(node, text)
                pairs = zip(declared.shape, given.shape, strict=False)
                for size, found in pairs:
                    if None not in (size, found) and size != found:
                        text = f"{function.__qualname__} takes {name} of shape {shown(declared.shape)}, and gets {shown(given.shape)}"
                        raise self._error(node, text)
                if declared.rank == given.rank:
                    shape = tuple(
                        found if size is None else size
                        for size, found in zip(declared.shape, given.shape, strict=True)
                    )
                    kinds[name] = declared._replace(shape=shape)
            elif isinstance(declared, RecordKind) and isinstance(given, RecordKind):
                kinds[name] = given
        self.calls.append((function, kinds))

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

    def _name(self, stem: str) -> str:
        self._count += 1
        return f"{stem}_{self._count}_"


def _loaded(node: ast.expr) -> ast.expr:
    node.ctx = ast.Load()  # type: ignore[attr-defined]  # targets have a context
    return node


def _called(name: str, argument: ast.expr, place: ast.AST) -> ast.expr:
    call = ast.Call(ast.Name(name, ast.Load()), [argument], [])
    for each in (call, call.func):
        ast.copy_location(each, place)
    return call
