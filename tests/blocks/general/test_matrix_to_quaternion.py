"""``blocks.MatrixToQuaternion``: against SciPy."""

import numpy as np
from scipy.spatial.transform import Rotation

from aloft.blocks.general.matrix_to_quaternion import MatrixToQuaternion
from aloft.runtime.testing import BlockBench


def test_it_is_scipys() -> None:
    rotation = Rotation.from_rotvec([0.3, -0.2, 0.9])
    bench = BlockBench(MatrixToQuaternion)
    bench.set("u", value=rotation.as_matrix())
    bench.step()
    np.testing.assert_allclose(bench.get("y").value, rotation.as_quat(), atol=1e-14)
