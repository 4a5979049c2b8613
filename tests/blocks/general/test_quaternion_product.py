"""``blocks.QuaternionProduct``: its order and its inverse."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aloft.blocks.general.quaternion_product import QuaternionProduct
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize("inverse", [False, True])
def test_product(inverse: bool) -> None:
    a, b = Rotation.from_rotvec([0.3, -0.2, 0.9]), Rotation.from_rotvec([-0.5, 0.1, 0.2])
    bench = BlockBench(QuaternionProduct, {"inverse": inverse})
    bench.set("a", value=a.as_quat())
    bench.set("b", value=b.as_quat())
    bench.step()
    expected = ((a.inv() if inverse else a) * b).as_matrix()
    found = Rotation.from_quat(bench.get("y").value).as_matrix()
    np.testing.assert_allclose(found, expected, atol=1e-14)
