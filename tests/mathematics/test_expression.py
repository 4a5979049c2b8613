"""Expressions compute what Python would, and refuse what is not arithmetic."""

import math

import numpy as np
import pytest

from aloft.mathematics.elementwise import OF_TWO
from aloft.mathematics.expression import CALLABLE, parse_expression

VARIABLES = {"a": np.array([0.3, -0.6]), "b": np.array([2.0, 0.5])}


def evaluate(text: str) -> list[float]:
    out = np.zeros(2)
    for call in parse_expression(text, VARIABLES).calls(VARIABLES, out):
        call.run()
    return list(out)


@pytest.mark.parametrize(
    "text",
    [
        "a + 2 * b - 1", "-(a ** 2) / b", "a % b", "abs(a) if a > 0 else b", "min(a, b) + max(a, 1)",
        "atan2(a, b)", "(a < b) * 3 + (a >= b) * 5 + (a > b) - (a <= b) + (a == b) + (a != b)", "a", "pi", "sin(pi * a) + cos(b)", "+a", "hypot(3, 4) + 0 * a",
    ],
)  # fmt: skip
def test_values_are_pythons(text: str) -> None:
    known = {**vars(math), "abs": abs, "min": min, "max": max, "pi": math.pi}
    expected = [
        eval(text, known, {"a": float(a), "b": float(b)})
        for a, b in zip(VARIABLES["a"], VARIABLES["b"], strict=True)
    ]
    assert evaluate(text) == pytest.approx(expected)


@pytest.mark.parametrize("name", CALLABLE)
def test_every_function_can_be_called(name: str) -> None:
    arguments = "0.5, a" if name in OF_TWO else "0.5"
    assert all(map(math.isfinite, evaluate(f"{name}({arguments})")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a +", "cannot read 'a \\+'"),
        ("c + 1", "there is no variable 'c'; there is a, b"),
        ("open(a)", "there is no function 'open'"),
        ("sin(a, b)", "sin takes 1 arguments, not 2"),
        ("a.real", "'a.real' is not arithmetic"),
        ("[a]", "is not arithmetic"),
        ("'text'", "is not arithmetic"),
        ("a < b < 1", "is not arithmetic"),
        ("__import__('os')", "there is no function '__import__'"),
        ("(lambda: 1)()", "is not arithmetic"),
        ("True", "is not arithmetic"),
    ],
)
def test_anything_else_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_expression(text, VARIABLES)


def test_names_are_those_that_are_read() -> None:
    assert parse_expression("b * pi + b", VARIABLES).names == ("b",)
