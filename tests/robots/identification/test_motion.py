"""Biases come from where the robot stands; ticks near a change of contacts are left out."""

from __future__ import annotations

import numpy as np

from aloft.robots.identification.motion import MARGIN, Motion


def motion(ticks: int = 300, stands: int = 100) -> Motion:
    velocity = np.zeros((ticks, 10))
    velocity[stands:] = 2.0
    closed = np.ones((ticks, 4), dtype=np.bool_)
    closed[200:, 1] = False
    force = np.tile([0.1, -0.05, 9.81 + 0.08], (ticks, 1))
    force[stands:] += 5.0
    return Motion(
        0.002, np.zeros((ticks, 10)), velocity, np.zeros((ticks, 10)), np.full((ticks, 3), 0.01),
        force, np.tile([0.0, 0.0, 1.0], (ticks, 1)), closed,
    )  # fmt: skip


def test_biases_are_what_is_left_of_gravity_and_rest() -> None:
    force, rate = motion().sensor_biases()
    np.testing.assert_allclose(force, [0.1, -0.05, 0.08], atol=4e-3)
    np.testing.assert_allclose(rate, 0.01)


def test_a_robot_that_never_stands_has_no_biases() -> None:
    force, rate = motion(stands=5).sensor_biases()
    assert not force.any() and not rate.any()


def test_ticks_around_a_change_of_contacts_are_not_used() -> None:
    used = motion().usable().tolist()
    assert used[0] == MARGIN + 1
    assert not set(range(200 - MARGIN, 201 + MARGIN)) & set(used)
    assert {199 - MARGIN, 201 + MARGIN} <= set(used)
