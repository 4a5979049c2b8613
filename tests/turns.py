"""Rotations as tests say and compare them."""

import numpy as np

from aloft.mathematics import rotations


def quaternion_of(vector):
    """The unit quaternion of a rotation vector [rad]."""
    out = np.empty(4)
    rotations.exponential(np.asarray(vector, dtype=float), out)
    return out


def turn_between(a, b):
    """The rotation vector [rad] from b to a, in the world."""
    return _logarithm(a, _inverse(b))


def turn_in_body(a, b):
    """The rotation vector [rad] from b to a, in the axes of b."""
    return _logarithm(_inverse(b), a)


def _inverse(quaternion):
    out = np.empty(4)
    rotations.conjugate(quaternion, out)
    return out


def _logarithm(left, right):
    product, out = np.empty(4), np.empty(3)
    rotations.multiply(left, right, product)
    rotations.logarithm(product, out)
    return out
