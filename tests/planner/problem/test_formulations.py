"""The three formulations: each fulfils its own equations, and they agree on the flight."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from aloft.planner.checking.validity import broken_array, check_plan
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.problem.program import SimpleProblem
from aloft.planner.solving import paper_plan
from aloft.planner.solving.paper_plan import paper_problem
from aloft.planner.solving.solve import FORMULATIONS, solve_jump
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import ARRAYS, PlannedJump
from aloft.planner.task.task import JumpTask, make_task
from aloft.robots.description import find_robot

from .own_equations import (
    own_residuals,
    standing_inertia,
    unmodelled_momentum,
)

ROBOT = find_robot("bruce")
DYNAMICS = ExactDynamics(ROBOT)
JUMPS: dict[str, dict[str, Any]] = {
    "in situ": {"rise": 0.15},
    "forward": {"rise": 0.15, "distance_x": 0.1},
    "twist": {"rise": 0.15, "twist": math.radians(30.0)},
}
COARSE = {"squat": 4, "thrust": 8, "flight": 14, "landing": 7}
"""The paper's problem takes seconds also with fewer knots than usual."""
PAPER = pytest.mark.long
REDUCED = [
    *(pytest.param("paper", jump, marks=PAPER) for jump in JUMPS),
    *(("srbm", jump) for jump in JUMPS),
]


@lru_cache(maxsize=16)
def planned(formulation: str, jump: str) -> PlannedJump:
    values: dict[str, Any] = {
        "recipe": "paper",
        "name": jump,
        "formulation": formulation,
        **JUMPS[jump],
    }
    values |= {"knots": COARSE} if formulation == "paper" else {}
    return solve_jump(make_task(values), ROBOT)


def knot(plan: PlannedJump, time: float) -> int:
    return int(np.abs(plan.time - time).argmin())


def test_every_formulation_of_a_task_is_there() -> None:
    names = (
        make_task({"recipe": "paper", "name": "x", "rise": 0.1})
        .__class__.model_fields["formulation"]
        .annotation
    )
    assert set(FORMULATIONS) == set(names.__args__)  # type: ignore[union-attr]


@pytest.mark.long
@pytest.mark.parametrize(("formulation", "jump"), REDUCED)
def test_a_plan_fulfils_its_own_equations_by_pinocchio(formulation: str, jump: str) -> None:
    plan = planned(formulation, jump)
    assert not broken_array(plan, ROBOT)
    assert plan.statistics["violation"] <= 1e-6
    residuals = own_residuals(plan, ROBOT)
    assert len(residuals) >= 6
    assert {name: value for name, value in residuals.items() if value > 1e-6} == {}


@pytest.mark.parametrize(
    ("formulation", "array", "column", "equation"),
    [
        pytest.param("paper", "angular_momentum", 1, "h = A(q) v", marks=PAPER),
        pytest.param("paper", "velocity", 7, "h = A(q) v", marks=PAPER),
        pytest.param("paper", "com", 0, "r = f_com(q)", marks=PAPER),
        pytest.param("paper", "contact_force", 2, "linear momentum rate", marks=PAPER),
        ("srbm", "contact_force", 2, "moment balance"),
        ("srbm", "position", 2, "com"),
    ],
)
def test_an_array_that_is_changed_breaks_its_equation(
    formulation: str, array: str, column: int, equation: str
) -> None:
    plan = planned(formulation, "forward")
    changed = {name: np.array(getattr(plan, name)) for name in ARRAYS}
    changed[array][5, ..., column] += 0.01
    broken = PlannedJump(
        task=plan.task, lift_off_time=plan.lift_off_time, touchdown_time=plan.touchdown_time,
        **changed,
    )  # fmt: skip
    assert own_residuals(broken, ROBOT)[equation] > 1e-6


@pytest.mark.parametrize(("formulation", "jump"), REDUCED)
def test_the_task_is_done_in_the_formulations_own_terms(formulation: str, jump: str) -> None:
    plan, wanted = planned(formulation, jump), JUMPS[jump]
    soles = [DYNAMICS.soles(q) for q in plan.position[[0, -1]]]
    moved = (soles[1][0] - soles[0][0]).mean(axis=0)
    assert moved == pytest.approx([wanted.get("distance_x", 0.0), 0.0, 0.0], abs=1e-6)
    assert soles[1][1][0] == pytest.approx(wanted.get("twist", 0.0), abs=1e-6)
    assert np.abs(plan.velocity[[0, -1]]).max() < 1e-6


@pytest.mark.long
def test_the_formulations_agree_on_the_ballistic_apex() -> None:
    apex = {}
    for formulation in FORMULATIONS:
        plan = planned(formulation, "in situ")
        k = knot(plan, plan.lift_off_time)
        rise = plan.com[k, 2] - plan.com[0, 2] + plan.com_velocity[k, 2] ** 2 / (2.0 * 9.81)
        apex[formulation] = rise
    assert apex == {name: pytest.approx(0.15, abs=1e-6) for name in FORMULATIONS}


@pytest.mark.long
def test_legs_without_mass_leave_a_momentum_that_turns_the_robot() -> None:
    plan = planned("srbm", "in situ")
    k = knot(plan, plan.lift_off_time)
    missing = unmodelled_momentum(plan, DYNAMICS)[k]
    # The legs swing about y as they push off. Over the flight that turns the robot by more than a
    # quarter, though the plan says that it stays upright.
    assert abs(missing[1]) > 0.2
    assert abs(missing[1]) > 100.0 * abs(plan.angular_momentum[k, 1])
    inertia = standing_inertia(plan, DYNAMICS)[1, 1]
    assert abs(missing[1]) * plan.flight_time / inertia > 0.5 * math.pi
    known = unmodelled_momentum(planned("paper", "in situ"), DYNAMICS)
    assert np.abs(known).max() < 1e-6


@pytest.mark.parametrize(
    ("formulation", "failed"),
    [
        pytest.param(
            "paper", {"motor_torque", "rise", "touchdown_speed", "com_velocity"}, marks=PAPER
        ),
        ("srbm", {"angular_momentum", "flight_rotation", "flight_position"}),
    ],
)
def test_the_validity_check_says_what_the_formulation_leaves_out(
    formulation: str, failed: set[str]
) -> None:
    report = check_plan(planned(formulation, "in situ"), ROBOT)
    assert failed <= {test.name for test in report.failed}
    assert not report.valid


@pytest.mark.parametrize("formulation", ["paper", "srbm"])
@pytest.mark.parametrize(
    ("change", "named"), [({"impact": True}, "impact"), ({"thrust_time": "free"}, "thrust_time")]
)
def test_what_only_full_can_do_is_refused(
    formulation: str, change: dict[str, Any], named: str
) -> None:
    task = make_task(
        {"recipe": "paper", "name": "odd", "rise": 0.1, "formulation": formulation, **change}
    )
    with pytest.raises(PlanError, match=f"{named}.*use formulation: full"):
        solve_jump(task, ROBOT)


@pytest.mark.long
def test_the_papers_boundary_set_may_bound_attitude_velocity_force_and_momentum() -> None:
    bounds = {"joint_velocity": 22.0, "force": 26.0, "angular_momentum": 0.3}
    margins = {"squat_lean": 0.8, "landing_lean": 0.15, "joints": 0.05}
    values = {
        "recipe": "paper", "name": "bounded", "formulation": "paper", "rise": 0.08, "knots": COARSE,
        "margins": margins, "bounds": bounds, "lift_off_momentum": 0.1, "touchdown_momentum": 0.1,
    }  # fmt: skip
    plan = solve_jump(make_task(values), ROBOT)
    up, down = knot(plan, plan.lift_off_time), knot(plan, plan.touchdown_time)
    lean = 2.0 * np.arcsin(np.abs(plan.position[:, 3:5]).max(axis=1))
    tolerance = 1e-4
    assert lean[: up + 1].max() <= margins["squat_lean"] + tolerance
    assert lean[down:-1].max() <= margins["landing_lean"] + tolerance
    assert np.abs(plan.velocity[:, 6:]).max() <= bounds["joint_velocity"] + tolerance
    assert plan.contact_force[..., 2].max() <= bounds["force"] + tolerance
    assert np.abs(plan.angular_momentum).max() <= bounds["angular_momentum"] + tolerance
    assert np.abs(plan.angular_momentum[[up, down]]).max() <= 0.1 + tolerance
    limits = ROBOT.joint_limits + np.array([0.05, -0.05])
    assert (plan.position[1:-1, 7:] >= limits[:, 0] - tolerance).all()
    assert (plan.position[1:-1, 7:] <= limits[:, 1] + tolerance).all()


@pytest.mark.long
def test_the_papers_problem_takes_its_contact_sequence_from_the_task() -> None:
    phases = [
        {"phase": "squat", "time": 0.4, "knots": 8},
        {"phase": "thrust", "time": 0.21, "knots": 7},
        {"phase": "thrust", "time": 0.04, "knots": 2, "contacts": "toe"},
        {"phase": "flight", "knots": 11},
        {"phase": "landing", "time": 0.5, "knots": 9},
    ]
    values = {"recipe": "paper", "name": "toes", "formulation": "paper", "rise": 0.1}
    plan = solve_jump(make_task(values | {"phases": phases}), ROBOT)
    assert {name: size for name, size in own_residuals(plan, ROBOT).items() if size > 1e-6} == {}
    heels = [c.name.endswith("heel") for c in ROBOT.contacts]
    up = knot(plan, plan.lift_off_time)
    assert plan.contact[: up - 2].all()
    assert (plan.contact[up - 2 : up] == ~np.array(heels)).all()
    height = DYNAMICS.points(plan.position[up])[:, 2] - DYNAMICS.points(plan.position[0])[:, 2]
    assert height[heels].min() > 1e-3 > np.abs(height[~np.array(heels)]).max()
    # The legs are longer on their toes, so no joint has to be as fast at lift-off.
    flat = solve_jump(make_task(values | {"knots": {**COARSE, "thrust": 9, "flight": 11}}), ROBOT)
    fastest = [np.abs(p.velocity[knot(p, p.lift_off_time), 6:]).max() for p in (plan, flat)]
    assert fastest[0] < 0.8 * fastest[1]


@pytest.mark.long
def test_a_jump_elsewhere_begins_with_the_jump_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    ways = []

    def noted(task: JumpTask, *given: Any, **more: Any) -> SimpleProblem:
        ways.append((task.distance_x, task.twist))
        return paper_problem(task, *given, **more)

    monkeypatch.setattr(paper_plan, "paper_problem", noted)
    values = {"recipe": "paper", "formulation": "paper", "rise": 0.1, "knots": COARSE}
    plan = solve_jump(make_task({**values, "name": "ahead", "distance_x": 0.06}), ROBOT)
    # The problem itself is made first, and then those on the way.
    assert ways == [(0.06, 0.0), (0.0, 0.0), pytest.approx((0.02, 0.0)), pytest.approx((0.04, 0.0))]
    assert not plan.statistics["warm"], "nobody gave a plan to start from"
    assert plan.com[-1, 0] - plan.com[0, 0] == pytest.approx(0.06, abs=1e-6)
    ways.clear()
    solve_jump(make_task({**values, "name": "in place"}), ROBOT)
    assert ways == [(0.0, 0.0)]


@pytest.mark.parametrize("formulation", ["paper", "srbm"])
def test_a_phase_without_time_is_refused_by_its_name(formulation: str) -> None:
    task = make_task({"recipe": "paper", "name": "odd", "rise": 0.1, "formulation": formulation,
                      "squat_time": "free"})  # fmt: skip
    with pytest.raises(PlanError, match="it has no squat_time: free; use formulation: full"):
        solve_jump(task, ROBOT)


@pytest.mark.long
def test_the_papers_problem_starts_from_a_plan_of_a_near_task() -> None:
    near = planned("paper", "in situ")
    values = {
        "recipe": "paper", "name": "near", "formulation": "paper", "rise": 0.14, "knots": COARSE,
    }  # fmt: skip
    cold = solve_jump(make_task(values), ROBOT)
    warm = solve_jump(make_task(values), ROBOT, warm_start=near)
    assert warm.statistics["warm"]
    assert not cold.statistics["warm"]
    assert warm.statistics["iterations"] < cold.statistics["iterations"]
    assert warm.statistics["cost"] == pytest.approx(cold.statistics["cost"], rel=1e-3)


def test_legs_that_do_not_reach_are_named() -> None:
    task = make_task(
        {"recipe": "paper", "name": "far", "rise": 0.1, "distance_x": 0.9, "formulation": "srbm"}
    )
    with pytest.raises(PlanError, match=r"no plan for 'far'|legs cannot follow"):
        solve_jump(task, ROBOT)
