"""Arithmetic expressions as text, checked, and made into calls of kernels without ``eval``.

An expression knows numbers, names, ``+ - * / ** %``, comparisons (1 where they hold, else 0),
brackets, ``a if condition else b``, and the functions in ``CALLABLE``. Every operation is a call that
works on whole vectors and writes into an array that is made once.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import elementwise
from .arrays import Array
from .compiling.kernel_call import KernelCall

CALLABLE = (*elementwise.FUNCTIONS, *elementwise.OF_TWO)
"""The functions that an expression may call."""
CONSTANTS = {"pi": math.pi}
_OPERATORS: Mapping[type[ast.AST], Any] = {
    ast.Add: elementwise.add, ast.Sub: elementwise.subtract, ast.Mult: elementwise.multiply,
    ast.Div: elementwise.divide, ast.Pow: elementwise.power, ast.Mod: elementwise.remainder,
    ast.UAdd: elementwise.positive, ast.USub: elementwise.negative, ast.Lt: elementwise.less,
    ast.LtE: elementwise.less_equal, ast.Eq: elementwise.equal, ast.NotEq: elementwise.not_equal,
}  # fmt: skip
_TURNED: Mapping[type[ast.AST], type[ast.AST]] = {ast.Gt: ast.Lt, ast.GtE: ast.LtE}


@dataclass(frozen=True)
class ParsedExpression:
    """A checked expression; ``names`` are the variables it reads, sorted."""

    text: str
    tree: ast.expr
    names: tuple[str, ...]

    def calls(self, variables: Mapping[str, Array], out: Array) -> list[KernelCall]:
        """Return the calls that write the expression's value into an array (n,), in their order.

        ``variables`` are arrays of that size, which are read at every call.
        """
        made: list[KernelCall] = []
        _build(self.tree, variables, out, made)
        return made


def parse_expression(text: str, known: Iterable[str]) -> ParsedExpression:
    """Parse the expression ``text``, in which the names ``known`` may occur.

    Raises:
        ValueError: it cannot be read, or holds something that is not allowed; the text names it.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error)
        raise ValueError(f"cannot read {text!r}: {reason}") from None
    names: dict[str, None] = {}
    _check(tree, tuple(known), names)
    return ParsedExpression(text, tree, tuple(sorted(names)))


def _check(node: ast.expr, known: tuple[str, ...], names: dict[str, None]) -> None:
    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            return
        case ast.Name(id=name):
            if name not in known and name not in CONSTANTS:
                raise ValueError(f"there is no variable {name!r}; there is {', '.join(known)}")
            if name not in CONSTANTS:
                names[name] = None
            return
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in CALLABLE:
                raise ValueError(f"there is no function {name!r}; there is {', '.join(CALLABLE)}")
            wanted = 2 if name in elementwise.OF_TWO else 1
            if len(arguments) != wanted:
                raise ValueError(f"{name} takes {wanted} arguments, not {len(arguments)}")
            parts = arguments
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            parts = [left, right]
        case ast.UnaryOp(op=sign, operand=operand) if type(sign) in _OPERATORS:
            parts = [operand]
        case ast.Compare(left=left, ops=[comparison], comparators=[right]) if type(comparison) in (
            *_OPERATORS,
            *_TURNED,
        ):
            parts = [left, right]
        case ast.IfExp(test=test, body=body, orelse=other):
            parts = [test, body, other]
        case _:
            raise ValueError(f"{ast.unparse(node)!r} is not arithmetic that is known here")
    for part in parts:
        _check(part, known, names)


def _build(
    node: ast.expr, variables: Mapping[str, Array], target: Array, calls: list[KernelCall]
) -> None:
    """Append the calls that write the value of a node into ``target``."""

    def part(inner: ast.expr) -> Array:
        if isinstance(inner, ast.Name) and inner.id in variables:
            return variables[inner.id]
        if isinstance(inner, ast.Constant | ast.Name):
            value = inner.value if isinstance(inner, ast.Constant) else CONSTANTS[inner.id]
            return np.full_like(target, value)
        room = np.zeros_like(target)
        _build(inner, variables, room, calls)
        return room

    function: Any
    match node:
        case ast.IfExp(test=test, body=body, orelse=other):
            function, parts = elementwise.choose, [test, body, other]
        case ast.Call(func=ast.Name(id=name), args=parts):
            function = {**elementwise.FUNCTIONS, **elementwise.OF_TWO}[name]
        case ast.BinOp(left=left, op=operator, right=right):
            function, parts = _OPERATORS[type(operator)], [left, right]
        case ast.Compare(left=left, ops=[comparison], comparators=[right]):
            turned = _TURNED.get(type(comparison))
            function = _OPERATORS[turned or type(comparison)]
            parts = [right, left] if turned else [left, right]
        case ast.UnaryOp(op=sign, operand=operand):
            function, parts = _OPERATORS[type(sign)], [operand]
        case _:
            function, parts = elementwise.positive, [node]
    arguments = [part(each) for each in parts]
    calls.append(KernelCall(function, *arguments, target))
