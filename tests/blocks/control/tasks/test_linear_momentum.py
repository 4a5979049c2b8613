"""The rows of the centre of mass against their equation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.tasks.linear_momentum import LinearMomentum
from aloft.blocks.control.tasks.task import TaskError, TaskJacobian, feedback_rows
from aloft.mathematics.whole_body_qp import TaskRows

RANDOM = np.random.default_rng(7)


@pytest.mark.parametrize("mass", [5.0, 0.0])
def test_the_centre_of_mass_accelerates_by_feedforward_and_feedback(mass):
    matrix, drift = RANDOM.normal(size=(6, 16)), RANDOM.normal(size=6)
    com, speed, goal, goal_speed, push = RANDOM.normal(size=(5, 3))
    gains = (np.array([7.0, 8.0, 9.0]), np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))
    rows = TaskRows(np.zeros((3, 16)), np.zeros(3), np.zeros(3))
    terms = SimpleNamespace(
        mass_matrix=np.full((16, 16), mass), centroidal_matrix=matrix, centroidal_drift=drift,
        com=com, com_velocity=speed,
    )  # fmt: skip
    target = SimpleNamespace(com=goal, com_velocity=goal_speed, com_acceleration=push)
    e, j = TaskError(*np.zeros((3, 3))), TaskJacobian(rows.jacobian, np.zeros(3))
    LinearMomentum.error(terms, target, e)
    LinearMomentum.jacobian(terms, 4.0, j)
    feedback_rows(e, j.drift, *gains, rows)
    weighed = mass or 4.0
    assert rows.jacobian == pytest.approx(matrix[:3] / weighed)
    expected = push + gains[1] * (goal - com) + gains[2] * (goal_speed - speed)
    assert rows.desired == pytest.approx(expected - drift[:3] / weighed)
    assert rows.weights.tolist() == [7.0, 8.0, 9.0]
