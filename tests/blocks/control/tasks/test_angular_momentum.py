"""The rows of the angular momentum against their equation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.tasks.angular_momentum import AngularGains, AngularMomentum
from aloft.mathematics.whole_body_qp import TaskRows
from aloft.robots.description import find_robot
from aloft.robots.kinematics import standing_feet

from ....robots.example_robots import needs_robots

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
        angular_by_size=np.array(not track),
        track_angular_momentum=np.array(track),
    )
    assert set(vars(params)) == set(AngularGains.model_fields)
    rows = TaskRows(np.zeros((3, 16)), np.zeros(3), np.zeros(3))
    AngularMomentum.step(terms, target, params, rows, 0.5)
    momentum, drift = terms.angular_momentum, terms.centroidal_drift[3:]
    expected = rate + damping * (goal - momentum) if track else -damping * momentum
    assert rows.desired == pytest.approx(expected - drift)
    assert (rows.jacobian == terms.centroidal_matrix[3:]).all()
    assert rows.weights.tolist() == ([1.0, 2.0, 3.0] if track else [0.5, 1.0, 1.5])


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "go2", "talos"])
def test_weights_mean_the_same_for_robots_of_any_size(name):
    """An N m counts by how fast it turns the robot: by 1 / (m h^2), squared, as the task's cost is."""

    def factor(robot):
        task = AngularMomentum.__new__(AngularMomentum)
        task.robot = robot
        task.setup()
        return task.size_factor

    robot = find_robot(name)
    height = -standing_feet(robot)[:, 2].mean()
    assert factor(find_robot("bruce")) == 1.0, "whose weights they are"
    assert factor(robot) == pytest.approx((0.553 / (robot.total_mass * height**2)) ** 2, rel=0.05)
