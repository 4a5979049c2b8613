"""The Euler angles by which plans are solved: their rates, and back from the robot's motion."""

import numpy as np

from aloft.mathematics.linear_algebra import product
from aloft.planner.models.euler_angles import (
    angular_motion,
    euler_angles,
    euler_rates,
    rotation,
    times,
    times_transposed,
    unwrapped,
)


def test_angles_rates_and_accelerations_against_differences_of_the_rotation() -> None:
    rng = np.random.default_rng(3)
    angles, rates, bends = rng.normal(size=(3, 3))
    h = 1e-5

    def turned(t: float) -> np.ndarray:
        return rotation(angles + t * rates + 0.5 * t * t * bends)

    def spin(t: float) -> np.ndarray:
        rate = (turned(t + h) - turned(t - h)) / (2 * h)
        skew = turned(t).T @ rate
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

    velocity, acceleration = angular_motion(angles, rates, bends)
    np.testing.assert_allclose(velocity, spin(0.0), atol=1e-8)
    np.testing.assert_allclose(acceleration, (spin(1e-3) - spin(-1e-3)) / 2e-3, atol=1e-4)
    np.testing.assert_allclose(euler_rates(angles, velocity), rates, atol=1e-12)


def test_angles_follow_a_somersault() -> None:
    pitch = np.linspace(0.0, 2 * np.pi, 30)
    quaternions = np.column_stack([0 * pitch, np.sin(pitch / 2), 0 * pitch, np.cos(pitch / 2)])
    found = euler_angles(quaternions)
    np.testing.assert_allclose(found[:, 1], pitch, atol=1e-12)
    np.testing.assert_allclose(found[:, [0, 2]], 0.0, atol=1e-12)


def test_unwrapped_angles_have_the_bits_of_numpys() -> None:
    rng = np.random.default_rng(5)
    still, turning = np.cumsum(rng.uniform(-3.1, 3.1, (2, 40, 2)), axis=1)
    still[:, 1] = -0.0
    for angles in (0.1 * still, np.mod(turning, 2 * np.pi), np.full((3, 2), np.nan), still[:1]):
        found = unwrapped(angles)
        assert found.tobytes() == np.unwrap(angles, axis=0).tobytes()
        assert not np.shares_memory(found, angles)


def test_rotations_have_the_bits_of_products_of_matrices() -> None:
    rng = np.random.default_rng(6)
    angles = rng.uniform(-4.0, 4.0, (500, 3))
    angles[rng.random(angles.shape) < 0.2], angles[rng.random(angles.shape) < 0.2] = 0.0, -0.0
    about = np.zeros((3, 500, 3, 3))
    for axis, turn in enumerate(about):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        cosine, sine = np.cos(angles).T[axis], np.sin(angles).T[axis]
        turn[:, axis, axis] = 1.0
        turn[:, one, one], turn[:, other, other] = cosine, cosine
        turn[:, one, other], turn[:, other, one] = -sine, sine
    found = rotation(angles)
    assert found.tobytes() == product(product(about[1], about[0]), about[2]).tobytes()
    for turned, matrices in ((times, found), (times_transposed, found.swapaxes(1, 2))):
        expected = product(matrices, angles[:, :, None])[:, :, 0]
        assert turned(found, angles).tobytes() == expected.tobytes()
