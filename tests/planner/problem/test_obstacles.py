"""Legs and body keep above a step."""

import math
from typing import Any

import numpy as np
import pytest
from tests.robots.example_robots import needs_robots

from aloft.planner.library.library import solve_and_check
from aloft.planner.models.coordinates import full_coordinates, sagittal_coordinates
from aloft.planner.models.symbolic_model import SymbolicModel
from aloft.planner.problem.layout import layout
from aloft.planner.problem.obstacles import (
    ObstacleRows,
    heights_above_step,
    obstacle_points,
    side_clearance,
    step_parameters,
)
from aloft.planner.solving.solve import make_problem
from aloft.planner.task.phase import Phase
from aloft.planner.task.read_task import edge_room
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot
from aloft.robots.kinematics import fall_height
from aloft.robots.robot_description import RobotDescription

ROBOT = find_robot("bruce")
MODEL = SymbolicModel(ROBOT)


def test_the_last_link_of_a_leg_that_ends_in_a_ball_keeps_off_the_ground_by_its_upper_half() -> (
    None
):
    robot = find_robot("go2")
    model = SymbolicModel(robot)
    coordinates = full_coordinates(model)
    points = obstacle_points(model, coordinates)
    ends = {foot.link: np.array(foot.sole) for foot in robot.feet}
    shanks = [(np.array(place), link) for kind, (link, place), _ in points if kind == "shank"]
    assert {link for _, link in shanks} == set(ends)
    assert all(np.linalg.norm(place - ends[link]) > 0.1 for place, link in shanks)
    rows = ObstacleRows(model, coordinates)
    level = make_task({"robot": "go2", "name": "a", "rise": 0.1, "distance_x": 0.5})
    step = level.model_copy(update={"landing_height": 0.08})
    for task, edge in ((level, None), (step, 0.25)):
        stance = layout(task.resolved(robot), robot)[0]
        found = rows.rows(task.hops()[0], edge, stance, False)
        assert sum(points[k][0] == "shank" for k in found) == len(shanks)


def standing(x: float) -> np.ndarray:
    return np.concatenate([[x, 0.0, 0.3796, 0.0, 0.0, 0.0], ROBOT.standing_position])


def toe_ahead() -> float:
    import casadi as ca

    q = ca.SX.sym("q", MODEL.size)
    place = ca.Function("toe", [q], [MODEL.contact_points(q)[0]])
    return float(np.array(place(standing(0.0)))[0, 0])


def heights(x: float, **hop: Any) -> dict[str, float]:
    """The standing robot's points with its base at ``x``, by index and kind."""
    import casadi as ca

    coordinates = full_coordinates(MODEL)
    task = make_task({"recipe": "paper", "name": "step", "rise": 0.15, **hop})
    start, end = task.places()
    w = step_parameters(task.hops()[0], hop.get("step_edge"), start, end, 0.3, task.leans)
    q = ca.SX.sym("q", coordinates.size)
    rows = ca.vertcat(*heights_above_step(MODEL, coordinates, q, w))
    found = np.array(ca.Function("rows", [q], [rows])(standing(x))).ravel()
    kinds = [kind for kind, _, _ in obstacle_points(MODEL, coordinates)]
    return {f"{kind} {k}": found[k] for k, kind in enumerate(kinds)}


def test_points_are_contacts_then_capsules_of_the_computed_limbs() -> None:
    full = [kind for kind, _, _ in obstacle_points(MODEL, full_coordinates(MODEL))]
    assert full[:4] == ["foot"] * 4
    assert full.count("calf") == 6
    assert full.count("shin") == 12
    assert full.count("body") == len(full) - 22 == 3 * 5
    plane = sagittal_coordinates(MODEL)
    assert plane is not None
    half = [kind for kind, _, _ in obstacle_points(MODEL, plane)]
    assert (half.count("foot"), half.count("calf")) == (2, 3)


@pytest.mark.parametrize(("step", "way"), [(0.1, 1.0), (-0.2, 1.0), (0.1, -1.0), (-0.2, -1.0)])
def test_a_step_counts_from_its_edge_on_and_the_higher_ground_a_little_further(
    step: float, way: float
) -> None:
    hop = {"landing_height": step, "distance_x": 0.4 * way, "step_edge": 0.2 * way}
    before, after = heights(-0.3 * way, **hop), heights(0.7 * way, **hop)
    for name, height in before.items():
        assert height - after[name] == pytest.approx(step, abs=1e-3)
    toe = "foot 0"
    at_edge = heights(0.2 * way - toe_ahead(), **hop)[toe]
    higher = min(before[toe], after[toe])
    assert at_edge == pytest.approx(higher, abs=0.01 * abs(step))


@needs_robots
@pytest.mark.parametrize(
    ("step", "way"),
    [(-0.2, 1.0), (-0.2, -1.0), (0.12, 1.0), (-0.12, 1.0)],  # its knees are just above the last
)
def test_folding_knees_keep_off_a_step_s_side(step: float, way: float) -> None:
    """As far as from the ground, or as the standing robot is, whose knees would be in the way for ever."""
    robot = find_robot("go2")

    def beside(edge: float, robot: RobotDescription = robot, **more: Any) -> float:
        said = {
            "rise": 0.2,
            "distance_x": 0.9 * way,
            "landing_height": step,
            "step_edge": edge,
            **more,
        }
        task = make_task({"name": "jump", "robot": robot.name, **said})
        return side_clearance(robot, task.hops()[0], edge, *task.places(), 0.03)

    task = make_task(
        {"name": "a", "robot": "go2", "rise": 0.2, "distance_x": 0.9 * way, "landing_height": step}
    )
    before, behind = edge_room(robot, task.hops()[0], *task.places(), 0.03)
    assert (behind - before) * way > 0.1
    tight = before if step > 0.0 else behind
    inwards = math.copysign(1.0, 0.5 * (before + behind) - tight)
    assert beside(0.5 * (before + behind)) == 0.03
    assert beside(tight + 0.03 * inwards) == pytest.approx(0.01)
    assert beside(tight + 0.01 * inwards) == 0.0
    assert beside(0.5 * (before + behind), rotation="360 deg") == 0.0
    assert beside(0.45 * way, ROBOT) == 0.0, "legs with ankles"


@pytest.mark.parametrize("step", [0.1, -0.1])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_is_kept_beside_a_step_is_on_its_lower_side(step: float, way: float) -> None:
    task = make_task({"name": "a", "rise": 0.2, "distance_x": 0.4 * way, "landing_height": step})
    hop, places = task.hops()[0], task.places()
    moved = step_parameters(hop, 0.2 * way, *places, 0.5, False, 0.03)["edge"] - 0.2 * way
    assert moved == pytest.approx(0.03 * way * (-1.0 if step > 0.0 else 1.0))


def test_ground_that_leans_is_a_plane_on_either_side_of_its_edge() -> None:
    way = {"distance_x": 0.4, "step_edge": 0.2, "slope": [0.0, 0.0], "landing_slope": [0.2, 0.0]}
    before, after = heights(-0.3, **way), heights(0.7, **way)
    level = heights(0.7, distance_x=0.4)
    name = "foot 0"
    assert before[name] == pytest.approx(level[name], abs=1e-6)
    rise = math.tan(0.2) * (0.7 + toe_ahead() - 0.4)
    assert level[name] - after[name] == pytest.approx(rise, abs=1e-6)


def test_which_points_are_watched() -> None:
    rows = ObstacleRows(MODEL, full_coordinates(MODEL))
    for values, in_flight, on_ground in (
        ({}, 0, 0),
        ({"landing_height": 0.05, "distance_x": 0.1}, 18, 18),
        ({"rotation": "360 deg"}, 25, 21),
    ):
        task = make_task({"recipe": "paper", "name": "jump", "rise": 0.15, **values})
        hop, edge = task.hops()[0], 0.05 if values.get("distance_x") else None
        squat, _, flight, _ = layout(task, ROBOT)
        assert len(rows.rows(hop, edge, flight, False)) == in_flight
        assert len(rows.rows(hop, edge, squat, True)) == on_ground


def test_all_but_the_feet_keeps_off_the_ground_on_ball_feet() -> None:
    """While they stand: a leg with no ankle can fold until its knee touches."""
    for robot, watched in ((find_robot("go2"), True), (ROBOT, False)):
        model = SymbolicModel(robot)
        coordinates = full_coordinates(model)
        task = make_task({"recipe": "paper", "name": "up", "robot": robot.name, "rise": 0.1})
        rows = ObstacleRows(model, coordinates)
        points = obstacle_points(model, coordinates)
        for problem_phase in layout(task, robot):
            found = rows.rows(task.hops()[0], None, problem_phase, False)
            links = {points[row][1][0] for row in found}
            bodies = {link.name for link in robot.links if link.shapes}
            expected = bodies if watched and not problem_phase.flies else set()
            assert links == expected, problem_phase.phase


@pytest.mark.long
def test_knees_keep_off_the_ground_also_at_the_end() -> None:
    """Where only the base is given: the last knot has no interval, and its joints are free."""
    for robot, watched in ((find_robot("go2"), True), (ROBOT, False)):
        task = make_task({"name": "up", "robot": robot.name, "rise": 0.1})
        last = make_problem(task, robot).assembly.knots[-1]
        assert ("obstacle" in last.pieces) is watched


@pytest.mark.parametrize("ahead", [0.15, 0.2])
def test_a_high_step_is_jumped_onto_and_not_touched(ahead: float) -> None:
    task = {
        "recipe": "paper",
        "name": "up",
        "rise": 0.15,
        "landing_height": 0.1,
        "distance_x": ahead,
    }
    assert solve_and_check(make_task(task), ROBOT).valid


def test_a_base_on_legs_that_fold_stays_above_what_counts_as_a_fall() -> None:
    """On the ground, by the gap that knees have; and above the step on which it lands."""
    for robot, bound in ((find_robot("go2"), True), (ROBOT, False)):
        task = make_task(
            {
                "name": "up",
                "robot": robot.name,
                "rise": 0.2,
                "distance_x": 0.5,
                "landing_height": 0.1,
            }
        ).resolved(robot)
        problem = make_problem(task, robot)
        height = problem.coordinates.free_base.index(2)
        lows = {problem.phase_at(k).phase: problem.lower[problem.assembly.state_start[k] + height]
                for k in range(2, problem.knots - 1)}  # fmt: skip
        least = fall_height(robot) + (task.margins.step if task.margins else 0.0)
        assert lows[Phase.FLIGHT] == -np.inf
        assert lows[Phase.SQUAT] == (pytest.approx(least) if bound else -np.inf)
        assert lows[Phase.LANDING] == (pytest.approx(least + 0.1) if bound else -np.inf)
