"""How far feet have turned, also around half a turn, where left and right are the same."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.scoring.jump_criteria import mean_turn


def directions(*angles: float) -> np.ndarray:
    return np.array([[math.cos(angle), math.sin(angle)] for angle in angles])


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.0, math.pi - 0.001, math.pi, -math.pi + 0.001])
@pytest.mark.parametrize("apart", [0.0, 0.02, -0.02])
def test_the_mean_is_between_the_feet(turn: float, apart: float) -> None:
    found = mean_turn(directions(0.3, 0.4), directions(0.3 + turn - apart, 0.4 + turn + apart))
    assert math.remainder(found - turn, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(-math.pi, math.pi), st.floats(-1.5, 1.5), st.floats(-math.pi, math.pi))
def test_where_the_feet_started_from_does_not_count(
    turn: float, apart: float, start: float
) -> None:
    found = mean_turn(directions(start, start), directions(start + turn, start + turn + apart))
    assert math.remainder(found - turn - apart / 2.0, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
