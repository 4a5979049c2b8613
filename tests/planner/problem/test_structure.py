"""The rows that hold a foot: as many as are independent, whichever points are on the ground."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.planner.models.coordinates import Coordinates
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.models.robot_model import StanceFinder
from aloft.planner.models.symbolic_model import SymbolicModel
from aloft.planner.problem.stage_functions import make_coordinates
from aloft.planner.problem.structure import ContactRows, is_mirrored, reduced_contacts
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


def coordinates(name: str) -> Coordinates:
    return make_coordinates(SymbolicModel(ROBOT), name)


def rows_of(name: str) -> ContactRows:
    stance = StanceFinder(ROBOT).place(ROBOT.standing_position)
    return ContactRows(ROBOT, coordinates(name), stance.points)


@pytest.mark.parametrize(
    ("points", "count"), [((0, 1, 2, 3), 10), ((0, 2), 6), ((1, 3), 6), ((0, 1), 5), ((3,), 3)]
)
def test_rows_are_independent_and_all_there_are(points: tuple[int, ...], count: int) -> None:
    rows = rows_of("full").velocities(set(points))
    q = np.concatenate([[0.0, 0.0, 0.35, 0.0, 0.0, 0.0, 1.0], ROBOT.standing_position])
    jacobian = ExactDynamics(ROBOT).contact_jacobians(q)[1]
    all_rows = np.concatenate([3 * point + np.arange(3) for point in points])
    assert len(rows) == count == np.linalg.matrix_rank(jacobian[rows])
    assert np.linalg.matrix_rank(jacobian[all_rows]) == count


def test_speeds_of_points_that_hit_the_ground() -> None:
    rows = rows_of("full")
    assert rows.speeds({0, 2}, [2]).tolist() == [2, 8]
    assert rows.speeds({1}, [0, 1, 2]).tolist() == [3, 4, 5]
    assert rows_of("sagittal").speeds({0, 1}, [1]).tolist() == [1, 3]
    assert len(rows.speeds({0, 1}, [])) == 0


def test_a_point_that_comes_down_beside_another() -> None:
    rows = rows_of("full")
    errors = 12
    assert (rows.places({0, 1, 2, 3}, {0, 2}) - errors).tolist() == [4, 5, 10, 11]
    assert len(rows.places({0, 2}, {0, 2})) == 0


def test_a_mirrored_motion_stands_on_both_feet_alike() -> None:
    plane = coordinates("sagittal")
    assert reduced_contacts(plane, (0, 1, 2, 3)) == {0, 1}
    assert is_mirrored(plane, (0, 2))
    assert is_mirrored(plane, (0, 1, 2, 3))
    assert not is_mirrored(plane, (0, 1))
    assert not is_mirrored(plane, (0,))
