"""The load on each foot from torques: exact statics, an edge between the points, thresholds, robots of any feet."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.estimation.foot_load_estimator import FootLoadEstimator
from aloft.blocks.signals import Phase
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
    weight, points = robot.weight, len(robot.contacts)
    forces = np.tile([0.0, 0.0, weight / points], (points, 1))
    _, load, _ = estimate(robot, forces)
    assert load.force.sum() == pytest.approx(weight, rel=0.02)
    assert load.loaded.all()


def test_a_foot_is_loaded_from_one_force_until_another():
    robot = find_robot("bruce")
    weight, seen = robot.weight, []
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


class Landed:
    """BRUCE under forces on its right foot, after a touchdown."""

    def __init__(self, **params):
        self.robot = find_robot("bruce")
        self.bench, self.terms = (
            BlockBench(FootLoadEstimator, params, robot=self.robot),
            terms_of(self.robot),
        )

    def contacts(
        self, active, heights, loaded, phase=Phase.LANDING, closed=None, speed=0.2, ticks=60
    ):
        """The contacts after ``ticks`` in which the points rise with ``speed``."""
        terms, forces = {name: array.copy() for name, array in self.terms.items()}, np.zeros((4, 3))
        forces[:2, 2] = 15.0 * loaded
        jacobian = terms["contact_jacobian"].reshape(12, -1)
        torque = terms["nonlinear_effects"][6:] - jacobian[:, 6:].T @ forces.ravel()
        terms["contact_position"][:, 2] = heights
        terms["contact_velocity"][:, 2] = speed
        self.bench.set("terms", **terms)
        self.bench.set("joints", torque=torque)
        self.bench.set("switches", active=active)
        self.bench.set("closed", closed=active if closed is None else closed)
        self.bench.set("phase", phase=phase)
        for _ in range(ticks):
            self.bench.step()
        return self.bench.get("contacts").active.tolist()


NONE, HEEL = [False] * 4, [False, True, False, False]


def test_a_sole_across_an_edge_is_in_contact_by_the_torques_of_its_leg():
    foot = Landed(flat_height=0.006)
    assert foot.contacts(HEEL, [0.02, 0.01, 0.03, 0.03], True) == HEEL
    # the toe has come down to 5 mm above where the heel has touched; then the heel lifts off by 4 mm
    assert foot.contacts(NONE, [0.015, 0.01, 0.03, 0.03], True) == [True, True, False, False]
    assert foot.contacts(NONE, [0.0, 0.014, 0.03, 0.03], True) == [True, True, False, False]
    # 7 mm above where it has touched a point does not stand, even while its contact is held
    assert foot.contacts(NONE, [0.0, 0.017, 0.03, 0.03], True) == [True, False, False, False]
    assert foot.contacts(HEEL, [0.0, 0.017, 0.03, 0.03], True) == [True, True, False, False]
    assert foot.contacts(NONE, [0.0, 0.017, 0.03, 0.03], True) == [True, False, False, False]


def test_a_foot_whose_first_contact_is_an_edge_stands_on_all_its_points():
    assert Landed().contacts(NONE, [0.0, 0.02, 0.0, 0.0], True) == [True, True, False, False]


def test_without_load_or_before_the_touchdown_only_switches_count():
    foot, heights = Landed(), [0.0, 0.0, 0.0, 0.0]
    assert foot.contacts(HEEL, heights, True, Phase.FLIGHT) == HEEL
    assert foot.contacts(HEEL, heights, False) == HEEL
    assert foot.contacts(NONE, heights, False) == NONE


def test_a_foot_that_was_in_the_air_forgets_where_it_stood():
    foot = Landed(flat_height=0.006)
    foot.contacts(HEEL, [0.0, 0.0, 0.0, 0.0], True)
    foot.contacts(NONE, [0.03, 0.03, 0.0, 0.0], False)
    assert foot.contacts(HEEL, [0.025, 0.02, 0.0, 0.0], True) == [True, True, False, False]


def test_a_contact_that_is_only_held_ends_where_its_point_has_risen():
    foot, both, up = Landed(flat_height=0.006), [True, True, False, False], [0.017, 0.0, 0.0, 0.0]
    assert foot.contacts(both, [0.01, 0.01, 0.0, 0.0], True) == both
    assert foot.contacts(both, up, True, closed=HEEL) == HEEL
    assert foot.contacts(both, [0.015, 0.0, 0.0, 0.0], True, closed=HEEL) == both, "5 mm up"
    assert foot.contacts(both, up, True) == both, "its switch is closed"


def test_a_point_that_rests_while_its_foot_is_loaded_stands_until_it_rises():
    """A sole on its heel and across an edge: the toe is up, and nothing but the edge can hold it."""
    foot, both, up = Landed(flat_height=0.006), [True, True, False, False], [0.013, 0.0, 0.0, 0.0]
    assert foot.contacts(HEEL, up, True) == HEEL, "it moves"
    assert foot.contacts(HEEL, up, True, speed=0.04, ticks=4) == HEEL, "8 ms of rest"
    assert foot.contacts(HEEL, up, True, speed=0.04, ticks=1) == both
    assert foot.contacts(HEEL, [0.018, 0.0, 0.0, 0.0], True) == both, "5 mm above where it rested"
    assert foot.contacts(HEEL, [0.0, 0.0, 0.0, 0.0], True, speed=-1.0) == both, (
        "it goes down under load"
    )
    assert foot.contacts(HEEL, [0.02, 0.0, 0.0, 0.0], True) == HEEL
    unloaded = Landed(flat_height=0.006)
    assert unloaded.contacts(HEEL, up, False, speed=0.0) == HEEL, "a foot in the air may be still"
