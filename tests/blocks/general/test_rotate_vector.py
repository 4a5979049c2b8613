"""``blocks.RotateVector``: there and back."""

import math

import numpy as np
import pytest

from aloft.blocks.general.rotate_vector import RotateVector
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(
    ("direction", "expected"), [("body to world", [0, 1, 2]), ("world to body", [0, -1, 2])]
)
def test_a_quarter_turn_about_z(direction: str, expected: list[float]) -> None:
    bench = BlockBench(RotateVector, {"direction": direction})
    bench.set("rotation", value=[0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)])
    bench.set("u", value=[1.0, 0.0, 2.0])
    bench.step()
    np.testing.assert_allclose(bench.get("y").value, expected, atol=1e-15)
