"""Translates the statements of one kernel, for arguments of given types, into LLVM's language.

A variable has one type in the whole function, the widest of all that is assigned to it; a function is
translated again until no type grows.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from .arguments import ArgumentType, NumberType, RecordType
from .failures import CompileError
from .kernel_expressions import Callee, ExpressionTranslator, Translated
from .known_functions import apply
from .llvm_code import FLOAT, INT, NOTHING, NotCompilable, Value, join, leaves, number

_MOST_PASSES = 12


def translate(
    function: Any,
    tree: ast.FunctionDef,
    signature: tuple[ArgumentType, ...],
    name: str,
    callee: Callee,
) -> Translated:
    """Translate a kernel into LLVM's language.

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
    bits: dict[str, int] = {}
    for _ in range(_MOST_PASSES):
        attempt = _Function(function, tree, signature, callee, types, signed, bits)
        made = attempt.translated(name)
        if not attempt.grown:
            return made
    raise CompileError(f"kernel {name}: the types of its variables never settle")


class _Function(ExpressionTranslator):
    """One pass through the statements of a function."""

    def translated(self, name: str) -> Translated:
        """Return the function as it is after this pass."""
        code = self._code
        self._loops: list[tuple[str, str]] = []
        """Targets of 'continue' and 'break' in the loops around a statement."""
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
        lines += [*code.exits, "}"]
        text = "\n".join(lines)
        sites = tuple(code.sites)
        return Translated(
            name, text, returns, code.fails, self._callees, code.declared, self._function, sites
        )

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
                text = "put it into an @numba.njit function and call that"
                raise NotCompilable(
                    f"compiled kernels have no {type(node).__name__.lower()}; {text}"
                )

    def _assign(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._assign_name(target.id, value)
        elif isinstance(target, ast.Tuple):
            members = value.members
            if len(members) != len(target.elts):
                raise NotCompilable(f"{len(members)} values for {len(target.elts)} names")
            for each, part in zip(target.elts, members, strict=True):
                self._assign(each, part)
        elif isinstance(target, ast.Subscript):
            self._write(*self._target(target), value)
        else:
            raise NotCompilable(f"{ast.unparse(target)} cannot be assigned")

    def _assign_name(self, name: str, value: Value) -> None:
        if value.type == NOTHING.type:
            raise NotCompilable(f"{name} would be None")
        known = self._types.get(name)
        widest = value.type if known is None else join(known, value.type)
        if known is None:
            self._types[name] = widest
        elif widest != known:
            self._types[name] = widest
            self.grown = True
            return
        if widest == FLOAT and value.type == INT:
            self._code.exact(value)
        if name not in self._rooms:
            self._rooms[name] = self._code.variable(widest)
        if (
            name in self._only_counters
            and value.type == INT
            and value.bits > self._bits.get(name, 0)
        ):
            self._bits[name] = value.bits
            self.grown = True
        self._code.store(self._code.convert(value, widest), self._rooms[name])

    def _target(self, node: ast.Subscript) -> tuple[Value, str | None]:
        """Write a part of an array, or return the array and the address of one element of it."""
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
            raise NotCompilable(f"{ast.unparse(node.target)} cannot be assigned")
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
        bits = max(start.bits, stop.bits)
        place = Value(INT, code.load(INT, counter).parts, counts=counts, bits=bits)
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
            raise NotCompilable("a loop goes over range(...)")
        values = [self._value(each) for each in node.args]
        if any(value.kind == "float" for value in values):
            raise NotCompilable("range takes whole numbers")
        if len(values) == 1:
            values.insert(0, number(0))
        start, stop, *step = values
        if step and step[0].constant == 0:
            raise NotCompilable("range() with a step of zero")
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
            raise NotCompilable("a kernel returns numbers, or a tuple of numbers")
        known = self._types.get(_RESULT, value.type)
        widest = join(known, value.type)
        if self._types.get(_RESULT) != widest:
            self.grown = self.grown or _RESULT in self._types
            self._types[_RESULT] = widest
        places = tuple(f"%r{k}" for k in range(len(leaves(widest))))
        self._code.store(self._code.convert(value, widest), places)
        self._code.write("ret i32 0")
        self._code.reachable = False


_RESULT = "<result>"
"""The name under which the type of a function's result stands among those of its variables."""


def _parts(value: Value) -> list[ArgumentType]:
    kind = value.type
    return list(kind.parts) if isinstance(kind, RecordType) else [kind]
