"""The load on each foot from torques: exact statics, an edge between the points, thresholds, robots of any feet."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.estimation.foot_load_estimator import FootLoadEstimator
from aloft.mathematics.constants import GRAVITY
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

UPRIGHT = [0.0, 0.0, 0.0, 1.0]


def terms_of(robot):
    bench = BlockBench(Dynamics, {}, robot=robot)
    bench.set("base", position=[0, 0, 0.4], orientation=UPRIGHT)
    bench.set("joints", position=robot.standing_position)
    bench.step()
    return {name: array.copy() for name, array in bench.get("terms")}


def estimate(robot, forces, ticks=100, **params):
    """The output where the points of a standing robot are under ``forces`` (n_contacts, 3) [N]."""
    bench, terms = BlockBench(FootLoadEstimator, params, robot=robot), terms_of(robot)
    jacobian = terms["contact_jacobian"].reshape(-1, terms["contact_jacobian"].shape[2])
    torque = terms["nonlinear_effects"][6:] - jacobian[:, 6:].T @ np.ravel(forces)
    bench.set("terms", **terms)
    bench.set("joints", torque=torque)
    for _ in range(ticks):
        bench.step()
    return bench, bench.get("load"), terms["contact_position"]


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 1.0])
def test_a_load_between_toe_and_heel_is_found_with_its_place(share):
    """What stands on an edge is felt as forces of both points, of which the edge is the mean."""
    robot, forces = find_robot("bruce"), np.zeros((4, 3))
    forces[0], forces[1] = (
        np.array([2.0, 1.0, 30.0]) * share,
        np.array([2.0, 1.0, 30.0]) * (1 - share),
    )
    _, load, points = estimate(robot, forces)
    assert load.force == pytest.approx([30.0, 0.0], abs=0.05)
    edge = share * points[0] + (1.0 - share) * points[1]
    assert load.centre[0] == pytest.approx(edge, abs=1e-3)
    assert load.loaded.tolist() == [True, False]


@pytest.mark.parametrize("name", ["go2", "g1", "solo12"])
def test_the_weight_of_other_robots_is_found(name):
    robot = find_robot(name)
    weight, points = robot.total_mass * GRAVITY, len(robot.contacts)
    forces = np.tile([0.0, 0.0, weight / points], (points, 1))
    _, load, _ = estimate(robot, forces)
    assert load.force.sum() == pytest.approx(weight, rel=0.02)
    assert load.loaded.all()


def test_a_foot_is_loaded_from_one_force_until_another():
    robot = find_robot("bruce")
    weight, seen = robot.total_mass * GRAVITY, []
    bench, load, _ = estimate(robot, np.zeros((4, 3)), begin=0.3, end=0.1)
    terms = terms_of(robot)
    jacobian = terms["contact_jacobian"].reshape(12, -1)
    for force in (0.2, 0.4, 0.2, 0.05, 0.2):
        forces = np.zeros((4, 3))
        forces[2, 2] = force * weight
        torque = terms["nonlinear_effects"][6:] - jacobian[:, 6:].T @ forces.ravel()
        bench.set("joints", torque=torque)
        for _ in range(50):
            bench.step()
        seen.append(bool(load.loaded[1]))
    assert seen == [False, True, True, False, False]


def test_the_force_is_filtered():
    robot, forces = find_robot("bruce"), np.tile([0.0, 0.0, 12.0], (4, 1))
    _, load, _ = estimate(robot, forces, ticks=1, filter_time=0.02)
    assert load.force == pytest.approx([2.4, 2.4], rel=0.01)
