"""The group laws, the two maps and their inverses, also near zero and near a half turn.

Unit vectors are of length one, point along, and fall back where there is no direction.

Euler angles against SciPy, and there and back.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from aloft.mathematics import rotations
from aloft.mathematics.rotations import from_euler, to_euler, unit

numbers = st.floats(-1.0, 1.0, allow_nan=False, width=64)
vectors = arrays(np.float64, 3, elements=numbers)


@st.composite
def quaternions(draw):
    raw = draw(arrays(np.float64, 4, elements=numbers).filter(lambda q: np.abs(q).max() > 1e-3))
    out = np.empty(4)
    rotations.normalise(raw, out)
    return out


@st.composite
def rotation_vectors(draw):
    """Axis times angle, with angles gathered at zero and at a half turn."""
    axis = draw(vectors.filter(lambda v: np.linalg.norm(v) > 1e-3))
    angle = draw(
        st.one_of(
            st.floats(0.0, math.pi),
            st.floats(0.0, 1e-7),
            st.floats(math.pi - 1e-7, math.pi),
        )
    )
    return axis / np.linalg.norm(axis) * angle


def matrix(q):
    out = np.empty((3, 3))
    rotations.to_matrix(q, out)
    return out


def product(a, b):
    out = np.empty(4)
    rotations.multiply(a, b, out)
    return out


@given(quaternions())
def test_matrix_is_a_rotation(q):
    r = matrix(q)
    assert np.abs(r @ r.T - np.eye(3)).max() < 1e-14
    assert np.linalg.det(r) == pytest.approx(1.0)


@given(quaternions(), quaternions())
def test_product_of_quaternions_is_product_of_matrices(a, b):
    assert np.abs(matrix(product(a, b)) - matrix(a) @ matrix(b)).max() < 1e-14


@given(quaternions(), quaternions(), quaternions())
def test_product_is_associative(a, b, c):
    assert np.abs(product(product(a, b), c) - product(a, product(b, c))).max() < 1e-14


@given(quaternions())
def test_conjugate_is_the_inverse(q):
    inverse = np.empty(4)
    rotations.conjugate(q, inverse)
    assert np.abs(product(q, inverse) - [0, 0, 0, 1]).max() < 1e-15


@given(quaternions(), vectors)
def test_rotate_is_the_matrix_and_rotate_back_its_inverse(q, v):
    out = np.empty(3)
    rotations.rotate(q, v, out)
    assert np.abs(out - matrix(q) @ v).max() < 1e-14
    rotations.rotate_back(q, out, out)
    assert np.abs(out - v).max() < 1e-14


@given(quaternions())
def test_from_matrix_inverts_to_matrix(q):
    out = np.empty(4)
    rotations.from_matrix(matrix(q), out)
    sign = 1.0 if out @ q > 0 else -1.0
    assert np.abs(out - sign * q).max() < 1e-14
    assert out[3] >= 0.0


@given(rotation_vectors())
def test_logarithm_inverts_exponential(v):
    q, out = np.empty(4), np.empty(3)
    rotations.exponential(v, q)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
    rotations.logarithm(q, out)
    # A half turn about an axis is the same rotation as one about the opposite axis.
    error = np.abs(out - v).max()
    if np.linalg.norm(v) > math.pi - 1e-7:
        error = min(error, np.abs(out + v).max())
    assert error < 3e-7 if np.linalg.norm(v) > math.pi - 1e-7 else error < 1e-14


@given(rotation_vectors())
def test_exponential_is_the_matrix_exponential(v):
    """Against Rodrigues' formula, an independent route."""
    q, k = np.empty(4), np.empty((3, 3))
    rotations.exponential(v, q)
    rotations.skew(v, k)
    angle = np.linalg.norm(v)
    a = np.sinc(angle / math.pi)
    b = 0.5 * np.sinc(angle / (2.0 * math.pi)) ** 2
    assert np.abs(matrix(q) - (np.eye(3) + a * k + b * k @ k)).max() < 1e-14


@given(quaternions(), vectors, st.floats(1e-4, 0.1))
def test_integrate_turns_on_the_right(q, rate, duration):
    out, turn = np.empty(4), np.empty(4)
    rotations.integrate(q, rate, duration, out)
    rotations.exponential(rate * duration, turn)
    assert np.abs(out - product(q, turn)).max() < 1e-14


@given(vectors, vectors)
def test_skew_agrees_with_the_cross_product_of_numpy(a, b):
    k = np.empty((3, 3))
    rotations.skew(a, k)
    assert np.allclose(k @ b, np.cross(a, b), atol=1e-15, rtol=0)


@pytest.mark.parametrize("heading", [-3.0, -1.0, 0.0, 0.5, 2.0])
def test_yaw_and_tilt_of_a_turn_then_a_lean(heading):
    a, b = np.empty(4), np.empty(4)
    rotations.exponential(np.array([0.0, 0.0, heading]), a)
    rotations.exponential(np.array([0.0, 0.3, 0.0]), b)
    q = product(a, b)
    assert rotations.yaw(q) == pytest.approx(heading)
    assert rotations.tilt(q) == pytest.approx(0.3)


@pytest.mark.parametrize("pitch", [-3.0, -1.0, 0.0, 0.7, 2.5])
@pytest.mark.parametrize("other", [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (-0.2, 0.5)])
def test_pitch_is_the_angle_of_the_x_axis_about_the_bodys_y_axis(pitch, other):
    roll, yaw = other
    about_y = np.array([0.0, math.sin(pitch / 2), 0.0, math.cos(pitch / 2)])
    assert rotations.pitch_angle(about_y) == pytest.approx(pitch, abs=1e-12)
    lean = np.empty(4)
    from_euler(np.array([roll, 0.0, yaw]), lean)
    R = matrix(product(about_y, lean))
    expected = math.atan2(-R[2, 0], R[0, 0])
    assert rotations.pitch_angle(product(about_y, lean)) == pytest.approx(expected, abs=1e-12)


def test_tilt_keeps_its_digits_near_upright():
    q = np.empty(4)
    rotations.exponential(np.array([1e-9, 0.0, 0.0]), q)
    assert rotations.tilt(q) == pytest.approx(1e-9, rel=1e-9)


@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_normalise_of_any_size(size):
    out = np.empty(4)
    rotations.normalise(np.array([1.0, -1.0, 1.0, 1.0]) * size, out)
    assert np.allclose(out, [0.5, -0.5, 0.5, 0.5], rtol=1e-15)


def test_normalise_of_nothing_is_the_identity():
    out = np.empty(4)
    rotations.normalise(np.zeros(4), out)
    assert out.tolist() == [0, 0, 0, 1]


def test_out_may_be_an_argument():
    q = np.array([0.5, 0.5, 0.5, 0.5])
    expected = product(q, q)
    rotations.multiply(q, q, q)
    assert np.array_equal(q, expected)


@given(st.floats(-100.0, 100.0))
def test_wrap(angle):
    assert abs(rotations.wrap(angle)) <= math.pi + 1e-12
    assert math.cos(rotations.wrap(angle) - angle) == pytest.approx(1.0)


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


@settings(max_examples=30, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_there_and_back(roll: float, pitch: float, yaw: float) -> None:
    quaternion, back = np.zeros(4), np.zeros(3)
    from_euler(np.array([roll, pitch, yaw]), quaternion)
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    assert abs(quaternion @ expected) == pytest.approx(1.0, abs=1e-14)
    to_euler(quaternion, back)
    np.testing.assert_allclose(back, [roll, pitch, yaw], atol=1e-12)


@pytest.mark.parametrize("off", [0.0, 1e-15, 1e-12, 1e-9, 2e-8, 1e-6])
@pytest.mark.parametrize("end", [math.pi / 2, -math.pi / 2])
def test_angles_at_the_vertical_are_those_of_the_attitude(end: float, off: float) -> None:
    """Roll and yaw together give the same attitude back, also where each alone is not defined."""
    random, found = np.random.default_rng(7), np.zeros(3)
    for roll, yaw in random.uniform(-math.pi, math.pi, (200, 2)):
        truth = Rotation.from_euler("ZYX", [yaw, end - math.copysign(off, end), roll])
        to_euler(truth.as_quat(), found)
        back = Rotation.from_euler("ZYX", found[::-1])
        assert (truth.inv() * back).magnitude() < 1e-7
        assert found[1] == pytest.approx(end, abs=max(2.0 * off, 1e-7))
        if off < 1e-9:
            assert found[0] == 0.0
