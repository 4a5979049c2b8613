"""The rows of the angular momentum against their equation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.tasks.angular_momentum import AngularGains, AngularMomentum
from aloft.mathematics.whole_body_qp import TaskRows

RANDOM = np.random.default_rng(7)


@pytest.mark.parametrize("track", [False, True])
def test_angular_momentum_is_damped_or_tracked(track):
    terms = SimpleNamespace(
        centroidal_matrix=RANDOM.normal(size=(6, 16)), centroidal_drift=RANDOM.normal(size=6),
        angular_momentum=RANDOM.normal(size=3),
    )  # fmt: skip
    goal, rate = RANDOM.normal(size=(2, 3))
    target = SimpleNamespace(angular_momentum=goal, angular_momentum_rate=rate)
    damping = np.array([5.0, 6.0, 7.0])
    params = SimpleNamespace(
        angular_weight=(1.0, 2.0, 3.0),
        angular_damping=damping,
        track_angular_momentum=np.array(track),
    )
    assert set(vars(params)) == set(AngularGains.model_fields)
    rows = TaskRows(np.zeros((3, 16)), np.zeros(3), np.zeros(3))
    AngularMomentum.step(terms, target, params, rows)
    momentum, drift = terms.angular_momentum, terms.centroidal_drift[3:]
    expected = rate + damping * (goal - momentum) if track else -damping * momentum
    assert rows.desired == pytest.approx(expected - drift)
    assert (rows.jacobian == terms.centroidal_matrix[3:]).all()
    assert rows.weights.tolist() == [1.0, 2.0, 3.0]
