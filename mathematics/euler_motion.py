"""Motion of a body whose orientation is R = Ry Rx Rz of its Euler angles, at many instants.

A row of six numbers is a place [m] and the angles about y, x and z [rad], or their rates, in the world; or the
linear and angular velocity, or acceleration, in the body's axes. Sines and cosines are arguments, of whole arrays by
NumPy.
"""

from __future__ import annotations

from .arrays import Array1D, Array2D, Matrix3, Rows3, Vector3
from .kernel import kernel

# Where a product of matrices would add zeros, they are added here, too: no zero of a result has a sign.


@kernel
def euler_matrix(sine: Vector3, cosine: Vector3, out: Matrix3) -> None:
    """Rotation from body to world, of the sines and cosines of the angles about y, x and z."""
    sy, sx, sz = sine[0], sine[1], sine[2]
    cy, cx, cz = cosine[0], cosine[1], cosine[2]
    none, side, front = 0.0 * cy, sy * sx, cy * sx
    out[0, 0], out[0, 1] = (cy * cz + side * sz) + 0.0, (side * cz - cy * sz) + 0.0
    out[1, 0], out[1, 1] = (none * cz + cx * sz) + 0.0, (cx * cz - none * sz) + 0.0
    out[2, 0], out[2, 1] = (-sy * cz + front * sz) + 0.0, (front * cz - -sy * sz) + 0.0
    out[0, 2], out[1, 2], out[2, 2] = sy * cx + 0.0, -sx + 0.0, cy * cx + 0.0


@kernel
def turn_ahead(turn: Matrix3, vector: Array1D, out: Vector3) -> None:
    """Components in the world of the first three numbers of a row in the body's axes."""
    x, y, z = vector[0], vector[1], vector[2]
    for axis in range(3):
        out[axis] = (turn[axis, 0] * x + turn[axis, 1] * y + turn[axis, 2] * z) + 0.0


@kernel
def turn_back(turn: Matrix3, vector: Array1D, out: Vector3) -> None:
    """Components in the body's axes of the first three numbers of a row."""
    x, y, z = vector[0], vector[1], vector[2]
    for axis in range(3):
        out[axis] = (turn[0, axis] * x + turn[1, axis] * y + turn[2, axis] * z) + 0.0


@kernel
def motions_in_body(
    sine: Rows3, cosine: Rows3, rate: Array2D, bend: Array2D, turn: Matrix3, velocity: Array2D, acceleration: Array2D
) -> None:  # fmt: skip
    """Compute velocities and accelerations in the body's axes at n instants.

    Args:
        sine, cosine: of the angles, (n, 3).
        rate, bend: rates and accelerations of place and angles, and behind them those of joints, (n, 6 + n_joints).
        turn: scratch.
        velocity, acceleration: what is computed, and the joints' as they are, (n, 6 + n_joints).
    """
    for i in range(rate.shape[0]):
        euler_matrix(sine[i], cosine[i], turn)
        sx, sz, cx, cz = sine[i, 1], sine[i, 2], cosine[i, 1], cosine[i, 2]
        q, p, r = rate[i, 3], rate[i, 4], rate[i, 5]
        b, a, c = bend[i, 3], bend[i, 4], bend[i, 5]
        # The angular velocity is Rz' (p, q cos x, -q sin x) + (0, 0, r).
        u, v, w = p, q * cx, -q * sx
        x, y, z = cz * u + sz * v, -sz * u + cz * v, w
        speed, spin = velocity[i, 0:3], velocity[i, 3:6]
        turn_back(turn, rate[i], speed)
        spin[0], spin[1], spin[2] = x + 0.0, y + 0.0, z + r
        u, v, w = a, b * cx - p * q * sx, -b * sx - p * q * cx
        pull, spun = acceleration[i, 0:3], acceleration[i, 3:6]
        spun[0] = (cz * u + sz * v) - (0.0 * z - r * y) + 0.0
        spun[1] = (-sz * u + cz * v) - (r * x - 0.0 * z) + 0.0
        spun[2] = w - (0.0 * y - 0.0 * x) + c
        turn_back(turn, bend[i], pull)
        pull[0] = pull[0] - (spin[1] * speed[2] - spin[2] * speed[1])
        pull[1] = pull[1] - (spin[2] * speed[0] - spin[0] * speed[2])
        pull[2] = pull[2] - (spin[0] * speed[1] - spin[1] * speed[0])
        for k in range(6, rate.shape[1]):
            velocity[i, k], acceleration[i, k] = rate[i, k], bend[i, k]


@kernel
def motions_in_world(
    sine: Rows3, cosine: Rows3, velocity: Array2D, turn: Matrix3, rate: Array2D
) -> None:
    """Compute the rates of place and angles from velocities in the body's axes, the converse of ``motions_in_body``."""
    for i in range(velocity.shape[0]):
        euler_matrix(sine[i], cosine[i], turn)
        sx, sz, cx, cz = sine[i, 1], sine[i, 2], cosine[i, 1], cosine[i, 2]
        turn_ahead(turn, velocity[i], rate[i, 0:3])
        p, q, r = velocity[i, 3], velocity[i, 4], velocity[i, 5]
        about_y = (sz * p + cz * q) / cx
        rate[i, 3], rate[i, 4], rate[i, 5] = about_y, cz * p - sz * q, r + about_y * sx
        for k in range(6, rate.shape[1]):
            rate[i, k] = velocity[i, k]
