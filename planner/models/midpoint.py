"""The planner's own discretisation, evaluated anew with Pinocchio.

The ``full`` formulation holds accelerations of base position, Euler angles (R = Ry Rx Rz) and
joints constant over an interval and fulfils the equations of motion in its middle. What is left
over, here, is the constraint violation of a plan, found without anything of the planner's.
"""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.linear_algebra import product
from ...mathematics.rotations import matrices_of_quaternions, multiply
from ..task.plan import PlannedJump
from .exact_dynamics import ExactDynamics


def euler_angles(quaternions: Array) -> Array:
    """The angles about x, y and z of R = Ry Rx Rz [rad], (n, 3), followed through full turns."""
    matrix = matrices_of_quaternions(quaternions)
    about_x = np.arcsin(np.clip(-matrix[:, 1, 2], -1.0, 1.0))
    about_y = np.unwrap(np.arctan2(matrix[:, 0, 2], matrix[:, 2, 2]))
    about_z = np.unwrap(np.arctan2(matrix[:, 1, 0], matrix[:, 1, 1]))
    return np.column_stack([about_x, about_y, about_z])


def pose_of(q: Array) -> Array:
    """Base position, quaternion x, y, z, w and joints of base position, pitch, roll, yaw and joints.

    A product of half angles: it changes sign only where a full turn does.
    """
    half, quaternion = np.zeros((3, 4)), np.empty(4)
    half[[0, 1, 2], [1, 0, 2]], half[:, 3] = np.sin(q[3:6] / 2), np.cos(q[3:6] / 2)
    multiply(half[0], half[1], quaternion)
    multiply(quaternion, half[2], quaternion)
    return np.concatenate([q[:3], quaternion, q[6:]])


def euler_rates(angles: Array, angular_velocity: Array) -> Array:
    """The rates [rad/s] of the angles (3,) at a body-frame angular velocity (3,)."""
    x, _, z = angles
    # Undone: angular velocity = Rz' (x rate, y rate cos x, -y rate sin x) + (0, 0, z rate).
    first = np.cos(z) * angular_velocity[0] - np.sin(z) * angular_velocity[1]
    second = np.sin(z) * angular_velocity[0] + np.cos(z) * angular_velocity[1]
    about_y = second / np.cos(x)
    return np.array([first, about_y, angular_velocity[2] + about_y * np.sin(x)])


def rotation(angles: Array) -> Array:
    """Ry Rx Rz, from body to world."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return product(product(about_y, about_x), about_z)


def angular_motion(angles: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """Angular velocity [rad/s] and acceleration [rad/s^2] in the body frame."""
    x, _, z = angles
    back = np.array([[np.cos(z), np.sin(z), 0.0], [-np.sin(z), np.cos(z), 0.0], [0.0, 0.0, 1.0]])
    sine, cosine = np.sin(x), np.cos(x)
    turning = product(back, np.array([rates[0], rates[1] * cosine, -rates[1] * sine]))
    bend = np.array(
        [
            accelerations[0],
            accelerations[1] * cosine - rates[0] * rates[1] * sine,
            -accelerations[1] * sine - rates[0] * rates[1] * cosine,
        ]
    )
    about_z = np.array([0.0, 0.0, rates[2]])
    change = product(back, bend) - cross(about_z, turning) + np.array([0.0, 0.0, accelerations[2]])
    return turning + about_z, change


def cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors (3,); NumPy's own takes ten times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def midpoint_residuals(plan: PlannedJump, dynamics: ExactDynamics) -> tuple[Array, Array]:
    """What is left over in every interval, zero at impacts.

    Returns the gap, how far the coordinates miss those of a constant acceleration [m or rad],
    (N-1,), and the base's six equations of motion in the middle [N or N m], (N-1,).
    """
    angles = euler_angles(plan.position[:, 3:7])
    places = np.hstack([plan.position[:, :3], angles, plan.position[:, 7:]])
    rates = np.zeros_like(places)
    for k, (q, v) in enumerate(zip(plan.position, plan.velocity, strict=True)):
        world = matrices_of_quaternions(q[None, 3:7])[0] @ v[:3]
        rates[k] = np.concatenate([world, euler_rates(angles[k], v[3:6]), v[6:]])
    count = len(plan.time) - 1
    gap, wrench = np.zeros(count), np.zeros(count)
    for k in range(count):
        h = float(plan.time[k + 1] - plan.time[k])
        if h <= 0.0:
            continue
        bend = (rates[k + 1] - rates[k]) / h
        gap[k] = np.abs(places[k + 1] - places[k] - 0.5 * h * (rates[k] + rates[k + 1])).max()
        middle = places[k] + 0.5 * h * rates[k] + 0.125 * h * h * bend
        moving = rates[k] + 0.5 * h * bend
        q, v, base = _generalised(middle, moving, bend)
        whole = np.concatenate([base, bend[6:]])
        wrench[k] = np.abs(dynamics.base_residual(q, v, whole, plan.contact_force[k])).max()
    return gap, wrench


def _generalised(place: Array, rate: Array, bend: Array) -> tuple[Array, Array, Array]:
    """Pinocchio's q, v and base acceleration of coordinates, their rates and accelerations."""
    import pinocchio

    turn = rotation(place[3:6])
    spin, spin_rate = angular_motion(place[3:6], rate[3:6], bend[3:6])
    linear = product(turn.T, rate[:3])
    quaternion = pinocchio.Quaternion(turn).coeffs()
    q = np.concatenate([place[:3], quaternion / np.linalg.norm(quaternion), place[6:]])
    v = np.concatenate([linear, spin, rate[6:]])
    return q, v, np.concatenate([product(turn.T, bend[:3]) - cross(spin, linear), spin_rate])
