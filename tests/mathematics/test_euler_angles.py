"""Euler angles against SciPy, and there and back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aloft.mathematics.euler_angles import from_euler, to_euler


@settings(max_examples=30, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_there_and_back(roll: float, pitch: float, yaw: float) -> None:
    quaternion, back = np.zeros(4), np.zeros(3)
    from_euler(np.array([roll, pitch, yaw]), quaternion)
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    assert abs(quaternion @ expected) == pytest.approx(1.0, abs=1e-14)
    to_euler(quaternion, back)
    np.testing.assert_allclose(back, [roll, pitch, yaw], atol=1e-12)
