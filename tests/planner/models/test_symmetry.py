"""Which limbs mirror each other, with which signs, and the coordinates that follow from it."""

import numpy as np
import pytest
from tests.robots.limbed_robots import CORNERS, HUMANOID, TWO, humanoid, legged_robot, quadruped

from aloft.planner.models.coordinates import mirrored_coordinates, sagittal_coordinates
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.models.symbolic_model import SymbolicModel
from aloft.planner.models.symmetry import mirrored_pairs, symmetrised, symmetrised_angles
from aloft.robots.description import RobotDescription, find_robot


def askew(robot: RobotDescription, by: float) -> RobotDescription:
    """The robot with one thigh's mass off by a share."""
    links = [
        link.model_copy(update={"mass": link.mass * (1.0 + by)}) if k == 3 else link
        for k, link in enumerate(robot.links)
    ]
    return robot.changed(links=tuple(links))


def test_pairs_of_a_quadruped() -> None:
    robot = quadruped()
    pairs = mirrored_pairs(robot)
    assert pairs is not None
    assert [pair.limbs for pair in pairs] == [(0, 1), (2, 3)]
    assert [sign for _, _, sign in pairs[0].joints] == [-1.0, 1.0, 1.0]
    assert [pair.contacts for pair in pairs] == [((0, 1),), ((2, 3),)]
    assert symmetrised(robot, pairs) is robot


def test_nearly_the_same_is_made_the_same_and_no_more() -> None:
    robot = askew(quadruped(), 0.01)
    pairs = mirrored_pairs(robot)
    assert pairs is not None
    exact = symmetrised(robot, pairs)
    again = mirrored_pairs(exact)
    assert again is not None
    assert symmetrised(exact, again) is exact
    assert exact.total_mass == pytest.approx(robot.total_mass)
    assert mirrored_pairs(askew(quadruped(), 0.05)) is None
    assert sagittal_coordinates(SymbolicModel(askew(quadruped(), 0.05))) is None


def test_a_small_products_sign_does_not_matter() -> None:
    """ANYmal C's hips have a product of inertia of the other sign, 2 % of their largest moment."""
    pairs = mirrored_pairs(find_robot("anymal_c"))
    assert pairs is not None and [pair.limbs for pair in pairs] == [(0, 1), (2, 3)]


def test_angles_that_are_almost_the_same() -> None:
    robot = quadruped()
    pairs = mirrored_pairs(robot) or ()
    angles = np.zeros(12)
    angles[[0, 3]] = 0.2002, -0.2
    angles[[1, 4]] = 0.5, 0.6
    found = symmetrised_angles(pairs, angles)
    assert found[[0, 3]].tolist() == [pytest.approx(0.2001), pytest.approx(-0.2001)]
    assert found[[1, 4]].tolist() == [0.5, 0.6]


@pytest.mark.parametrize("robot", [quadruped(), find_robot("bruce")], ids=lambda r: r.name)
def test_a_mirrored_motion_keeps_left_and_right_alike(robot: RobotDescription) -> None:
    """By Pinocchio: contact points mirror each other, and the angular momentum is about y only."""
    coordinates = mirrored_coordinates(SymbolicModel(robot))
    assert coordinates is not None
    rng = np.random.default_rng(2)
    v = coordinates.matrix @ rng.uniform(-1.0, 1.0, coordinates.size)
    q = np.concatenate([[0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0], v[6:]])
    speeds = np.concatenate([v[:3], [0.0, v[3], 0.0], v[6:]])
    dynamics = ExactDynamics(robot)
    _, com_velocity, momentum = dynamics.centroidal(q, speeds)
    assert abs(com_velocity[1]) < 1e-12
    assert np.abs(momentum[[0, 2]]).max() < 1e-12
    points = dynamics.points(q)
    pairs = mirrored_pairs(robot) or ()
    for one, other in (twins for pair in pairs for twins in pair.contacts):
        assert np.abs(points[one] - points[other] * [1.0, -1.0, 1.0]).max() < 1e-12


def test_the_plane_moves_fewer_joints() -> None:
    model = SymbolicModel(quadruped())
    plane, both = sagittal_coordinates(model), mirrored_coordinates(model)
    assert plane is not None
    assert both is not None
    assert (plane.size, both.size) == (7, 9)
    assert (plane.forces, both.forces) == (4, 6)
    splayed = np.zeros(model.size)
    splayed[[6, 9]] = 0.1, -0.1
    assert not plane.contains(splayed)
    assert both.contains(splayed)


def test_a_humanoid_with_inclined_hips() -> None:
    robot = legged_robot("humanoid", HUMANOID, [0.03, 0.0, -0.03], CORNERS, {}, TWO)
    pairs = mirrored_pairs(robot)
    assert pairs is not None
    assert [sign for _, _, sign in pairs[0].joints] == [1.0, -1.0, -1.0, 1.0, 1.0, -1.0]
    # A foot's left edge mirrors the other foot's right edge.
    assert pairs[0].contacts == ((0, 5), (1, 4), (2, 7), (3, 6))
    # One arm on the left, or a joint of the base's own, has no mirror image.
    assert mirrored_pairs(humanoid()) is None
