"""The rows of the centre of mass against their equation."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.tasks.linear_momentum import Centre, Feedback, linear_rows
from aloft.mathematics.whole_body_qp import TaskRows

RANDOM = np.random.default_rng(7)


def test_the_centre_of_mass_accelerates_by_feedforward_and_feedback():
    matrix, drift = RANDOM.normal(size=(6, 16)), RANDOM.normal(size=6)
    com, speed, goal, goal_speed, push = RANDOM.normal(size=(5, 3))
    gains = Feedback(
        np.array([7.0, 8.0, 9.0]), np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    )
    rows = TaskRows(np.zeros((3, 16)), np.zeros(3), np.zeros(3))
    linear_rows(matrix, 5.0, Centre(com, speed, drift), Centre(goal, goal_speed, push), gains, rows)
    assert rows.jacobian == pytest.approx(matrix[:3] / 5.0)
    wanted = push + gains.stiffness * (goal - com) + gains.damping * (goal_speed - speed)
    assert rows.desired == pytest.approx(wanted - drift[:3] / 5.0)
    assert rows.weights.tolist() == [7.0, 8.0, 9.0]
