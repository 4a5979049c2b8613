"""The torso's rows against their equation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.tasks.task import TaskError, TaskJacobian, feedback_rows
from aloft.blocks.control.tasks.torso_orientation import TorsoOrientation
from aloft.mathematics.whole_body_qp import TaskRows


def test_the_torso_turns_along_the_logarithm_in_the_body_frame():
    half = 0.15
    goal = np.array([np.sin(half), 0.0, 0.0, np.cos(half)])
    rate, goal_rate = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.5, 0.0])
    gains = (np.array([1.0, 2.0, 3.0]), np.full(3, 200.0), np.full(3, 28.0))
    rows = TaskRows(np.ones((3, 16)), np.zeros(3), np.zeros(3))
    terms = SimpleNamespace(base_rotation=np.eye(3), velocity=np.concatenate((np.ones(3), rate)))
    bend = np.array([0.0, 70.0, -1.0])
    target = SimpleNamespace(
        orientation=goal, angular_velocity=goal_rate, angular_acceleration=bend
    )
    e, j = TaskError(*np.zeros((3, 3))), TaskJacobian(rows.jacobian, np.zeros(3))
    params = SimpleNamespace(torso_feedforward=np.array(0.5))
    TorsoOrientation.error(terms, target, np.zeros(4), params, e)
    TorsoOrientation.jacobian(j)
    feedback_rows(e, j.drift, *gains, rows)
    expected = 0.5 * bend + 200.0 * np.array([0.3, 0.0, 0.0]) + 28.0 * (goal_rate - rate)
    assert rows.desired == pytest.approx(expected)
    selection = np.zeros((3, 16))
    selection[:, 3:6] = np.eye(3)
    assert (rows.jacobian == selection).all()
    assert rows.weights.tolist() == [1.0, 2.0, 3.0]
