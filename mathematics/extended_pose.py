"""The matrix Lie group SE_m(3): an orientation and m vectors of one world, as pure functions.

An element is a unit quaternion x, y, z, w from body to world and m vectors (m, 3) [world]:
velocity, position and contact points. As a matrix it is [[R, V], [0, I]] with the vectors as the
columns of V. So a product rotates the vectors of the right element by the orientation of the left
one and adds the vectors of the left one. A tangent vector (3 + 3 m) is a rotation vector phi [rad]
followed by one rate Xi_k for each vector; as a matrix it is [[phi]x, Xi] with zeros below. No
function here allocates memory.
"""

from __future__ import annotations

import math

from .arrays import Array1D, Array2D, Rows3, Vector3
from .elementary import cos, sin
from .kernel import kernel
from .rotations import exponential as rotation_exponential
from .rotations import logarithm as rotation_logarithm
from .rotations import multiply, normalise, rotate

_SMALL = 1e-4
"""Below this angle [rad] the coefficients are computed by their series, which is exact there."""


@kernel
def left_jacobian_so3(phi: Array1D, vector: Array1D, out: Array1D) -> None:
    """Multiply a vector by the left Jacobian J of SO(3) at ``phi``: ``out`` = J v, (3,).

    J v = v + (1 - cos a) / a^2 phi x v + (a - sin a) / a^3 phi x (phi x v), with the angle
    a = |phi|. J v is the integral of v while it is rotated by phi at a constant rate.
    """
    x, y, z = phi[0], phi[1], phi[2]
    a, b, c = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < _SMALL:
        first, second = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        half = sin(0.5 * angle) / angle
        first, second = 2.0 * half * half, (angle - sin(angle)) / (angle * square)
    tx, ty, tz = y * c - z * b, z * a - x * c, x * b - y * a
    out[0] = a + first * tx + second * (y * tz - z * ty)
    out[1] = b + first * ty + second * (z * tx - x * tz)
    out[2] = c + first * tz + second * (x * ty - y * tx)


@kernel
def inv_left_jacobian_so3(phi: Array1D, vector: Array1D, out: Array1D) -> None:
    """Multiply a vector by the inverse of the left Jacobian of SO(3), for angles below 2 pi.

    J^-1 v = v - phi x v / 2 + (1 / a^2 - (1 + cos a) / (2 a sin a)) phi x (phi x v).
    """
    x, y, z = phi[0], phi[1], phi[2]
    a, b, c = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < _SMALL:
        second = 1.0 / 12.0 + square / 720.0
    else:
        # (1 + cos a) / sin a = cot(a / 2), which has no pole at pi.
        half = 0.5 * angle
        second = (1.0 - half * cos(half) / sin(half)) / square
    tx, ty, tz = y * c - z * b, z * a - x * c, x * b - y * a
    out[0] = a - 0.5 * tx + second * (y * tz - z * ty)
    out[1] = b - 0.5 * ty + second * (z * tx - x * tz)
    out[2] = c - 0.5 * tz + second * (x * ty - y * tx)


@kernel
def exponential(tangent: Array1D, orientation: Array1D, vectors: Array2D) -> None:
    """Compute the exponential map: the group element of a tangent vector (3 + 3 m).

    The result is written to ``orientation`` (4,) and ``vectors`` (m, 3).
    """
    rotation_exponential(tangent, orientation)
    for k in range(vectors.shape[0]):
        left_jacobian_so3(tangent, tangent[3 * k + 3 : 3 * k + 6], vectors[k])


@kernel
def logarithm(orientation: Array1D, vectors: Array2D, tangent: Array1D) -> None:
    """Compute the logarithm: the tangent vector (3 + 3 m) of a group element; its angle is at most
    pi."""
    rotation_logarithm(orientation, tangent)
    for k in range(vectors.shape[0]):
        inv_left_jacobian_so3(tangent, vectors[k], tangent[3 * k + 3 : 3 * k + 6])


@kernel
def divide(
    left: Array1D, left_vectors: Rows3, right: Array1D, right_vectors: Rows3,
    orientation: Array1D, vectors: Rows3, spare: Array1D,
) -> None:  # fmt: skip
    """``left`` times the inverse of ``right``: the right-invariant error of ``left``.

    Args:
        orientation, vectors: the result; they must not be arrays of the arguments.
        spare: scratch (4,).
    """
    for i in range(3):
        spare[i] = -right[i]
    spare[3] = right[3]
    multiply(left, spare, orientation)
    for k in range(vectors.shape[0]):
        rotate(orientation, right_vectors[k], vectors[k])
        vectors[k, :] = left_vectors[k] - vectors[k]


@kernel
def retract(
    tangent: Array1D, orientation: Array1D, vectors: Rows3, turn: Array1D, spare: Vector3
) -> None:
    """Replace the element X by exp(``tangent``) X: a correction that is expressed in the world.

    Args:
        turn, spare: scratch, (4,) and (3,).
    """
    rotation_exponential(tangent, turn)
    multiply(turn, orientation, orientation)
    normalise(orientation, orientation)
    for k in range(vectors.shape[0]):
        left_jacobian_so3(tangent, tangent[3 * k + 3 : 3 * k + 6], spare)
        rotate(turn, vectors[k], vectors[k])
        vectors[k, :] += spare
