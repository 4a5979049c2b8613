"""Tasks become valid plans; what cannot be planned says why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.planner.checking.validity import check_plan
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.problem.guess import ballistic_guess
from aloft.planner.solving.solve import make_problem, solve_jump
from aloft.planner.task.errors import PlanError
from aloft.planner.task.plan import ARRAYS
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

from ..independence import smallest_singular_value

ROBOT = find_robot("bruce")
FORWARD = make_task({"recipe": "paper", "name": "forward", "rise": 0.15, "distance_x": 0.1})


@pytest.mark.parametrize(
    "task",
    [
        {"rise": 0.15},
        {"rise": 0.15, "distance_x": -0.1},
        {"rise": 0.15, "landing_height": 0.05, "distance_x": 0.1},
        {"rise": 0.12, "landing_height": -0.05, "distance_x": 0.1},
        {"take_off_speed": 1.5, "flight_time": 0.3},
    ],
)
def test_a_jump_straight_ahead_is_valid(task: dict[str, Any]) -> None:
    plan = solve_jump(make_task({"recipe": "paper", "name": "jump", **task}), ROBOT)
    assert check_plan(plan, ROBOT).explain() == ""
    assert plan.statistics["violation"] <= 1e-6
    assert plan.statistics["solver"] == "fatrop"


def test_the_same_task_gives_the_same_bytes() -> None:
    first, second = solve_jump(FORWARD, ROBOT), solve_jump(FORWARD, ROBOT)
    for name in ARRAYS:
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes(), name


def test_ipopt_finds_the_same_optimum() -> None:
    fatrop, ipopt = solve_jump(FORWARD, ROBOT), solve_jump(FORWARD, ROBOT, solver="ipopt")
    assert ipopt.statistics["solver"] == "ipopt"
    cost = fatrop.statistics["cost"]
    assert ipopt.statistics["cost"] == pytest.approx(cost, rel=1e-3)
    assert np.abs(fatrop.com - ipopt.com).max() < 2e-3


def test_without_a_compiler_the_plan_is_the_same() -> None:
    compiled, interpreted = solve_jump(FORWARD, ROBOT), solve_jump(FORWARD, ROBOT, compiled=False)
    assert not interpreted.statistics["compiled"]
    assert np.abs(compiled.com - interpreted.com).max() < 1e-6


def test_a_near_plan_saves_iterations() -> None:
    near = make_task({"recipe": "paper", "name": "near", "rise": 0.15, "distance_x": 0.09})
    cold, warm = (
        solve_jump(near, ROBOT),
        solve_jump(near, ROBOT, warm_start=solve_jump(FORWARD, ROBOT)),
    )
    assert warm.statistics["warm"]
    assert warm.statistics["iterations"] < 0.7 * cold.statistics["iterations"]
    assert np.abs(warm.com - cold.com).max() < 2e-3


@pytest.mark.parametrize(
    ("neighbour", "change"),
    [
        ("forward_20cm", {"rise": 0.085, "distance_x": 0.215}),
        ("turn_60deg", {"rise": 0.095, "twist": 1.1}),
    ],
)
def test_a_start_from_a_neighbour_takes_fewer_iterations_to_a_plan_as_good(
    tmp_path: Path, neighbour: str, change: dict[str, float]
) -> None:
    library = PlanLibrary(ROBOT, tmp_path)
    task = read_task(SHIPPED.parent / "tasks" / f"{neighbour}.yaml").model_copy(update=change)
    found = library.nearest(task)
    assert found is not None
    warm = solve_jump(task, ROBOT, warm_start=found[0])
    cold = solve_jump(task, ROBOT)
    assert warm.statistics["warm"]
    assert warm.statistics["iterations"] <= 0.9 * cold.statistics["iterations"]
    assert warm.statistics["cost"] == pytest.approx(cold.statistics["cost"], rel=0.01)
    assert check_plan(warm, ROBOT).explain() == ""


def test_a_jump_beyond_the_motors_is_refused_with_a_family() -> None:
    with pytest.raises(PlanError, match="no plan for 'moon'") as caught:
        solve_jump(make_task({"recipe": "paper", "name": "moon", "rise": 0.8}), ROBOT)
    assert caught.value.family
    assert caught.value.violation > 1e-6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"profile": "petrol"}, "there is koala, relaxed"),
        ({"initial": {"right_ankle": 0.1}}, "do not lie in one plane"),
    ],
)
def test_what_cannot_be_planned_is_named(change: dict[str, Any], message: str) -> None:
    task = make_task({"recipe": "paper", "name": "odd", "rise": 0.1, **change})
    with pytest.raises(PlanError, match=message):
        solve_jump(task, ROBOT)


def test_derivatives_are_those_of_the_constraints() -> None:
    problem = make_problem(FORWARD, ROBOT)
    functions, parameters = problem.assembly.functions(), problem.parameters
    rng = np.random.default_rng(1)
    x = ballistic_guess(problem) + 0.001 * rng.normal(size=problem.assembly.variables)
    way, step = rng.normal(size=len(x)), 1e-6
    weights = rng.normal(size=problem.assembly.constraints)

    def rows(at: Any) -> Any:
        return np.array(functions["nlp_g"](at, parameters)).ravel()

    def slope(at: Any) -> Any:
        return np.array(functions["nlp_hess_l"](at, parameters, 0.7, weights)[0]).ravel()

    def lagrangian(at: Any) -> float:
        return 0.7 * float(functions["nlp_f"](at, parameters)) + float(weights @ rows(at))

    jacobian = functions["nlp_jac_g"](x, parameters)[1]
    hessian = functions["nlp_hess_l"](x, parameters, 0.7, weights)[1]
    there, back = x + step * way, x - step * way
    scale = np.abs(np.array(jacobian @ way)).max()
    change = (rows(there) - rows(back)) / (2 * step)
    assert np.abs(np.array(jacobian @ way).ravel() - change).max() < 1e-6 * scale
    change = (lagrangian(there) - lagrangian(back)) / (2 * step)
    assert slope(x) @ way == pytest.approx(change, rel=1e-5)
    change = (slope(there) - slope(back)) / (2 * step)
    bend = np.array(hessian @ way).ravel()
    assert np.abs(bend - change).max() < 1e-5 * np.abs(bend).max()


def test_equations_are_independent_at_the_guess() -> None:
    problem = make_problem(FORWARD, ROBOT)
    assert smallest_singular_value(problem, ballistic_guess(problem)) > 1e-7


def test_a_quick_solve_aside_starts_from_the_jump_ahead_not_from_a_plan_in_the_plane() -> None:
    here = solve_jump(make_task({"recipe": "paper", "name": "here", "rise": 0.1}), ROBOT)
    aside = make_task({"recipe": "paper", "name": "aside", "rise": 0.1, "distance_y": 0.05})
    quick = solve_jump(aside, ROBOT, warm_start=here, quick=True)
    assert not quick.statistics["warm"]
    further = make_task({"recipe": "paper", "name": "further", "rise": 0.1, "distance_y": 0.06})
    assert solve_jump(further, ROBOT, warm_start=quick, quick=True).statistics["warm"]
