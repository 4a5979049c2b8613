"""The nearest feasible jump as the real planner finds it, for jumps far beyond the robot."""

import math
from pathlib import Path
from typing import Any

import pytest

from aloft.planner.library.library import SHIPPED, PlanLibrary, solve_and_check
from aloft.planner.library.nearest_feasible import nearest_feasible, seconds_left
from aloft.planner.solving.solve import make_problem
from aloft.planner.solving.solver_process import cpu_time
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import InvalidPlanError
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.mark.long
@pytest.mark.parametrize(
    ("asked", "parameter", "least", "most"),
    [({"rise": 0.6}, "rise", 0.32, 0.42),
     ({"rise": 0.12, "twist": 2.0 * math.pi}, "twist", math.radians(130), math.radians(200))],
    ids=["up 60 cm", "a whole turn"],
)  # fmt: skip
def test_what_is_infeasible_is_answered_with_a_value_near_the_limit(
    asked: dict[str, Any], parameter: str, least: float, most: float, tmp_path: Path
) -> None:
    """A kept turn, or the kept jump 32 cm up, is where the search begins."""
    task = make_task({"name": "beyond", **asked})
    make_problem(task, ROBOT)  # compiles what is compiled once on a machine
    started = cpu_time()
    with pytest.raises((PlanError, InvalidPlanError)) as error:
        solve_and_check(task, ROBOT)
    spent = cpu_time() - started
    found = nearest_feasible(
        task, ROBOT, family=getattr(error.value, "family", ""), seconds=seconds_left(spent),
        library=PlanLibrary(ROBOT, tmp_path, (SHIPPED,)),
    )  # fmt: skip
    assert found is not None
    assert found.parameter == parameter
    assert least <= found.value <= most
    assert found.plan.valid
    assert getattr(found.plan.task, parameter) == found.value
    # About 10 s on a quiet machine; a core that others share takes up to twice as long for the same.
    assert spent + found.cpu_s < 20.0
