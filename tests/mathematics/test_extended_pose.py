"""The group against matrices and scipy's matrix exponential; its laws for all elements."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm

from aloft.mathematics import extended_pose as group
from aloft.mathematics import rotations

M = 4
TANGENTS = arrays(np.float64, 3 + 3 * M, elements=st.floats(-1.75, 1.75))


def exponential(tangent):
    orientation, vectors = np.empty(4), np.empty((M, 3))
    group.exponential(tangent, orientation, vectors)
    return orientation, vectors


def matrix(element):
    """The element as a matrix (3 + M, 3 + M)."""
    out = np.eye(3 + M)
    rotation = np.empty((3, 3))
    rotations.to_matrix(element[0], rotation)
    out[:3, :3], out[:3, 3:] = rotation, element[1].T
    return out


def hat(tangent):
    """The tangent vector as a matrix."""
    out = np.zeros((3 + M, 3 + M))
    skew = np.empty((3, 3))
    rotations.skew(tangent[:3], skew)
    out[:3, :3], out[:3, 3:] = skew, tangent[3:].reshape(M, 3).T
    return out


@given(TANGENTS)
def test_exponential_is_the_matrix_exponential(tangent):
    np.testing.assert_allclose(matrix(exponential(tangent)), expm(hat(tangent)), atol=2e-13)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-7, 9e-5, 1.1e-4, 1e-3, 0.1, 3.0])
def test_no_digit_is_lost_at_small_angles(size):
    tangent = np.linspace(-1.0, 1.0, 3 + 3 * M)
    tangent[:3] *= size / np.linalg.norm(tangent[:3])
    element = exponential(tangent)
    np.testing.assert_allclose(matrix(element), expm(hat(tangent)), rtol=0, atol=1e-13)
    back = np.empty_like(tangent)
    group.logarithm(*element, back)
    np.testing.assert_allclose(back, tangent, rtol=0, atol=1e-12)


@given(TANGENTS)
def test_logarithm_undoes_it(tangent):
    back = np.empty_like(tangent)
    group.logarithm(*exponential(tangent), back)
    np.testing.assert_allclose(back, tangent, atol=1e-10)


@given(TANGENTS, TANGENTS)
def test_retract_multiplies_from_the_left(first, second):
    orientation, vectors = exponential(second)
    expected = expm(hat(first)) @ matrix((orientation, vectors))
    group.retract(first, orientation, vectors, np.empty(4), np.empty(3))
    np.testing.assert_allclose(matrix((orientation, vectors)), expected, atol=1e-12)


@given(TANGENTS, TANGENTS)
def test_divide_is_the_product_with_the_inverse(first, second):
    left, right = exponential(first), exponential(second)
    out, spare = (np.empty(4), np.empty((M, 3))), np.empty(4)
    group.divide(*left, *right, *out, spare)
    expected = matrix(left) @ np.linalg.inv(matrix(right))
    np.testing.assert_allclose(matrix(out), expected, atol=1e-12)


@given(TANGENTS, TANGENTS, TANGENTS)
def test_the_right_invariant_error_is_invariant(first, second, third):
    """The same motion after both changes nothing: (X Z)(Y Z)^-1 = X Y^-1."""
    x, y, z = (matrix(exponential(t)) for t in (first, second, third))
    np.testing.assert_allclose((x @ z) @ np.linalg.inv(y @ z), x @ np.linalg.inv(y), atol=1e-10)
