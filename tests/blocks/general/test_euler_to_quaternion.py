"""``blocks.EulerToQuaternion``: a pure yaw."""

import math

import numpy as np

from aloft.blocks.general.euler_to_quaternion import EulerToQuaternion
from aloft.runtime.testing import BlockBench


def test_yaw_is_about_z() -> None:
    bench = BlockBench(EulerToQuaternion)
    bench.set("u", value=[0.0, 0.0, 0.6])
    bench.step()
    expected = [0.0, 0.0, math.sin(0.3), math.cos(0.3)]
    np.testing.assert_allclose(bench.get("y").value, expected, atol=1e-15)
