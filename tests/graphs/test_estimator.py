"""The jump driven by the invariant filter: it lands, and the estimate is near the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aloft

GRAPH = Path(aloft.__file__).parent / "graphs" / "estimator.yaml"


def test_a_jump_driven_by_the_invariant_filter() -> None:
    settings = {"estimator.use": "blocks.InvariantKalmanFilter", "robot.seed": 5}
    result = aloft.load(GRAPH, settings).run(log=False)
    assert result.success, result.reason
    found = result.metrics
    assert found["estimator_flights"] == 1
    for name, bound in (
        ("velocity_lift_off_m_s", 0.012), ("velocity_touchdown_m_s", 0.018),
        ("position_touchdown_m", 0.006), ("attitude_touchdown_rad", 0.008),
    ):  # fmt: skip
        value = found[f"estimator_{name}"]
        assert isinstance(value, float) and 0.0 < value < bound, name


@pytest.mark.long
def test_every_onlooker_sees_the_same_jump() -> None:
    path = GRAPH.with_name("estimator_watching.yaml")
    onlookers = ({}, {"estimator.use": "blocks.ComplementaryFilter", "contacts.hold": "0 s"})
    runs = [aloft.load(path, {"robot.seed": 5, **settings}).run() for settings in onlookers]
    driven = aloft.load(GRAPH, {"robot.seed": 5}).run()
    for name in ("safety.command.torque", "robot.truth.com", "phase.phase.phase"):
        values = [run.signal(name) for run in (*runs, driven)]
        assert len(values[0]) > 500, name
        assert np.array_equal(values[0], values[1]), name
        assert np.array_equal(values[0], values[2]), name
    bases = [run.signal("estimator.base.linear_velocity") for run in runs]
    assert not np.array_equal(*bases), "the onlookers themselves differ"


def test_an_onlooker_is_wrong_without_a_fall() -> None:
    settings = {"estimator.use": "blocks.ComplementaryFilter", "robot.seed": 5}
    path = GRAPH.with_name("estimator_watching.yaml")
    result = aloft.load(path, settings).run(log=False)
    assert result.success, result.reason
    error = result.metrics["estimator_velocity_touchdown_m_s"]
    assert isinstance(error, float) and error > 0.1, "it would not land a jump of its own"
