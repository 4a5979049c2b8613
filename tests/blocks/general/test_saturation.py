"""``blocks.Saturation``: exact values, and a law."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.saturation import Saturation
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

FLOATS = st.floats(-1e6, 1e6)


def saturate(u: list[float], **bounds: object) -> list[float]:
    bench = BlockBench(Saturation, {"n": len(u), **bounds})
    bench.set("u", value=u)
    bench.step()
    return list(bench.get("y").value)


def test_each_element_has_its_bounds() -> None:
    assert saturate([-5.0, 5.0, 0.5], lower=[-1.0, 0.0, 0.0], upper=1.0) == [-1.0, 1.0, 0.5]
    assert saturate([-5.0, 5.0], lower=0.0) == [0.0, 5.0]


@settings(max_examples=20, deadline=None)
@given(st.lists(FLOATS, min_size=1, max_size=4), FLOATS, FLOATS)
def test_saturating_twice_is_saturating_once(u: list[float], a: float, b: float) -> None:
    bounds = {"lower": min(a, b), "upper": max(a, b)}
    once = saturate(u, **bounds)
    assert saturate(once, **bounds) == once
    assert all(bounds["lower"] <= y <= bounds["upper"] for y in once)


def test_bounds_must_not_cross() -> None:
    with pytest.raises(BlockError, match="lower bound of element 1 is above the upper one"):
        BlockBench(Saturation, {"n": 2, "lower": [0.0, 2.0], "upper": 1.0})
