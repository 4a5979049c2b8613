"""Hard jumps by way of easier ones, and the somersaults that come with aloft."""

import math
from pathlib import Path

import numpy as np
import pytest

from aloft.planner.checking.validity import check_plan
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.problem.guess import ballistic_guess
from aloft.planner.problem.unpacking import can_start
from aloft.planner.solving.easing import eased, tighten, with_impacts
from aloft.planner.solving.solve import make_problem, solve_jump
from aloft.planner.solving.solver import solve
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot
from aloft.robots.kinematics import matrices_of_quaternions

ROBOT = find_robot("bruce")
TASK = make_task({"recipe": "paper", "name": "jump", "rise": 0.15, "distance_x": 0.1})


def test_only_the_motors_are_made_stronger() -> None:
    problem = make_problem(TASK, ROBOT)
    stronger = eased(problem, 1.5)
    for k, family in enumerate(problem.families):
        factor = 1.5 if family.startswith("motor") else 1.0
        assert stronger.row_upper[k] == factor * problem.row_upper[k]
        assert stronger.row_lower[k] == factor * problem.row_lower[k]


def test_limits_come_down_to_the_real_ones() -> None:
    problem = make_problem(TASK, ROBOT)
    easy = solve(eased(problem, 1.5), ballistic_guess(problem), solver="fatrop")
    found = tighten(problem, easy.values, 1.5)
    assert found is not None
    assert found.solved
    direct = solve(problem, ballistic_guess(problem), solver="fatrop")
    assert found.cost == pytest.approx(direct.cost, rel=1e-4)
    assert found.cost > easy.cost


def test_limits_out_of_reach_are_not_reached() -> None:
    high = make_problem(make_task({"recipe": "paper", "name": "high", "rise": 0.45}), ROBOT)
    easy = solve(eased(high, 2.0), ballistic_guess(high), solver="fatrop")
    assert easy.solved
    assert tighten(high, easy.values, 2.0) is None


def test_a_soft_landing_is_a_start_for_a_hard_one() -> None:
    soft = solve_jump(TASK, ROBOT)
    hard = with_impacts(soft)
    assert len(hard.time) == len(soft.time) + 1
    problem = make_problem(TASK.model_copy(update={"impact": True}), ROBOT)
    assert can_start(problem, hard)
    k = int(np.flatnonzero(np.diff(hard.time) == 0.0)[0])
    assert hard.time[k] == soft.touchdown_time
    assert not hard.contact_force[k].any()


@pytest.mark.parametrize(
    ("name", "profile", "effort"),
    [
        ("somersault_in_place", "koala", 1.0),
        ("somersault_forward_35cm", "koala", 0.95),
        ("somersault_backward_35cm", "relaxed", 0.6),
    ],
)
def test_a_shipped_somersault_turns_over_and_is_exact(
    name: str, profile: str, effort: float, tmp_path: Path
) -> None:
    task = read_task(SHIPPED.parent / "tasks" / f"{name}.yaml")
    assert (task.equipped(ROBOT).motors.profile, task.effort) == (profile, effort)
    plan = PlanLibrary(ROBOT, tmp_path).find(task)
    assert plan is not None
    report = check_plan(plan, ROBOT)
    assert report.explain() == ""
    assert report.figures["flight_error_mm"] <= 1.0
    assert report.figures["flight_error_deg"] <= 0.5
    assert plan.statistics["violation"] <= 1e-6
    flying = (plan.time >= plan.lift_off_time - 1e-9) & (plan.time <= plan.touchdown_time + 1e-9)
    steps = np.diff(plan.time[flying])
    assert steps.max() <= 0.010
    # The torso turns over in the air, not only from first knot to last.
    matrix = matrices_of_quaternions(plan.position[:, 3:7])
    pitch = np.unwrap(np.arctan2(matrix[:, 0, 2], matrix[:, 2, 2]))
    in_air = pitch[flying][-1] - pitch[flying][0]
    assert abs(pitch[-1] - pitch[0] - task.rotation) < math.radians(1.0)
    assert abs(in_air) > math.radians(180.0)
