"""Joint feedback: blends are sums of torques, stops add theirs, targets follow accelerations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics.joint_feedback import (
    Feedback,
    Motion,
    SoftStops,
    add_friction,
    add_soft_stops,
    blend_feedback,
    integrate_accelerations,
)

RANDOM = np.random.default_rng(3)


def torque(feedback, at):
    return feedback.stiffness * (feedback.position - at.position) + feedback.damping * (
        feedback.velocity - at.velocity
    )


def test_a_blend_is_the_weighted_sum_of_both_torques():
    first, second = (Feedback(*RANDOM.random((4, 6))) for _ in range(2))
    weight, at = RANDOM.random(6), Motion(*RANDOM.normal(size=(2, 6)))
    out = Feedback(*np.zeros((4, 6)))
    blend_feedback(weight, first, second, at, out)
    wanted = weight * torque(first, at) + (1.0 - weight) * torque(second, at)
    assert torque(out, at) == pytest.approx(wanted)
    nothing = Feedback(*np.zeros((4, 6)))
    blend_feedback(weight, nothing, nothing, at, out)
    assert (out.position == at.position).all() and (out.velocity == at.velocity).all()


def test_friction_has_the_sign_of_the_velocity():
    out = np.ones(3)
    friction, damping = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.1, 0.01])
    add_friction(np.array([10.0, 0.0, -10.0]), friction, damping, 0.3, out)
    assert out == pytest.approx([1.1, 1.0, 0.6])


def test_integrated_targets_are_ahead_by_a_steady_acceleration():
    at, targets = Motion(np.zeros(1), np.zeros(1)), Motion(np.zeros(1), np.zeros(1))
    for _ in range(500):
        integrate_accelerations(0.002, 0.02, np.array([10.0]), at, targets)
    assert targets.velocity[0] == pytest.approx(10.0 * 0.02, rel=0.15)
    assert targets.position[0] == pytest.approx(10.0 * 0.02**2, rel=0.15)


@given(
    angle=st.floats(-2.5, 2.5),
    rate=st.floats(-20, 20),
    gains=st.tuples(*[st.floats(0, 100)] * 4),
    targets=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
)
def test_a_soft_stop_adds_its_own_torque_to_any_feedback(angle, rate, gains, targets):
    stiffness, damping = np.array([gains[0]]), np.array([gains[1]])
    position, velocity = np.array([targets[0]]), np.array([targets[1]])
    before = gains[0] * (targets[0] - angle) + gains[1] * (targets[1] - rate)
    limits, springs, dampers = np.array([[-1.0, 0.5]]), np.array([gains[2]]), np.array([gains[3]])
    feedback = Feedback(stiffness, position, damping, velocity)
    add_soft_stops(
        np.array([angle]),
        SoftStops(limits, np.array([0.1]), np.array([2.0]), springs, dampers),
        feedback,
    )
    after = stiffness[0] * (position[0] - angle) + damping[0] * (velocity[0] - rate)
    edge = min(max(angle, -0.9), 0.4)
    depth = abs(angle - edge) / 0.1
    added = 2.0 * gains[2] * (edge - angle) - 2.0 * min(depth, 1.0) * gains[3] * rate
    if stiffness[0] > 1e-9 and damping[0] > 1e-9:
        assert after - before == pytest.approx(added, abs=1e-6, rel=1e-9)
