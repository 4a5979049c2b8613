"""Tasks become valid plans; what cannot be planned says why.

Hard jumps by way of easier ones, and the somersaults that come with aloft.

A plan whose intervals are too long is solved again on finer ones.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from aloft.mathematics.compiling.lanes import Lanes
from aloft.mathematics.rotations import matrices_of_quaternions
from aloft.planner.checking.validity import check_plan, checked
from aloft.planner.library.library import SHIPPED, PlanLibrary, solve_and_check
from aloft.planner.models.interpreted import InterpretedFunction, interpreted
from aloft.planner.problem.guess import ballistic_guess
from aloft.planner.problem.program_functions import program_functions
from aloft.planner.problem.unpacking import can_start
from aloft.planner.solving import kept_functions
from aloft.planner.solving.solve import (
    asks_for_finer,
    finer_knots,
    make_problem,
    relaxable,
    relaxed,
    solve_jump,
    tighten,
    with_impacts,
)
from aloft.planner.solving.solver import solve
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import ARRAYS, InvalidPlanError, PlannedJump
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


def evaluated_by_casadi(function: Any) -> InterpretedFunction:
    """Return a function whose instructions nobody walks through: CasADi's virtual machine does."""
    own = interpreted(function)

    def lanes(count: int, *memory: Any) -> Lanes:
        made, theirs = InterpretedFunction.lanes(own, count, *memory), function.map(count)

        def run() -> None:
            given = (
                ca.DM(theirs.sparsity_in(k), each.ravel()) for k, each in enumerate(made.inputs)
            )
            for mine, found in zip(made.outputs, theirs.call(list(given)), strict=True):
                mine.reshape(-1)[:] = found.nonzeros()

        monkeypatched: Any = made
        monkeypatched.run = run
        return made

    changed: Any = own
    changed.lanes = lanes
    return own


@pytest.mark.long
def test_with_casadis_own_evaluation_the_plan_is_the_same_to_the_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ours = solve_jump(FORWARD, ROBOT)
    monkeypatch.setattr(kept_functions, "_held", {})
    monkeypatch.setattr(kept_functions, "interpreted", evaluated_by_casadi)
    nowhere = SimpleNamespace(load=lambda name: None, save=lambda name, data: False)
    monkeypatch.setattr(kept_functions, "FUNCTIONS", nowhere)
    monkeypatch.setattr(kept_functions, "_packed", lambda piece: b"")
    theirs = solve_jump(FORWARD, ROBOT)
    assert ours.statistics["iterations"] == theirs.statistics["iterations"]
    for name in ARRAYS:
        assert getattr(ours, name).tobytes() == getattr(theirs, name).tobytes(), name


@pytest.mark.long
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
        pytest.param("turn_60deg", {"rise": 0.095, "twist": 1.1}, marks=pytest.mark.long),
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


@pytest.mark.long
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
    functions, parameters = program_functions(problem.assembly), problem.parameters
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


@pytest.mark.long
def test_equations_are_independent_at_the_guess() -> None:
    problem = make_problem(FORWARD, ROBOT)
    assert smallest_singular_value(problem, ballistic_guess(problem)) > 1e-7


@pytest.mark.long
def test_a_quick_solve_aside_starts_from_the_jump_ahead_not_from_a_plan_in_the_plane() -> None:
    here = solve_jump(make_task({"recipe": "paper", "name": "here", "rise": 0.1}), ROBOT)
    aside = make_task({"recipe": "paper", "name": "aside", "rise": 0.1, "distance_y": 0.05})
    quick = solve_jump(aside, ROBOT, warm_start=here, quick=True)
    assert not quick.statistics["warm"]
    further = make_task({"recipe": "paper", "name": "further", "rise": 0.1, "distance_y": 0.06})
    assert solve_jump(further, ROBOT, warm_start=quick, quick=True).statistics["warm"]


TASK = make_task({"recipe": "paper", "name": "jump", "rise": 0.15, "distance_x": 0.1})


def test_only_the_motors_are_made_stronger() -> None:
    problem = make_problem(TASK, ROBOT)
    stronger = relaxed(problem, 1.5)
    for k, family in enumerate(problem.families):
        factor = 1.5 if family.startswith("motor") else 1.0
        assert stronger.row_upper[k] == factor * problem.row_upper[k]
        assert stronger.row_lower[k] == factor * problem.row_lower[k]


@pytest.mark.long
def test_limits_come_down_to_the_real_ones() -> None:
    problem = make_problem(TASK, ROBOT)
    easy = solve(relaxed(problem, 1.5), ballistic_guess(problem), solver="fatrop")
    found = tighten(problem, easy.values, 1.5)
    assert found is not None
    assert found.solved
    direct = solve(problem, ballistic_guess(problem), solver="fatrop")
    assert found.cost == pytest.approx(direct.cost, rel=1e-4)
    assert found.cost > easy.cost


@pytest.mark.long
def test_limits_out_of_reach_are_not_reached() -> None:
    high = make_problem(make_task({"recipe": "paper", "name": "high", "rise": 0.45}), ROBOT)
    easy = solve(relaxed(high, 2.0), ballistic_guess(high), solver="fatrop")
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


HIGH = make_task({"recipe": "paper", "name": "high", "rise": 0.2})


def failing(plan: PlannedJump, *tests: tuple[str, float, float]) -> PlannedJump:
    rows = [{"name": n, "value": v, "limit": a, "passed": False} for n, v, a in tests]
    return plan.with_report({"valid": False, "tests": rows, "figures": {}})


@pytest.mark.parametrize(
    ("tests", "expected"),
    [
        ([("flight_position", 1.2e-3, 1e-3)], True),
        ([("flight_position", 1.2e-3, 1e-3), ("motor_torque", 0.4, 0.3)], True),
        ([("flight_position", 1.2e-3, 1e-3), ("friction", 0.4, 0.01)], False),
        ([("flight_position", 0.5, 1e-3)], False),
        ([], False),
    ],
)
def test_what_finer_intervals_may_cure(
    by_hand: PlannedJump, tests: list[tuple[str, float, float]], expected: bool
) -> None:
    assert relaxable(failing(by_hand, *tests)) is expected


def test_only_a_failed_plan_of_that_very_task_asks_for_finer(by_hand: PlannedJump) -> None:
    failed = failing(replace(by_hand, task=HIGH), ("flight_position", 2e-3, 1e-3))
    assert asks_for_finer(HIGH, failed)
    assert asks_for_finer(HIGH.model_copy(update={"name": "other"}), failed)
    assert not asks_for_finer(make_task({"recipe": "paper", "name": "low", "rise": 0.1}), failed)
    assert not asks_for_finer(HIGH, replace(by_hand, task=HIGH))
    assert not asks_for_finer(HIGH, None)


@pytest.mark.long
def test_a_high_jump_is_valid_on_the_grid_it_needs() -> None:
    coarse = checked(solve_jump(HIGH, ROBOT), ROBOT)
    assert not coarse.valid
    plan = solve_and_check(HIGH, ROBOT)
    assert plan.valid
    assert plan.task.hash(ROBOT) == HIGH.hash(ROBOT)
    knots = finer_knots(coarse)
    assert knots.flight == 42
    assert plan.statistics["knots"] == knots.total + 1 == len(plan.time)
    error = [report["figures"]["flight_error_mm"] for report in (plan.report, coarse.report)]
    assert error[0] < 0.6 * error[1]


@pytest.mark.parametrize(
    "task",
    [
        {"rise": 0.1, "distance_x": 0.3},
        pytest.param({"rise": 0.15, "distance_y": 0.2}, marks=pytest.mark.long),
        pytest.param({"rise": 0.15, "twist": "60 deg"}, marks=pytest.mark.long),
    ],
)
def test_the_reach_of_the_real_actuators(task: dict[str, Any]) -> None:
    plan = solve_and_check(make_task({"recipe": "paper", "name": "far", **task}), ROBOT)
    assert plan.valid
    assert plan.statistics["violation"] <= 1e-6


def test_an_invalid_plan_is_not_refined_without_end(by_hand: PlannedJump) -> None:
    calls = []

    def make(task: Any, robot: Any, start: PlannedJump | None) -> PlannedJump:
        calls.append(start)
        bent = by_hand.position.copy()
        bent[len(bent) // 2, 0] += 2e-3
        return replace(by_hand, task=asked, position=bent)

    asked = by_hand.task.model_copy(update={"formulation": "full"})  # the other has no impact
    with pytest.raises(InvalidPlanError):
        solve_and_check(asked, ROBOT, None, make)
    assert len(calls) <= 3


@pytest.mark.long
def test_a_plan_on_another_grid_is_a_start() -> None:
    first = make_task({"recipe": "paper", "name": "low", "rise": 0.14})
    fine = solve_jump(first, ROBOT, knots=finer_knots(solve_jump(first, ROBOT)))
    warm = solve_jump(
        make_task({"recipe": "paper", "name": "near", "rise": 0.15}), ROBOT, warm_start=fine
    )
    assert warm.statistics["warm"]
    assert len(warm.time) < len(fine.time)
    cold = solve_jump(make_task({"recipe": "paper", "name": "near", "rise": 0.15}), ROBOT)
    assert np.abs(warm.com - cold.com).max() < 2e-3
