"""Translates the statements of one kernel, for arguments of given types, into LLVM's language.

A variable has one type in the whole function, the widest of all that is assigned to it; a function is
translated again until no type grows.
"""

from __future__ import annotations

import ast
import types as python_types
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, NoReturn

import numpy as np

from .arguments import ArgumentType, NumberType, RecordType
from .known_functions import ELEMENTWISE, FUNCTIONS, apply, write_elements, write_product
from .llvm_code import (
    BOOL,
    INT,
    NOTHING,
    Code,
    Refused,
    Slice,
    Value,
    join,
    leaves,
    number,
    tuple_of,
)


class CompileError(Exception):
    """A kernel cannot be compiled; the text says which, where and why."""


class Translated(NamedTuple):
    """A function in LLVM's language.

    Attributes:
        name: by which others call it.
        text: its definition.
        returns: the type of its result.
        fails: whether it can report a division by zero.
        callees: the functions of this kind that it calls, by name.
        declared: the declarations of other functions that it calls, by name.
    """

    name: str
    text: str
    returns: ArgumentType
    fails: bool
    callees: dict[str, Translated]
    declared: dict[str, str]


Callee = Callable[[Any, tuple[ArgumentType, ...]], Translated | None]
"""Gives another kernel translated for arguments of these types; none where it is no kernel."""
_MOST_PASSES = 12


def translate(
    function: Any,
    tree: ast.FunctionDef,
    signature: tuple[ArgumentType, ...],
    name: str,
    callee: Callee,
) -> Translated:
    """A kernel in LLVM's language.

    Args:
        function: the kernel; its module has the names that it reads.
        tree: its definition, with loops in place of equations.
        signature: the types of its arguments.
        name: of the made function.
        callee: gives the kernels that it calls.

    Raises:
        CompileError: the kernel does what compiled code cannot.
    """
    types: dict[str, ArgumentType] = {}
    signed: set[str] = set()
    for _ in range(_MOST_PASSES):
        attempt = _Function(function, tree, signature, callee, types, signed)
        made = attempt.translated(name)
        if not attempt.grown:
            return made
    raise CompileError(f"kernel {name}: the types of its variables never settle")


class _Function:
    """One pass through a function with the types that are known from the passes before."""

    def __init__(
        self,
        function: Any,
        tree: ast.FunctionDef,
        signature: tuple[ArgumentType, ...],
        callee: Callee,
        types: dict[str, ArgumentType],
        signed: set[str],
    ) -> None:
        self.grown = False
        self._function = function
        self._tree = tree
        self._signature = signature
        self._callee = callee
        self._types = types
        self._signed = signed
        self._code = Code()
        self._rooms: dict[str, tuple[str, ...]] = {}
        self._callees: dict[str, Translated] = {}
        self._loops: list[tuple[str, str]] = []
        self._scope = function.__globals__
        self._closed = dict(
            zip(function.__code__.co_freevars, function.__closure__ or (), strict=False)
        )
        self._fixed: dict[str, Value] = {}
        """Arguments to which nothing is assigned."""
        self._assigned = {
            n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
        }
        self._local = self._assigned | {each.arg for each in tree.args.args}
        self._only_counters = _only_counters(tree)

    def translated(self, name: str) -> Translated:
        """The function as it is after this pass."""
        code = self._code
        names = [each.arg for each in self._tree.args.args]
        if len(names) != len(self._signature):
            self._refuse(
                self._tree, f"takes {len(names)} arguments, and gets {len(self._signature)}"
            )
        parameters: list[str] = []
        for argument, kind in zip(names, self._signature, strict=True):
            parts = tuple(f"%a{len(parameters) + k}" for k in range(len(leaves(kind))))
            parameters += [f"{leaf} {part}" for leaf, part in zip(leaves(kind), parts, strict=True)]
            if argument in self._assigned:
                self._assign_name(argument, Value(kind, parts))
            else:
                self._fixed[argument] = Value(kind, parts)
        self._statements(self._tree.body)
        code.write("ret i32 0")
        returns = self._types.get(_RESULT, NOTHING.type)
        parameters += [f"ptr %r{k}" for k in range(len(leaves(returns)))]
        lines = [f'define internal i32 @"{name}"({", ".join(parameters)}) #0 {{', "entry:"]
        lines += [*code.entry, *code.lines]
        lines += ["fail:", "  ret i32 1"] if code.fails else []
        lines += ["}"]
        text = "\n".join(lines)
        return Translated(name, text, returns, code.fails, self._callees, code.declared)

    # Statements

    def _statements(self, nodes: Sequence[ast.stmt]) -> None:
        for node in nodes:
            if not self._code.reachable:
                return
            with self._placed(node):
                self._statement(node)

    def _statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Assign():
                value = self._value(node.value)
                for target in node.targets:
                    self._assign(target, value)
            case ast.AnnAssign(value=None):
                pass
            case ast.AnnAssign():
                assert node.value is not None
                self._assign(node.target, self._value(node.value))
            case ast.AugAssign():
                self._augment(node)
            case ast.If():
                self._if(node)
            case ast.For():
                self._for(node)
            case ast.While():
                self._while(node)
            case ast.Return():
                self._return(node)
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                pass
            case ast.Expr():
                self._value(node.value)
            case ast.Continue():
                self._code.jump(self._loops[-1][0])
            case ast.Break():
                self._code.jump(self._loops[-1][1])
            case _:
                raise Refused(f"compiled kernels have no {type(node).__name__.lower()}")

    def _assign(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._assign_name(target.id, value)
        elif isinstance(target, ast.Tuple):
            members = value.members
            if len(members) != len(target.elts):
                raise Refused(f"{len(members)} values for {len(target.elts)} names")
            for each, part in zip(target.elts, members, strict=True):
                self._assign(each, part)
        elif isinstance(target, ast.Subscript):
            self._write(*self._target(target), value)
        else:
            raise Refused(f"{ast.unparse(target)} cannot be assigned")

    def _assign_name(self, name: str, value: Value) -> None:
        if value.type == NOTHING.type:
            raise Refused(f"{name} would be None")
        known = self._types.get(name)
        widest = value.type if known is None else join(known, value.type)
        if known is None:
            self._types[name] = widest
        elif widest != known:
            self._types[name] = widest
            self.grown = True
            return
        if name not in self._rooms:
            self._rooms[name] = self._code.variable(widest)
        self._code.store(self._code.convert(value, widest), self._rooms[name])

    def _target(self, node: ast.Subscript) -> tuple[Value, str | None]:
        """A part of an array, or the array and the address of one element of it."""
        whole, indices = self._value(node.value), self._indices(node)
        numbers = [index for index in indices if isinstance(index, Value)]
        if len(numbers) == len(indices) == whole.array.dimensions:
            return whole, self._code.place(whole, numbers)
        return self._code.view(whole, indices), None

    def _write(self, part: Value, place: str | None, value: Value) -> None:
        if place is not None:
            self._code.assign(part.array, place, value)
        else:
            apply(self._code, part, [value], lambda code, values: values[0])

    def _augment(self, node: ast.AugAssign) -> None:
        code, name = self._code, type(node.op).__name__
        if isinstance(node.target, ast.Subscript):
            part, place = self._target(node.target)
            value = self._value(node.value)
            if place is not None:
                read = code.read(part.array, place)
                code.assign(part.array, place, code.operation(name, read, value))
                return
        elif isinstance(node.target, ast.Name):
            part, value = self._read_name(node.target.id), self._value(node.value)
            if isinstance(part.type, NumberType):
                self._assign_name(node.target.id, code.operation(name, part, value))
                return
        else:
            raise Refused(f"{ast.unparse(node.target)} cannot be assigned")
        apply(code, part, [part, value], lambda code, values: code.operation(name, *values))

    def _if(self, node: ast.If) -> None:
        code = self._code
        yes, no, end = code.name("then"), code.name("else"), code.name("end")
        self._condition(node.test, yes, no)
        ends = False
        for label, body in ((yes, node.body), (no, node.orelse)):
            code.label(label)
            self._statements(body)
            if code.reachable:
                ends = True
                code.jump(end)
        if ends:
            code.label(end)

    def _for(self, node: ast.For) -> None:
        code = self._code
        start, stop, step = self._range(node.iter)
        upward = step.constant is not None and step.constant > 0
        last = stop.constant if stop.constant is not None else -1 if stop.counts else -2
        counts = start.counts if upward else step.constant is not None and last >= -1
        if isinstance(node.target, ast.Name) and not counts and node.target.id not in self._signed:
            self._signed.add(node.target.id)
            self.grown = True
        counter = code.variable(INT)
        code.store(start, counter)
        head, body, after = code.name("head"), code.name("body"), code.name("next")
        otherwise, end = code.name("else"), code.name("end")
        code.label(head)
        place = Value(INT, code.load(INT, counter).parts, counts=counts)
        more = code.compare("Lt", place, stop)
        if not upward:
            less = code.compare("Gt", place, stop)
            positive = code.compare("Gt", step, number(0))
            more = less if step.constant is not None else code.select(positive, more, less)
        code.branch(more, body, otherwise)
        code.label(body)
        self._assign(node.target, place)
        self._loops.append((after, end))
        self._statements(node.body)
        self._loops.pop()
        code.label(after)
        code.store(code.operation("Add", place, step), counter)
        code.jump(head)
        code.label(otherwise)
        self._statements(node.orelse)
        code.label(end)

    def _range(self, node: ast.expr) -> tuple[Value, Value, Value]:
        if not (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id == "range"
            and 1 <= len(node.args) <= 3
        ):
            raise Refused("a loop goes over range(...)")
        values = [self._value(each) for each in node.args]
        if any(value.kind == "float" for value in values):
            raise Refused("range takes whole numbers")
        if len(values) == 1:
            values.insert(0, number(0))
        start, stop, *step = values
        if step and step[0].constant == 0:
            raise Refused("range() with a step of zero")
        return start, stop, step[0] if step else number(1)

    def _while(self, node: ast.While) -> None:
        code = self._code
        head, body = code.name("head"), code.name("body")
        otherwise, end = code.name("else"), code.name("end")
        code.label(head)
        self._condition(node.test, body, otherwise)
        code.label(body)
        self._loops.append((head, end))
        self._statements(node.body)
        self._loops.pop()
        if code.reachable:
            code.jump(head)
        code.label(otherwise)
        self._statements(node.orelse)
        code.label(end)

    def _return(self, node: ast.Return) -> None:
        value = NOTHING if node.value is None else self._value(node.value)
        if not all(isinstance(each, NumberType) for each in _parts(value)):
            raise Refused("a kernel returns numbers, or a tuple of numbers")
        known = self._types.get(_RESULT, value.type)
        widest = join(known, value.type)
        if self._types.get(_RESULT) != widest:
            self.grown = self.grown or _RESULT in self._types
            self._types[_RESULT] = widest
        places = tuple(f"%r{k}" for k in range(len(leaves(widest))))
        self._code.store(self._code.convert(value, widest), places)
        self._code.write("ret i32 0")
        self._code.reachable = False

    # Expressions

    def _value(self, node: ast.expr) -> Value:
        with self._placed(node):
            return self._expression(node)

    def _expression(self, node: ast.expr) -> Value:
        code = self._code
        match node:
            case ast.Constant():
                return self._constant(node.value)
            case ast.Name() if node.id in self._local:
                return self._read_name(node.id)
            case ast.Name():
                return self._constant(self._outer(node))
            case ast.Attribute():
                return self._attribute(node)
            case ast.Subscript():
                return self._subscript(node)
            case ast.Tuple():
                return tuple_of([self._value(each) for each in node.elts])
            case ast.BinOp():
                a, b = self._value(node.left), self._value(node.right)
                if isinstance(node.op, ast.MatMult):
                    return write_product(code, [a, b])
                return code.operation(type(node.op).__name__, a, b)
            case ast.UnaryOp(op=ast.USub()):
                return code.negative(self._value(node.operand))
            case ast.UnaryOp(op=ast.UAdd()):
                return self._value(node.operand)
            case ast.UnaryOp(op=ast.Not()):
                return code.opposite(self._value(node.operand))
            case ast.Compare(ops=[op], comparators=[other]):
                a, b = self._value(node.left), self._value(other)
                return code.compare(type(op).__name__, a, b)
            case ast.Compare() | ast.BoolOp():
                return self._flag(node)
            case ast.IfExp():
                return self._choice(node)
            case ast.Call():
                return self._call(node)
            case _:
                raise Refused(f"compiled kernels have no {type(node).__name__.lower()}")

    def _constant(self, value: Any) -> Value:
        if isinstance(value, tuple):
            return tuple_of([self._constant(each) for each in value])
        if isinstance(value, bool | int | float | np.number | np.bool_):
            return number(value)  # type: ignore[arg-type]  # a number of NumPy is one, too
        raise Refused(f"{value!r} is no number"[:200])

    def _read_name(self, name: str) -> Value:
        if name in self._fixed:
            return self._fixed[name]
        if name not in self._rooms:
            raise Refused(f"{name} is read before it is assigned")
        value = self._code.load(self._types[name], self._rooms[name])
        counts = name in self._only_counters and name not in self._signed
        return Value(value.type, value.parts, counts=counts) if counts else value

    def _outer(self, node: ast.expr) -> Any:
        """A module, function or constant that the kernel's module has.

        Raises:
            Refused: it has none of this name, or the name is the kernel's own.
        """
        if isinstance(node, ast.Name) and node.id not in self._local:
            if node.id in self._closed:
                return self._closed[node.id].cell_contents
            builtins = self._scope.get("__builtins__", {})
            builtins = vars(builtins) if isinstance(builtins, python_types.ModuleType) else builtins
            for names in (self._scope, builtins):
                if node.id in names:
                    return names[node.id]
            raise Refused(f"there is no {node.id}")
        if isinstance(node, ast.Attribute):
            return getattr(self._outer(node.value), node.attr)
        raise Refused(f"{ast.unparse(node)} is not known")

    def _is_outer(self, node: ast.expr) -> bool:
        while isinstance(node, ast.Attribute):
            node = node.value
        return isinstance(node, ast.Name) and node.id not in self._local

    def _attribute(self, node: ast.Attribute) -> Value:
        if self._is_outer(node):
            return self._constant(self._outer(node))
        whole, code = self._value(node.value), self._code
        if isinstance(whole.type, RecordType):
            names = getattr(whole.type.kind, "_fields", ())
            if node.attr not in names:
                raise Refused(f"there is no {node.attr}; there is {', '.join(names)}")
            return whole.members[names.index(node.attr)]
        if node.attr == "shape":
            return tuple_of([code.size(whole, k) for k in range(whole.array.dimensions)])
        if node.attr == "T":
            return code.transposed(whole)
        if node.attr == "ndim":
            return number(whole.array.dimensions)
        if node.attr == "size":
            total = number(1)
            for k in range(whole.array.dimensions):
                total = code.operation("Mult", total, code.size(whole, k))
            return total
        raise Refused(f"an array has no {node.attr} in a kernel")

    def _subscript(self, node: ast.Subscript) -> Value:
        whole = self._value(node.value)
        indices = self._indices(node)
        if isinstance(whole.type, RecordType):
            (index,) = indices
            if not isinstance(index, Value) or not isinstance(index.constant, int):
                raise Refused("the place in a tuple is a constant")
            member = whole.members[index.constant]
            is_size = isinstance(node.value, ast.Attribute) and node.value.attr == "shape"
            return Value(member.type, member.parts, counts=is_size)
        numbers = [index for index in indices if isinstance(index, Value)]
        if len(numbers) == len(indices) == whole.array.dimensions:
            return self._code.element(whole, numbers)
        return self._code.view(whole, indices)

    def _indices(self, node: ast.Subscript) -> list[Value | Slice]:
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        made: list[Value | Slice] = []
        for part in parts:
            if not isinstance(part, ast.Slice):
                made.append(self._value(part))
                continue
            if part.step is not None:
                raise Refused("a slice has no step in a kernel")
            bounds = (
                None if each is None else self._value(each) for each in (part.lower, part.upper)
            )
            made.append(Slice(*bounds))
        return made

    def _condition(self, node: ast.expr, yes: str, no: str) -> None:
        """Go to one of two places, and evaluate no more than Python does."""
        code = self._code
        match node:
            case ast.BoolOp():
                for each in node.values[:-1]:
                    onward = code.name("test")
                    both = isinstance(node.op, ast.And)
                    self._condition(each, onward if both else yes, no if both else onward)
                    code.label(onward)
                self._condition(node.values[-1], yes, no)
            case ast.UnaryOp(op=ast.Not()):
                self._condition(node.operand, no, yes)
            case ast.Compare(ops=[_, _, *_]):
                left = self._value(node.left)
                for k, (op, other) in enumerate(zip(node.ops, node.comparators, strict=True)):
                    right = self._value(other)
                    last = k + 1 == len(node.ops)
                    onward = yes if last else code.name("test")
                    code.branch(code.compare(type(op).__name__, left, right), onward, no)
                    if not last:
                        code.label(onward)
                    left = right
            case _:
                code.branch(code.truth(self._value(node)), yes, no)

    def _flag(self, node: ast.expr) -> Value:
        """The value of a condition of several parts."""
        if isinstance(node, ast.BoolOp):
            for each in node.values:
                if not _is_flag(each) and self._kind_of(each) != BOOL:
                    raise Refused("'and' and 'or' combine conditions; compare the number with one")
        code = self._code
        room = code.variable(BOOL)
        yes, no, end = code.name("then"), code.name("else"), code.name("end")
        self._condition(node, yes, no)
        for label, value in ((yes, True), (no, False)):
            code.label(label)
            code.store(number(value), room)
            code.jump(end)
        code.label(end)
        return code.load(BOOL, room)

    def _kind_of(self, node: ast.expr) -> ArgumentType:
        """The type of an expression, of which nothing is written."""
        kept = len(self._code.lines), len(self._code.entry), self._code.reachable
        kind = self._value(node).type
        del self._code.lines[kept[0] :], self._code.entry[kept[1] :]
        self._code.reachable = kept[2]
        return kind

    def _choice(self, node: ast.IfExp) -> Value:
        code = self._code
        yes, no, end = code.name("then"), code.name("else"), code.name("end")
        kind = join(self._kind_of(node.body), self._kind_of(node.orelse))
        room = code.variable(kind)
        self._condition(node.test, yes, no)
        for label, each in ((yes, node.body), (no, node.orelse)):
            code.label(label)
            code.store(code.convert(self._value(each), kind), room)
            code.jump(end)
        code.label(end)
        return code.load(kind, room)

    def _call(self, node: ast.Call) -> Value:
        if node.keywords or any(isinstance(each, ast.Starred) for each in node.args):
            raise Refused("a kernel passes arguments by position")
        if not self._is_outer(node.func):
            raise Refused(f"{ast.unparse(node.func)} is {_NOT_CALLED}")
        function = self._outer(node.func)
        arguments = [self._value(each) for each in node.args]
        if function in FUNCTIONS:
            return FUNCTIONS[function](self._code, arguments)
        if function in ELEMENTWISE:
            return write_elements(self._code, function, arguments)
        if function is np.dot:
            return write_product(self._code, arguments)
        if isinstance(function, type) and issubclass(function, tuple):
            kind = RecordType(function, tuple(each.type for each in arguments))
            return Value(kind, tuple(part for each in arguments for part in each.parts))
        made = self._callee(function, tuple(each.type for each in arguments))
        if made is None:
            raise Refused(f"{ast.unparse(node.func)} is {_NOT_CALLED}")
        return self._call_kernel(made, arguments)

    def _call_kernel(self, made: Translated, arguments: Sequence[Value]) -> Value:
        code = self._code
        self._callees[made.name] = made
        results = code.variable(made.returns)
        operands = [
            f"{leaf} {part}"
            for each in arguments
            for leaf, part in zip(leaves(each.type), each.parts, strict=True)
        ]
        operands += [f"ptr {place}" for place in results]
        status = code.result(f'call i32 @"{made.name}"({", ".join(operands)})')
        if made.fails:
            code.fail_if(code.result(f"icmp ne i32 {status}, 0"))
        return code.load(made.returns, results) if results else NOTHING

    # Places in the source

    @contextmanager
    def _placed(self, node: ast.stmt | ast.expr) -> Iterator[None]:
        try:
            yield
        except Refused as error:
            self._refuse(node, str(error))

    def _refuse(self, node: ast.AST, text: str) -> NoReturn:
        file, line = self._function.__code__.co_filename, getattr(node, "lineno", 0)
        name = f"{self._function.__module__}.{self._function.__qualname__}"
        raise CompileError(f"kernel {name} does not compile: {file}:{line}: {text}")


_NOT_CALLED = "no kernel, and nothing that kernels may call"
_RESULT = "<result>"
"""The name under which the type of a function's result stands among those of its variables."""


def _parts(value: Value) -> list[ArgumentType]:
    kind = value.type
    return list(kind.parts) if isinstance(kind, RecordType) else [kind]


def _is_flag(node: ast.expr) -> bool:
    """Whether an expression is a flag by its form."""
    return isinstance(node, ast.Compare | ast.BoolOp) or (
        isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    )


def _only_counters(tree: ast.FunctionDef) -> set[str]:
    """The names that only loops assign."""
    counted = {
        n.target.id
        for n in ast.walk(tree)
        if isinstance(n, ast.For) and isinstance(n.target, ast.Name)
    }
    targets = {
        id(n.target)
        for n in ast.walk(tree)
        if isinstance(n, ast.For) and isinstance(n.target, ast.Name)
    }
    others = {
        n.id
        for n in ast.walk(tree)
        if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store) and id(n) not in targets
    } | {each.arg for each in tree.args.args}
    return counted - others
