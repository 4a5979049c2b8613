"""Unit vectors are of length one, point along, and fall back where there is no direction."""

import math

from hypothesis import assume, given
from hypothesis import strategies as st

from aloft.mathematics.directions import unit

ELEMENT = st.floats(-1e300, 1e300)


@given(ELEMENT, ELEMENT, ELEMENT)
def test_a_unit_vector_points_along(x, y, z):
    largest = max(abs(x), abs(y), abs(z))
    assume(largest >= 1e-300)
    direction = unit(x, y, z, 0.0, 0.0, 1.0)
    assert abs(math.hypot(*direction) - 1.0) < 1e-15
    size = math.hypot(x / largest, y / largest, z / largest)
    for found, wanted in zip(direction, (x, y, z), strict=True):
        assert abs(found * size - wanted / largest) < 1e-15


def test_no_direction_gives_the_default():
    assert unit(0.0, 0.0, 0.0, 0.6, 0.0, 0.8) == (0.6, 0.0, 0.8)
    assert unit(1e-310, 0.0, -1e-305, 0.0, 1.0, 0.0) == (0.0, 1.0, 0.0)
