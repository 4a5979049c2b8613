"""``blocks.QuaternionToEuler``: against SciPy."""

import numpy as np
from scipy.spatial.transform import Rotation

from aloft.blocks.general.quaternion_to_euler import QuaternionToEuler
from aloft.runtime.testing import BlockBench


def test_it_is_scipys() -> None:
    bench = BlockBench(QuaternionToEuler)
    bench.set("u", value=Rotation.from_euler("ZYX", [0.6, -0.4, 2.0]).as_quat())
    bench.step()
    np.testing.assert_allclose(bench.get("y").value, [2.0, -0.4, 0.6], atol=1e-14)
