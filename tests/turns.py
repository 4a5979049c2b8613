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
    inverse, product, out = np.empty(4), np.empty(4), np.empty(3)
    rotations.conjugate(b, inverse)
    rotations.multiply(a, inverse, product)
    rotations.logarithm(product, out)
    return out
