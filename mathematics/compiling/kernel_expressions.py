"""Translates the expressions of a kernel, for arguments of given types, into LLVM's language."""

from __future__ import annotations

import ast
import hashlib
import types as python_types
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, NoReturn

import numpy as np

from .arguments import ArgumentType, RecordType
from .array_code import SIZE_BITS, FunctionCode
from .failures import CompileError, Failure, Site
from .known_functions import ELEMENTWISE, FUNCTIONS, write_elements, write_product
from .llvm_code import (
    BOOL,
    NOTHING,
    NotCompilable,
    Slice,
    Value,
    join,
    leaves,
    number,
    tuple_of,
)


class Translated(NamedTuple):
    """A function in LLVM's language.

    Attributes:
        name: by which others call it.
        text: its definition.
        returns: the type of its result.
        fails: whether it can report a failure.
        callees: the functions of this kind that it calls, by name.
        declared: the declarations of other functions that it calls, by name.
        function: what it was made of.
        sites: where it can fail itself; a status tells which of them it was.
    """

    name: str
    text: str
    returns: ArgumentType
    fails: bool
    callees: dict[str, Translated]
    declared: dict[str, str]
    function: Any = None
    sites: tuple[Site, ...] = ()


Callee = Callable[[Any, tuple[ArgumentType, ...]], Translated | None]
"""Gives another kernel translated for arguments of these types; none where it is no kernel."""


class ExpressionTranslator:
    """Translates a function with the types of variables that are known from earlier passes.

    Attributes:
        grown: whether a type has grown in this pass.
    """

    def __init__(
        self,
        function: Any,
        tree: ast.FunctionDef,
        signature: tuple[ArgumentType, ...],
        callee: Callee,
        types: dict[str, ArgumentType],
        signed: set[str],
        bits: dict[str, int],
    ) -> None:
        self.grown = False
        self._function = function
        self._tree = tree
        self._signature = signature
        self._callee = callee
        self._types = types
        self._signed = signed
        self._bits = bits
        """The number of bits that the variables of loops may have."""
        self._code = FunctionCode(origin_of(function))
        self._rooms: dict[str, tuple[str, ...]] = {}
        self._callees: dict[str, Translated] = {}
        self._scope = function.__globals__
        self._closed = dict(
            zip(function.__code__.co_freevars, function.__closure__ or (), strict=False)
        )
        self._fixed: dict[str, Value] = {}
        """Arguments to which nothing is assigned."""
        self._assigned, self._only_counters = _assignments(tree)
        self._local = self._assigned | {each.arg for each in tree.args.args}

    def _assign_name(self, name: str, value: Value) -> None:
        """Write a variable."""
        raise NotImplementedError

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
            case ast.UnaryOp(op=ast.Invert()):
                return code.inverted(self._value(node.operand))
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
            case ast.NamedExpr():
                value = self._value(node.value)
                self._assign_name(node.target.id, value)
                return value
            case ast.Call():
                return self._call(node)
            case _:
                text = "put it into an @numba.njit function and call that"
                raise NotCompilable(
                    f"compiled kernels have no {type(node).__name__.lower()}; {text}"
                )

    def _constant(self, value: Any) -> Value:
        if isinstance(value, tuple):
            return tuple_of([self._constant(each) for each in value])
        if isinstance(value, bool | int | float | np.number | np.bool_):
            return number(value)  # type: ignore[arg-type]  # a number of NumPy is one, too
        if isinstance(value, np.ndarray) and value.dtype.name in ("float64", "int64", "bool"):
            return self._code.constant_array(value)
        raise NotCompilable(f"{value!r} is no number"[:200])

    def _read_name(self, name: str) -> Value:
        if name in self._fixed:
            return self._fixed[name]
        if name not in self._rooms:
            raise NotCompilable(f"{name} is read before it is assigned")
        if len(self._rooms[name]) != len(leaves(self._types[name])):
            raise NotCompilable(
                f"{name} is another part of an array in each round; copy it, as in {name} = {name}.copy()"
            )
        value = self._code.load(self._types[name], self._rooms[name])
        if name not in self._only_counters:
            return value
        counts, bits = name not in self._signed, self._bits.get(name, 63)
        return Value(value.type, value.parts, counts=counts, bits=bits)

    def _outer(self, node: ast.expr) -> Any:
        """Find a module, function or constant that the kernel's module has.

        Raises:
            NotCompilable: it has none of this name, or the name is the kernel's own.
        """
        if isinstance(node, ast.Name) and node.id not in self._local:
            if node.id in self._closed:
                return self._closed[node.id].cell_contents
            builtins = self._scope.get("__builtins__", {})
            builtins = vars(builtins) if isinstance(builtins, python_types.ModuleType) else builtins
            for names in (self._scope, builtins):
                if node.id in names:
                    return names[node.id]
            raise NotCompilable(f"there is no {node.id}")
        if isinstance(node, ast.Attribute):
            return getattr(self._outer(node.value), node.attr)
        raise NotCompilable(f"{ast.unparse(node)} is not known")

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
                raise NotCompilable(f"there is no {node.attr}; there is {', '.join(names)}")
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
        raise NotCompilable(f"an array has no {node.attr} in a kernel")

    def _subscript(self, node: ast.Subscript) -> Value:
        whole = self._value(node.value)
        indices = self._indices(node)
        if isinstance(whole.type, RecordType):
            (index,) = indices
            if not isinstance(index, Value) or not isinstance(index.constant, int):
                raise NotCompilable("the place in a tuple is a constant")
            member = whole.members[index.constant]
            is_size = isinstance(node.value, ast.Attribute) and node.value.attr == "shape"
            bits = SIZE_BITS if is_size else 63
            return Value(member.type, member.parts, counts=is_size, bits=bits)
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
            step = None if part.step is None else self._value(part.step).constant
            if part.step is not None and (not step or not isinstance(step, int)):
                raise NotCompilable("the step of a slice is a constant, and not zero")
            first, end = (
                None if each is None else self._value(each) for each in (part.lower, part.upper)
            )
            made.append(Slice(first, end, 1 if step is None else int(step)))
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
        """Write the value of a condition of several parts."""
        if isinstance(node, ast.BoolOp):
            for each in node.values:
                if not _is_flag(each) and self._kind_of(each) != BOOL:
                    raise NotCompilable(
                        "'and' and 'or' combine conditions; compare the number with one"
                    )
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
        """Return the type of an expression, without writing its code."""
        code = self._code
        kept = len(code.lines), len(code.entry), code.reachable, len(code.exits), len(code.sites)
        kind = self._value(node).type
        del (
            code.lines[kept[0] :],
            code.entry[kept[1] :],
            code.exits[kept[3] :],
            code.sites[kept[4] :],
        )
        code.reachable = kept[2]
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
            text = "a kernel passes arguments by position; write a loop, or put it into an @numba.njit function"
            raise NotCompilable(f"{ast.unparse(node)[:80]}: {text}")
        if not self._is_outer(node.func):
            raise NotCompilable(f"{ast.unparse(node.func)} is {_NOT_CALLED}")
        function = self._outer(node.func)
        if getattr(function, "__module__", "").endswith(".compiling.numpy_numbers"):
            if function.__name__ == "room":
                return self._room(node)
            if function.__name__ == "demand":
                found, wanted = (self._value(each) for each in node.args)
                differ = self._code.compare("NotEq", found, wanted)
                self._code.fail_if(differ.parts[0], Failure.WRONG_LENGTH)
                return NOTHING
        arguments = [self._value(each) for each in node.args]
        try:
            if function in FUNCTIONS:
                return FUNCTIONS[function](self._code, arguments)
            if function in ELEMENTWISE:
                return write_elements(self._code, function, arguments)
        except (TypeError, ValueError, IndexError) as error:
            text = f"{ast.unparse(node.func)} takes no {len(arguments)} arguments in a kernel"
            raise NotCompilable(text) from error
        if function is np.dot:
            return write_product(self._code, arguments)
        if isinstance(function, type) and issubclass(function, tuple):
            kind = RecordType(function, tuple(each.type for each in arguments))
            return Value(kind, tuple(part for each in arguments for part in each.parts))
        made = self._callee(function, tuple(each.type for each in arguments))
        if made is None:
            raise NotCompilable(f"{ast.unparse(node.func)} is {_NOT_CALLED}")
        return self._call_kernel(made, arguments)

    def _room(self, node: ast.Call) -> Value:
        """Make an array of the kernel's own, of zeros."""
        shape, dtype = (ast.literal_eval(each) for each in node.args)
        return self._code.room(shape, dtype)

    def _call_kernel(self, made: Translated, arguments: Sequence[Value]) -> Value:
        code = self._code
        if made.text:
            self._callees[made.name] = made
        results = code.variable(made.returns)
        operands = [
            f"{leaf} {part}"
            for each in arguments
            for leaf, part in zip(leaves(each.type), each.parts, strict=True)
        ]
        operands += [f"ptr {place}" for place in results]
        status = code.result(f'call i32 @"{made.name}"({", ".join(operands)})')
        if not made.text:  # of numba
            code.fail_if(code.result(f"icmp ne i32 {status}, 0"), Failure.NUMBA)
            self._code.declared |= made.declared
        elif made.fails:
            code.pass_on(status)
        return code.load(made.returns, results) if results else NOTHING

    # Places in the source

    @contextmanager
    def _placed(self, node: ast.stmt | ast.expr) -> Iterator[None]:
        self._code.line = getattr(node, "lineno", self._code.line)
        try:
            yield
        except NotCompilable as error:
            self._refuse(node, str(error))

    def _refuse(self, node: ast.AST, text: str) -> NoReturn:
        file, line = self._function.__code__.co_filename, getattr(node, "lineno", 0)
        name = f"{self._function.__module__}.{self._function.__qualname__}"
        raise CompileError(f"kernel {name} does not compile: {file}:{line}: {text}")


def origin_of(function: Any) -> int:
    """Return a number of 15 bits by which a status tells the function that has failed."""
    name = f"{function.__module__}.{function.__qualname__}".encode()
    return int.from_bytes(hashlib.blake2b(name, digest_size=2).digest(), "big") >> 1


_NOT_CALLED = "no kernel, and nothing that kernels may call; put it into an @numba.njit function and call that"


def _is_flag(node: ast.expr) -> bool:
    """Return whether an expression is a flag by its form."""
    return isinstance(node, ast.Compare | ast.BoolOp) or (
        isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    )


def _assignments(tree: ast.FunctionDef) -> tuple[set[str], set[str]]:
    """Return the names that a function assigns, and those of them that only loops assign."""
    nodes = list(ast.walk(tree))  # walked once: a walk is slow
    counters = {id(node.target) for node in nodes if isinstance(node, ast.For)}
    stored = [n for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
    others = {name.id for name in stored if id(name) not in counters}
    others.update(each.arg for each in tree.args.args)
    assigned = {name.id for name in stored}
    return assigned, assigned - others
