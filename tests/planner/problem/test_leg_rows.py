"""Rows of the contact and the air piece that legs with balls, and legs one behind the other, need."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from aloft.planner.models.symbolic_model import SymbolicModel
from aloft.planner.problem.leg_rows import body_points, fore_and_hind
from aloft.planner.problem.obstacles import touching_sphere
from aloft.planner.problem.stage_functions import make_coordinates, piece_expressions
from aloft.planner.solving.solve import make_problem
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

GO2 = SymbolicModel(find_robot("go2"))
STANDING = np.concatenate([[0.0, 0.0, 0.3, 0.0, 0.0, 0.0], GO2.robot.standing_position])


def rows(name: str, piece: str, z: np.ndarray, w: np.ndarray) -> np.ndarray:
    """A piece's rows of Go2."""
    variables, parameters, _, found = piece_expressions(GO2, make_coordinates(GO2, name), piece)
    return np.array(ca.Function("rows", [variables, parameters], [found])(z, w)).ravel()


def material_velocity(q: np.ndarray, v: np.ndarray, contact: int) -> np.ndarray:
    """How fast [m/s] the point of a foot moves that is the lowest one now, by differences."""
    symbol = ca.SX.sym("q", GO2.size)
    place, radius = touching_sphere(GO2.robot, contact)
    link = {foot.name: foot.link for foot in GO2.robot.feet}[GO2.robot.contacts[contact].foot]
    rotation, origin = GO2.frames(symbol)[link]
    pose = ca.Function("pose", [symbol], [rotation, origin])
    turn, _ = (np.array(part) for part in pose(q))
    lowest = np.array(place) - turn.T @ [0.0, 0.0, radius]
    before, after = (
        np.array(pose(q + step * v)[0]) @ lowest + np.array(pose(q + step * v)[1]).ravel()
        for step in (-1e-6, 1e-6)
    )
    return np.asarray((after - before) / 2e-6)


def test_a_ball_of_a_leg_that_yaws_and_stretches_does_not_slip() -> None:
    random = np.random.default_rng(3)
    q = STANDING + 0.2 * random.standard_normal(GO2.size)
    v = random.standard_normal(GO2.size)
    heading = np.array([np.cos(0.3), np.sin(0.3)])
    contacts = len(GO2.robot.contacts)
    found = rows("full", "contact", np.concatenate([q, v]), np.concatenate([np.zeros(12), heading]))
    for contact in range(contacts):
        x, y, _ = material_velocity(q, v, contact)
        along, across = heading @ [x, y], heading @ [y, -x]
        np.testing.assert_allclose(found[3 * contact : 3 * contact + 2], [along, across], atol=1e-6)


def test_legs_one_behind_the_other_are_pairs_and_others_are_not() -> None:
    full = make_coordinates(GO2, "full")
    points = body_points(GO2, full)
    pairs = {
        (GO2.limb_of_link[points[a][0][0]], GO2.limb_of_link[points[b][0][0]])
        for a, b in fore_and_hind(GO2, full)
    }
    names = {(GO2.robot.feet[a].name, GO2.robot.feet[b].name) for a, b in pairs}
    assert names == {("FL", "RL"), ("FR", "RR")}
    plane = make_coordinates(GO2, "sagittal")
    assert 2 * len(fore_and_hind(GO2, plane)) == len(fore_and_hind(GO2, full))
    biped = SymbolicModel(find_robot("bruce"))
    assert not fore_and_hind(biped, make_coordinates(biped, "full"))


@pytest.mark.parametrize("pitch", [0.0, 0.6])
def test_gaps_of_legs_fall_below_zero_as_a_hind_foot_passes_a_fore_one(pitch: float) -> None:
    names = [joint.name for joint in GO2.robot.joints]
    count = len(fore_and_hind(GO2, make_coordinates(GO2, "full")))
    gaps = []
    for swing in (0.0, 0.9):
        q = STANDING.copy()
        q[3] = pitch
        for leg, way in (("FL", 1.0), ("RL", -1.0)):
            q[6 + names.index(f"{leg}_thigh_joint")] += way * swing
        gaps.append(rows("full", "air", q, np.zeros(0))[-count:].min())
    assert gaps[0] > 0.05 and gaps[1] < 0.0


@pytest.mark.long
def test_a_problem_asks_for_gaps_between_fore_and_hind_legs_in_flight() -> None:
    """Of the standing robot's at most: 20 cm are more than a knee has to the foot behind it."""
    task = {"robot": "go2", "name": "ahead", "rise": 0.1, "distance_x": 0.25, "leg_clearance": 0.2}
    problem = make_problem(make_task(task).resolved(GO2.robot), GO2.robot)
    pairs = fore_and_hind(GO2, problem.coordinates)
    found = problem.row_lower[np.array(problem.families) == "leg clearance"]
    sides = len(body_points(GO2, problem.coordinates))
    each = found.reshape(-1, sides + len(pairs))
    assert len(each) == problem.task.knots.flight - 1
    np.testing.assert_allclose(each[:, :sides], 0.1)
    gaps = each[:, sides:]
    assert 0.1 < gaps.min() < 0.199 and gaps.max() == pytest.approx(0.2)
