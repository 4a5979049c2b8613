"""The Euler angles by which plans are solved: their rates, and back from the robot's motion."""

import numpy as np
import pytest

from aloft.mathematics.linear_algebra import product
from aloft.mathematics.rotations import cross_products
from aloft.planner.models.euler_angles import (
    ORDER,
    coordinates_of,
    euler_angles,
    pose_of,
    rotation,
    times,
    times_transposed,
    twist_of,
    unwrapped,
)


def test_angles_rates_and_accelerations_against_differences_of_the_rotation() -> None:
    rng = np.random.default_rng(3)
    angles, rates, bends = 0.7 * rng.normal(size=(3, 3))
    h = 1e-5

    def turned(t: float) -> np.ndarray:
        return rotation(angles + t * rates + 0.5 * t * t * bends)

    def spin(t: float) -> np.ndarray:
        rate = (turned(t + h) - turned(t - h)) / (2 * h)
        skew = turned(t).T @ rate
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

    place, rate, bend = (np.concatenate([rng.normal(size=3), each[ORDER], [0.1]])
                         for each in (angles, rates, bends))  # fmt: skip
    velocity, acceleration = twist_of(place, rate, bend)
    np.testing.assert_allclose(velocity[3:6], spin(0.0), atol=1e-8)
    np.testing.assert_allclose(acceleration[3:6], (spin(1e-3) - spin(-1e-3)) / 2e-3, atol=1e-4)
    np.testing.assert_allclose(rotation(angles) @ velocity[:3], rate[:3], atol=1e-12)
    ahead, behind = (turned(t).T @ (rate + t * bend)[:3] for t in (h, -h))
    np.testing.assert_allclose(acceleration[:3], (ahead - behind) / (2 * h), atol=1e-8)
    found = coordinates_of(pose_of(place)[None], velocity[None])
    np.testing.assert_allclose(found, [place[None], rate[None]], atol=1e-12)


def plain_twist(q: np.ndarray, v: np.ndarray, bend: np.ndarray) -> list[np.ndarray]:
    """What ``twist_of`` gives, by NumPy's operations on whole arrays."""
    x, z = q[:, 4], q[:, 5]
    (q_rate, p, r), (b, a, c) = v[:, 3:6].T, bend[:, 3:6].T
    sine, cosine = np.sin(x), np.cos(x)

    def back(u: np.ndarray, v: np.ndarray, w: np.ndarray) -> np.ndarray:
        return np.stack([np.cos(z) * u + np.sin(z) * v, -np.sin(z) * u + np.cos(z) * v, w], axis=-1)

    turning = back(p, q_rate * cosine, -q_rate * sine)
    about_z, more = np.zeros((2, len(q), 3))
    about_z[:, 2], more[:, 2] = r, c
    spin, turn = turning + about_z, rotation(q[:, 3:6][:, ORDER])
    spun = back(a, b * cosine - p * q_rate * sine, -b * sine - p * q_rate * cosine)
    spun = spun - cross_products(about_z, turning) + more
    speed = times_transposed(turn, v[:, :3])
    pull = times_transposed(turn, bend[:, :3]) - cross_products(spin, speed)
    return [np.hstack([speed, spin, v[:, 6:]]), np.hstack([pull, spun, bend[:, 6:]])]


def plain_rates(angles: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """The rates that ``coordinates_of`` gives, by NumPy's operations on whole arrays."""
    (_, x, z), (p, q, r) = angles.T, velocity[:, 3:6].T
    about_y = (np.sin(z) * p + np.cos(z) * q) / np.cos(x)
    turned = [about_y, np.cos(z) * p - np.sin(z) * q, r + about_y * np.sin(x)]
    moved = times(rotation(angles[:, ORDER]), velocity[:, :3])
    return np.hstack([moved, np.stack(turned, axis=-1), velocity[:, 6:]])


@pytest.mark.parametrize("straight", [False, True])
def test_motions_have_the_bits_of_operations_on_whole_arrays(straight: bool) -> None:
    rng = np.random.default_rng(7)
    for count in (1, 2, 7, 46, 500):
        q, v, bend = rng.normal(size=(3, count, 16))
        for each in (q, v, bend):
            each[rng.random(each.shape) < 0.2], each[rng.random(each.shape) < 0.1] = 0.0, -0.0
            if straight:
                each[:, [1, 4, 5]] = 0.0
        found = twist_of(q, v, bend)
        assert [each.tobytes() for each in found] == [e.tobytes() for e in plain_twist(q, v, bend)]
        one_by_one = [twist_of(*row) for row in zip(q, v, bend, strict=True)]
        assert [np.stack(e).tobytes() for e in zip(*one_by_one, strict=True)] == [
            e.tobytes() for e in found
        ]
        places, rates = coordinates_of(pose_of(q), v)
        assert rates.tobytes() == plain_rates(places[:, 3:6], v).tobytes()


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
