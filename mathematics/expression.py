"""Arithmetic expressions as text, checked and compiled to array operations without ``eval``.

An expression knows numbers, names, ``+ - * / ** %``, comparisons (1 where they hold, else 0),
brackets, ``a if condition else b``, and the functions in ``FUNCTIONS``. Every operation works on
whole vectors and writes into an array that is made once.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array

FUNCTIONS: Mapping[str, tuple[Any, int]] = {
    "abs": (np.absolute, 1), "sign": (np.sign, 1), "sqrt": (np.sqrt, 1), "exp": (np.exp, 1),
    "log": (np.log, 1), "sin": (np.sin, 1), "cos": (np.cos, 1), "tan": (np.tan, 1),
    "asin": (np.arcsin, 1), "acos": (np.arccos, 1), "atan": (np.arctan, 1),
    "atan2": (np.arctan2, 2), "tanh": (np.tanh, 1), "floor": (np.floor, 1), "ceil": (np.ceil, 1),
    "min": (np.minimum, 2), "max": (np.maximum, 2), "hypot": (np.hypot, 2),
}  # fmt: skip
"""The functions an expression may call, and how many arguments each takes."""
CONSTANTS = {"pi": math.pi}
_OPERATORS: Mapping[type[ast.AST], Any] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
    ast.Pow: np.power, ast.Mod: np.mod, ast.UAdd: np.positive, ast.USub: np.negative,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
    ast.Eq: np.equal, ast.NotEq: np.not_equal,
}  # fmt: skip


@dataclass(frozen=True)
class ParsedExpression:
    """A checked expression; ``names`` are the variables it reads, sorted."""

    text: str
    tree: ast.expr
    names: tuple[str, ...]

    def compile(self, variables: Mapping[str, Array], size: int) -> Callable[[Array], None]:
        """A function that writes the expression's value into an array of ``size`` elements.

        ``variables`` are arrays of that size or of one number, which are read at every call.
        """
        steps: list[tuple[Any, tuple[Array, ...], Array]] = []
        result = _build(self.tree, variables, size, steps)

        def evaluate(out: Array) -> None:
            for function, arguments, target in steps:
                function(*arguments, out=target)
            np.copyto(out, result)

        return evaluate


def parse_expression(text: str, known: Iterable[str]) -> ParsedExpression:
    """The expression that ``text`` says, in which the names ``known`` may occur.

    Raises:
        ValueError: it cannot be read, or holds something that is not allowed; the text says what.
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
            if name not in FUNCTIONS:
                raise ValueError(f"there is no function {name!r}; there is {', '.join(FUNCTIONS)}")
            wanted = FUNCTIONS[name][1]
            if len(arguments) != wanted:
                raise ValueError(f"{name} takes {wanted} arguments, not {len(arguments)}")
            parts = arguments
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            parts = [left, right]
        case ast.UnaryOp(op=sign, operand=operand) if type(sign) in _OPERATORS:
            parts = [operand]
        case ast.Compare(left=left, ops=[comparison], comparators=[right]) if (
            type(comparison) in _OPERATORS
        ):
            parts = [left, right]
        case ast.IfExp(test=test, body=body, orelse=other):
            parts = [test, body, other]
        case _:
            raise ValueError(f"{ast.unparse(node)!r} is not arithmetic that is known here")
    for part in parts:
        _check(part, known, names)


def _build(
    node: ast.expr,
    variables: Mapping[str, Array],
    size: int,
    steps: list[tuple[Any, tuple[Array, ...], Array]],
) -> Array:
    """Append the operations that compute a node; return the array its value will be in."""

    def part(inner: ast.expr) -> Array:
        return _build(inner, variables, size, steps)

    function: Any
    arguments: tuple[Array, ...]
    match node:
        case ast.Constant(value=value):
            return np.full(size, float(value))  # type: ignore[arg-type]  # a number here
        case ast.Name(id=name):
            return np.full(size, CONSTANTS[name]) if name not in variables else variables[name]
        case ast.IfExp(test=test, body=body, orelse=other):
            arguments, function = (part(test), part(body), part(other)), _choose
        case ast.Call(func=ast.Name(id=name), args=inner):
            arguments, function = tuple(part(each) for each in inner), FUNCTIONS[name][0]
        case ast.BinOp(left=left, op=operator, right=right):
            arguments, function = (part(left), part(right)), _OPERATORS[type(operator)]
        case ast.Compare(left=left, ops=[comparison], comparators=[right]):
            arguments, function = (part(left), part(right)), _OPERATORS[type(comparison)]
        case ast.UnaryOp(op=sign, operand=operand):
            arguments, function = (part(operand),), _OPERATORS[type(sign)]
        case _:
            raise AssertionError("the expression was not checked")
    target = np.zeros(size)
    if isinstance(node, ast.IfExp):
        truth = np.zeros(size, bool)
        steps.append((np.not_equal, (arguments[0], np.zeros(size)), truth))
        steps.append((function, (truth, *arguments[1:]), target))
    else:
        steps.append((function, arguments, target))
    return target


def _choose(truth: Any, body: Any, other: Any, out: Any) -> None:
    np.copyto(out, other)
    np.copyto(out, body, where=truth)
