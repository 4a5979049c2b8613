"""``blocks.Expression``: values, time, constants, and errors."""

import pytest

from aloft.blocks.general.expression import Expression
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


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
