"""The whole-body controller with round friction cones."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.blocks.signals import Phase
from aloft.lab.benchmarks.full_program import rows_without_pyramids
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
FRICTION = 0.1


@pytest.fixture(scope="module")
def terms():
    bench = BlockBench(Dynamics, robot=ROBOT)
    bench.set("base", position=[0.0, 0.0, 0.38], orientation=[0.0, 0.0, 0.0, 1.0])
    bench.set("joints", position=ROBOT.standing_position)
    bench.step()
    return {name: array.copy() for name, array in bench.get("terms")}


def solved(terms, **params):
    """The controller where the centre of mass is accelerated aside by more than friction allows."""
    bench = BlockBench(WholeBodyController, {"friction": FRICTION, **params}, robot=ROBOT)
    bench.set("terms", **terms)
    bench.set("phase", phase=Phase.STAND, stance=[True] * 4)
    aside = [2.0, 1.9, 0.0]
    bench.set("target", com=terms["com"], com_acceleration=aside, orientation=[0.0, 0.0, 0.0, 1.0])
    bench.step()
    return bench


def steepness(bench):
    force = bench.get("command").force
    return np.hypot(force[:, 0], force[:, 1]) / np.maximum(force[:, 2], 1e-9)


def test_the_cone_is_round(terms):
    pyramid, round_one = solved(terms), solved(terms, cones="round")
    assert bool(round_one.get("command").solved)
    assert steepness(pyramid).max() > 1.2 * FRICTION  # in the pyramid's corner
    assert steepness(round_one).max() == pytest.approx(FRICTION, abs=1e-9)


def test_clarabel_finds_the_same_with_the_whole_program(terms):
    own, other = solved(terms, cones="round"), solved(terms, cones="round", solver="clarabel")
    assert bool(other.get("command").solved)
    assert other.get("command").torque == pytest.approx(own.get("command").torque, abs=1e-5)


def test_other_solvers_are_refused():
    with pytest.raises(
        BlockError, match=r"daqp cannot solve a program with round cones; active_set"
    ):
        BlockBench(WholeBodyController, {"cones": "round", "solver": "daqp"}, robot=ROBOT)


def test_only_the_sides_of_pyramids_are_left_out():
    kept = rows_without_pyramids(2, 32)
    assert np.flatnonzero(~kept).tolist() == [0, 1, 2, 3, 6, 7, 8, 9]
