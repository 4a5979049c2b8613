"""``blocks.Function``: every function, against Python's own."""

import math

import pytest

from aloft.blocks.general.function import UFUNCS, Function
from aloft.runtime.testing import BlockBench

OTHERS = {
    "abs": abs,
    "sign": lambda u: math.copysign(1.0, u),
    "negative": lambda u: -u,
    "reciprocal": lambda u: 1.0 / u,
    "square": lambda u: u * u,
    "round": round,
}


@pytest.mark.parametrize("name", list(UFUNCS))
def test_function(name: str) -> None:
    bench = BlockBench(Function, {"n": 2, "function": name})
    bench.set("u", value=[0.6, 0.25])
    bench.step()
    function = OTHERS.get(name) or getattr(math, name)
    assert bench.get("y").value.tolist() == pytest.approx([function(0.6), function(0.25)])
