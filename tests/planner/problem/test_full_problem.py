"""What holds of the ``full`` problem and its solutions, whatever the task."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aloft.planner.checking.validity import check_plan
from aloft.planner.library.library import SHIPPED
from aloft.planner.problem.guess import ballistic_guess
from aloft.planner.solving.solve import make_problem, solve_jump
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import Knots, make_task
from aloft.robots.description import find_robot

from ..independence import smallest_singular_value

ROBOT = find_robot("bruce")
FEW = {"squat": 4, "thrust": 6, "flight": 8, "landing": 6}


@pytest.mark.long
@pytest.mark.parametrize(
    "task",
    [
        {"rise": 0.12, "twist": "30 deg"},
        {"rise": 0.12, "distance_y": 0.1, "impact": True},
        {"rise": 0.15, "landing_height": 0.05, "distance_x": 0.15, "lift_off_momentum": 0.1},
    ],
)
def test_equations_are_independent_in_all_coordinates(task: dict[str, Any]) -> None:
    problem = make_problem(
        make_task({"recipe": "paper", "name": "jump", "knots": FEW, **task}),
        ROBOT,
        coordinates="full",
    )
    assert problem.coordinates.name == "full"
    assert smallest_singular_value(problem, ballistic_guess(problem)) > 1e-7


PLAN_HASH = """
import hashlib
from aloft.planner.task.plan import ARRAYS
from aloft.planner.solving.solve import solve_jump
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot
plan = solve_jump(make_task({"recipe": "paper", "name": "x", "rise": 0.12, "distance_x": 0.08}), find_robot("bruce"))
print(hashlib.sha256(b"".join(getattr(plan, name).tobytes() for name in ARRAYS)).hexdigest())
"""


@pytest.mark.long
def test_a_plan_does_not_depend_on_the_number_of_threads() -> None:
    found = {
        subprocess.run(
            [sys.executable, "-c", PLAN_HASH],
            env={**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
            capture_output=True, text=True, check=True, timeout=120,
        ).stdout
        for threads in ("1", "2")
    }  # fmt: skip
    assert len(found) == 1


def momenta(plan: PlannedJump) -> tuple[float, float]:
    lift_off, touchdown = plan.knot_at(plan.lift_off_time), plan.knot_at(plan.touchdown_time)
    sizes = np.abs(plan.angular_momentum).max(axis=1)
    return float(sizes[lift_off]), float(sizes[touchdown])


@pytest.mark.long
@pytest.mark.parametrize("where", ["lift_off", "touchdown"])
def test_angular_momentum_can_be_bounded(where: str) -> None:
    free = solve_jump(
        make_task({"recipe": "paper", "name": "back", "rise": 0.15, "distance_x": -0.1}), ROBOT
    )
    before = momenta(free)
    most = 0.5 * min(before)
    task = make_task(
        {
            "recipe": "paper",
            "name": "back",
            "rise": 0.15,
            "distance_x": -0.1,
            f"{where}_momentum": most,
        }
    )
    plan = solve_jump(task, ROBOT)
    index = ("lift_off", "touchdown").index(where)
    assert before[index] > most + 1e-3
    assert momenta(plan)[index] == pytest.approx(most, abs=1e-5)
    assert f"{where}_momentum" not in [test.name for test in check_plan(plan, ROBOT).failed]
    # The check itself notices what the plan was not asked for.
    cheated = check_plan(replace(free, task=task), ROBOT)
    assert f"{where}_momentum" in [test.name for test in cheated.failed]


def test_a_somersault_without_angular_momentum_is_refused() -> None:
    task = make_task(
        {"recipe": "paper", "name": "stiff", "rise": 0.15, "rotation": "360 deg", "lift_off_momentum": 0.0,
         "flight_time": 0.2, "knots": FEW}
    )  # fmt: skip
    with pytest.raises(PlanError, match="no plan for 'stiff'"):
        solve_jump(task, ROBOT, solver="fatrop")


@pytest.mark.long
@pytest.mark.parametrize("name", ["forward_10cm", "step_down_5cm"])
def test_halving_the_intervals_changes_no_peak(name: str) -> None:
    task = read_task(SHIPPED.parent / "tasks" / f"{name}.yaml")
    peaks = []
    for knots in (task.knots, _doubled(task.knots)):
        plan = solve_jump(task, ROBOT, knots=knots)
        motor = np.abs(plan.joint_torque @ ROBOT.torque_to_motor.T).max()
        peaks.append([motor, plan.contact_force.sum(axis=1)[:, 2].max()])
    assert peaks[1] == pytest.approx(peaks[0], rel=0.05)


def _doubled(knots: Knots) -> Knots:
    return Knots(**{name: 2 * count for name, count in knots.model_dump().items()})
