"""``blocks.Expression``: every function, against Python's own, and its units; ``blocks.External``."""

import math

import pytest

from aloft.blocks.general.user_code import TIME, Expression, External, unit_of
from aloft.mathematics.elementwise import FUNCTIONS
from aloft.mathematics.expression import parse_expression
from aloft.runtime.language.errors import BlockError, UnitError
from aloft.runtime.language.units import parse_unit
from aloft.runtime.testing import BlockBench

OTHERS = {
    "abs": abs,
    "sign": lambda u: math.copysign(1.0, u),
    "round": round,
}


@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_function(name: str) -> None:
    bench = BlockBench(Expression, {"n": 2, "expression": f"{name}(a)"}, wired=["a"])
    bench.set("a", value=[0.6, 0.25])
    bench.step()
    function = OTHERS.get(name) or getattr(math, name)
    assert bench.get("y").value.tolist() == pytest.approx([function(0.6), function(0.25)])


def test_a_formula_of_inputs_time_and_constants() -> None:
    params = {"n": 2, "expression": "k * a + t", "constants": {"k": 10.0}}
    bench = BlockBench(Expression, params, rate=4.0, wired=["a"])
    found = []
    for _ in range(3):
        bench.set("a", value=[1.0, 2.0])
        bench.step()
        found.append(bench.get("y").value.tolist())
    assert found == [[10.0, 20.0], [10.25, 20.25], [10.5, 20.5]]


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"expression": "a + q"}, "there is no variable 'q'"),
        ({"expression": "a + b"}, "the formula reads 'b', which is not wired"),
        ({"expression": "a", "constants": {"t": 1.0}}, "a constant cannot be called 't'"),
    ],
)
def test_a_formula_must_make_sense(params: dict[str, object], message: str) -> None:
    with pytest.raises(BlockError, match=message):
        BlockBench(Expression, params, wired=["a"])


UNITS = {"a": parse_unit("m"), "b": parse_unit("m/s"), "k": parse_unit("N/m"), **TIME, "u": None}


def unit(text: str) -> str | None:
    found = unit_of(parse_expression(text, UNITS).tree, UNITS)
    return None if found is None else str(found)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("k * a", "N"),
        ("a + b * t", "m"),
        ("-a / t", "m/s"),
        ("sqrt(a ** 2 + (b * t) ** 2)", "m"),
        ("hypot(a, b * t)", "m"),
        ("atan2(a, b * t)", "rad"),
        ("sin(a / (b * t))", "1"),
        ("a if b > 0 else 0", "m"),
        ("max(a, 0)", "m"),
        ("2 * a", "m"),
        ("1 / t", "1/s"),
        ("a < b * t", "1"),
        ("u + a", "m"),
        ("u * a", None),
        ("exp(2)", "1"),
        ("sign(a)", "1"),
        ("abs(a) % a", "m"),
    ],
)
def test_units_of_formulas(formula: str, expected: str | None) -> None:
    assert unit(formula) == expected


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("a + b", "a is in m and b in m/s"),
        ("a + 1", "a is in m and 1 in 1"),
        ("a > t", "a is in m and t in s"),
        ("exp(a)", "exp takes plain numbers, not m"),
        ("cos(a)", "cos takes rad, not m"),
        ("a ** t", "a is in m and needs a whole number as its power"),
        ("sqrt(a)", "the square root of m has no unit"),
    ],
)
def test_mistakes(formula: str, message: str) -> None:
    with pytest.raises(UnitError, match=message.replace("*", r"\*")):
        unit(formula)


def test_it_holds_its_initial_value_until_it_is_set() -> None:
    bench = BlockBench(External, {"n": 2, "initial": [1.0, 2.0], "unit": "m"})
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, 2.0]
    bench.block.x.value[:] = [3.0, 4.0]  # type: ignore[attr-defined]
    bench.step()
    assert bench.get("y").value.tolist() == [3.0, 4.0]
