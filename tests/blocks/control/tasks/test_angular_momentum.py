"""The rows of the angular momentum against their equation."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.tasks.angular_momentum import Feedback, Momentum, angular_rows
from aloft.mathematics.whole_body_qp import TaskRows

RANDOM = np.random.default_rng(7)


@pytest.mark.parametrize("track", [False, True])
def test_angular_momentum_is_damped_or_tracked(track):
    matrix = RANDOM.normal(size=(6, 16))
    momentum, drift, goal, rate = RANDOM.normal(size=(4, 3))
    damping = np.array([5.0, 6.0, 7.0])
    rows = TaskRows(np.zeros((3, 16)), np.zeros(3), np.zeros(3))
    gains = Feedback(np.array([1.0, 2.0, 3.0]), damping, track)
    angular_rows(matrix, Momentum(momentum, drift), Momentum(goal, rate), gains, rows)
    wanted = rate + damping * (goal - momentum) if track else -damping * momentum
    assert rows.desired == pytest.approx(wanted - drift)
    assert (rows.jacobian == matrix[3:]).all()
    assert rows.weights.tolist() == [1.0, 2.0, 3.0]
