"""The planner's discretisation evaluated anew: Euler angles, and a motion that fulfils it."""

from dataclasses import replace

import numpy as np
import pytest

from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.models.midpoint import (
    angular_motion,
    euler_angles,
    euler_rates,
    midpoint_residuals,
    rotation,
)
from aloft.planner.task.plan import PlannedJump
from aloft.robots.description import find_robot


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


def test_the_residual_is_what_a_force_is_wrong_by(by_hand: PlannedJump) -> None:
    dynamics = ExactDynamics(find_robot("bruce"))
    gap, wrench = midpoint_residuals(by_hand, dynamics)
    # Made with small steps of another method: fulfilled to second order only.
    assert gap.max() < 1e-2
    assert np.median(wrench) < 1.0
    pushed = by_hand.contact_force.copy()
    pushed[20, 0] += [0.0, 7.0, 0.0]
    _, changed = midpoint_residuals(replace(by_hand, contact_force=pushed), dynamics)
    assert changed[20] - wrench[20] == pytest.approx(7.0, abs=0.5)
    np.testing.assert_array_equal(np.delete(changed, 20), np.delete(wrench, 20))
