"""Jumps in a row, free times, contacts one after the other and impacts become valid plans."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.planner.checking.validity import check_plan
from aloft.planner.drawing.picture import phases_of, plan_picture
from aloft.planner.library.reference_table import reference_table
from aloft.planner.problem.guess import ballistic_guess
from aloft.planner.solving.solve import make_problem, solve_jump, with_ground_times, with_times
from aloft.planner.task.phase import Phase
from aloft.planner.task.plan import PlannedJump, read_plan, write_plan
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

from .independence import smallest_singular_value

ROBOT = find_robot("bruce")
STEPS = {
    "rise": 0.12,
    "distance_x": 0.1,
    "jumps": [{"landing_height": 0.05}, {"landing_height": -0.05}],
}
TOES = [
    {"phase": "squat", "time": 0.4},
    {"phase": "thrust", "time": 0.2},
    {"phase": "thrust", "time": "free", "knots": 6, "contacts": "toe"},
    {"phase": "flight"},
    {"phase": "landing", "time": "free", "knots": 6, "contacts": "heel"},
    {"phase": "landing", "time": 0.45},
]


@cache
def steps() -> PlannedJump:
    return solve_jump(make_task({"recipe": "paper", "name": "steps", **STEPS}), ROBOT)


def failed(plan: PlannedJump) -> set[str]:
    return {test.name for test in check_plan(plan, ROBOT).failed}


@pytest.mark.long
def test_up_a_step_and_down_again_without_standing_still() -> None:
    plan = steps()
    assert check_plan(plan, ROBOT).explain() == ""
    (_, landed), (lifted, _) = plan.flights
    assert 0.03 < lifted - landed < 0.4, "a short contact, found by the planner"
    between = (plan.time > landed) & (plan.time < lifted)
    assert plan.com_velocity[between, 0].min() > 0.05, "it goes on forwards"


@pytest.mark.long
def test_every_flight_is_checked() -> None:
    plan = steps()
    knot = plan.knot_at(plan.lift_off_times[1])
    velocity = plan.velocity.copy()
    velocity[knot, 1] += 0.1
    assert "flight_position" in failed(replace(plan, velocity=velocity))
    late = ((plan.later_flights[0][0] + 0.01, plan.later_flights[0][1]),)
    assert "flight_times" in failed(replace(plan, later_flights=late))
    once = plan.task.model_copy(update={"jumps": plan.task.jumps[:1]})
    assert failed(replace(plan, task=once)) == {"phases"}
    higher = (plan.task.jumps[0], plan.task.jumps[1].model_copy(update={"rise": 0.1}))
    asked = replace(plan, task=plan.task.model_copy(update={"jumps": higher}))
    found = [test for test in check_plan(asked, ROBOT).failed if test.name == "rise"]
    assert [test.where for test in found] == [" jump 2"]


@pytest.mark.long
def test_a_file_of_several_jumps(tmp_path: Path) -> None:
    path = write_plan(tmp_path / "steps.npz", steps())
    assert read_plan(path).flights == steps().flights
    assert read_plan(path).task == steps().task
    assert [shade.kind for shade in phases_of(steps())].count("flight") == 2
    assert "2 jumps, rise" in plan_picture(steps(), ROBOT)


@pytest.mark.long
def test_a_near_plan_of_several_jumps_saves_iterations() -> None:
    near = make_task({"recipe": "paper", "name": "near", **STEPS, "rise": 0.118})
    cold, warm = (solve_jump(near, ROBOT, warm_start=start) for start in (None, steps()))
    assert warm.statistics["warm"]
    assert warm.statistics["iterations"] < 0.7 * cold.statistics["iterations"]
    assert np.abs(np.array(cold.flights) - warm.flights).max() < 2e-3


@pytest.mark.long
def test_the_table_has_every_jump() -> None:
    plan = steps()
    table = reference_table(plan, ROBOT, 0.3)
    ((thrust, lift_off, touchdown),) = table.later_jumps
    assert (lift_off, touchdown) == pytest.approx(tuple(0.3 + t for t in plan.flights[1]))
    assert table.touchdown_time < thrust < lift_off
    flying = (table.time > lift_off) & (table.time < touchdown)
    assert table.columns["com_acceleration"][flying, 2] == pytest.approx(-9.81)
    pushing = (table.time > thrust + 0.02) & (table.time < lift_off - 0.02)
    assert table.columns["com_acceleration"][pushing, 2].mean() > 1.0


@pytest.mark.long
@pytest.mark.parametrize(
    "task",
    [
        {"rise": 0.06, "repeat": 3, "contact_time": 0.3},
        {"rise": 0.1, "squat_time": "free", "thrust_time": "free", "landing_time": "free"},
        {"rise": 0.1, "distance_x": 0.1, "phases": TOES},
    ],
)
def test_plans_are_valid(task: dict[str, Any]) -> None:
    plan = solve_jump(make_task({"recipe": "paper", "name": "jump", **task}), ROBOT)
    assert check_plan(plan, ROBOT).explain() == ""


def test_heels_are_off_the_ground_while_the_toes_push() -> None:
    plan = solve_jump(
        make_task({"recipe": "paper", "name": "toes", "rise": 0.1, "phases": TOES}), ROBOT
    )
    on_toes = (plan.contact == [True, False, True, False]).all(axis=1)
    assert on_toes.sum() == 6
    assert set(plan.phase[on_toes].tolist()) == {int(Phase.THRUST)}
    assert np.abs(plan.contact_force[on_toes][:, [1, 3]]).max() == 0.0
    table = reference_table(plan, ROBOT, 0.3)
    assert table.contact is not None
    assert {tuple(row) for row in table.contact.tolist()} == {
        (True,) * 4, (False,) * 4, (True, False) * 2, (False, True) * 2,
    }  # fmt: skip


def test_an_impact_stops_the_feet_by_an_impulse() -> None:
    plan = solve_jump(
        make_task({"recipe": "paper", "name": "hit", "rise": 0.1, "impact": True}), ROBOT
    )
    assert check_plan(plan, ROBOT).explain() == ""
    knot = plan.knot_at(plan.touchdown_time) - 1
    assert plan.time[knot] == plan.time[knot + 1] == plan.touchdown_time
    impulse = plan.contact_force[knot].sum(axis=0)
    change = plan.com_velocity[knot + 1] - plan.com_velocity[knot]
    assert impulse == pytest.approx(ROBOT.total_mass * change, abs=1e-6)
    assert impulse[2] > 0.1
    velocity = plan.velocity.copy()
    velocity[knot + 1, 12] += 0.01
    assert "impact" in failed(replace(plan, velocity=velocity))


@pytest.mark.parametrize(
    "task", [STEPS, {"rise": 0.1, "phases": TOES}, {"rise": 0.1, "impact": True, "distance_y": 0.1}]
)
def test_equations_are_independent_at_the_guess(task: dict[str, Any]) -> None:
    few = {"squat": 2, "thrust": 4, "flight": 5, "landing": 4}
    problem = make_problem(
        make_task({"recipe": "paper", "name": "rank", "knots": few, **task}), ROBOT
    )
    rng = np.random.default_rng(3)
    guess = ballistic_guess(problem) + 1e-3 * rng.normal(size=problem.assembly.variables)
    assert smallest_singular_value(problem, guess) > 1e-7


@pytest.mark.long
def test_free_times_out_of_the_plane_are_those_straight_ahead() -> None:
    free = {"rise": 0.1, "squat_time": "free", "thrust_time": "free"}
    ahead, aside = (
        make_task({"recipe": "paper", "name": name, **free, "distance_y": y})
        for name, y in (("a", 0.0), ("b", 0.05))
    )
    straight = solve_jump(ahead, ROBOT)
    plan = solve_jump(aside, ROBOT)
    assert check_plan(plan, ROBOT).explain() == ""
    assert plan.statistics["coordinates"] == "full"
    assert plan.task.hash(ROBOT) == aside.hash(ROBOT)
    assert plan.lift_off_time == pytest.approx(straight.lift_off_time, abs=1e-5)


@pytest.mark.long
def test_several_jumps_aside_and_round() -> None:
    task = make_task({"recipe": "paper", "name": "aside", "rise": 0.08, "jumps": [{"distance_y": 0.05}, {"twist": 0.3}],
                      "contact_time": 0.3})  # fmt: skip
    given = with_ground_times(task, ROBOT)
    assert given == with_times(task, [0.0] * 7), "there is nothing to be found"
    problem = make_problem(task, ROBOT)
    assert problem.coordinates.name == "full"
    assert [stance.heading for stance in problem.stances] == [0.0, 0.0, 0.3]
    assert problem.end.points[:, 1].mean() == pytest.approx(0.05)
