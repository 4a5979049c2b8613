"""Plans for ground that leans, as the task says: feet lie on it, and forces stay in its cones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from aloft.planner.checking.evidence import Evidence
from aloft.planner.checking.replay import replay
from aloft.planner.checking.validity import check_plan
from aloft.planner.library.library import solve_and_check
from aloft.planner.solving.solve import make_problem, solve_jump
from aloft.planner.task.files import JumpTaskError, PlanError
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import contradictions, require_consistent
from aloft.planner.task.task import JumpTask, make_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


def task(**values: Any) -> JumpTask:
    return make_task({"name": "slope", "rise": "12 cm", "distance_x": "20 cm", **values})


@cache
def planned(start: float, landing: float) -> PlannedJump:
    slopes = {"slope": (np.radians(start), 0.0), "landing_slope": (np.radians(landing), 0.0)}
    return solve_and_check(task(**slopes), ROBOT)


def failed(plan: PlannedJump) -> set[str]:
    return {test.name for test in check_plan(plan, ROBOT).failed}


@pytest.mark.long
@pytest.mark.parametrize(("start", "landing"), [(0.0, 12.0), (8.0, -8.0)])
def test_feet_land_along_the_ground_and_the_torso_upright(start: float, landing: float) -> None:
    plan = planned(start, landing)
    samples = replay(plan, ROBOT).samples
    touchdown = int(np.searchsorted(samples.time, plan.touchdown_time - 1e-9))
    for sample, angle in ((0, start), (touchdown, landing), (-1, landing)):
        toe, heel = samples.points[sample, :2]
        lean = np.degrees(np.arctan2(toe[2] - heel[2], toe[0] - heel[0]))
        assert lean == pytest.approx(angle, abs=0.05)
    assert np.abs(plan.position[[0, -1], 3:6]).max() < 1e-6


@pytest.mark.long
def test_the_check_knows_where_the_ground_leans() -> None:
    plan = planned(0.0, 12.0)
    level = replace(plan, task=plan.task.model_copy(update={"landing_slope": None}))
    assert {"foot_on_ground", "foot_below_ground"} <= failed(level)
    steeper = plan.task.model_copy(update={"landing_slope": (np.radians(14.0), 0.0)})
    assert "foot_on_ground" in failed(replace(plan, task=steeper))


@pytest.mark.long
def test_cones_are_about_the_grounds_normal() -> None:
    plan = planned(8.0, -8.0)
    evidence = Evidence(plan, ROBOT, replay(plan, ROBOT))
    own = evidence.forces
    np.testing.assert_allclose(
        np.linalg.norm(own, axis=2), np.linalg.norm(plan.contact_force, axis=2), atol=1e-9
    )
    # At rest the ground holds the robot against sliding: by the sine of its slope uphill.
    standing = own[0].sum(axis=0) / np.linalg.norm(own[0].sum(axis=0))
    assert standing[0] == pytest.approx(np.sin(np.radians(8.0)), abs=0.02)
    # A push along the world's vertical axis is in the cone of level ground, and not in this one.
    force = plan.contact_force.copy()
    low = plan.task.model_copy(update={"friction": 0.1})
    force[0] = (0.0, 0.0, 15.0)
    assert "friction" in failed(replace(plan, contact_force=force, task=low))


@pytest.mark.long
def test_across_the_slope_one_leg_is_bent_more() -> None:
    plan = solve_and_check(task(slope=["5 deg", "5 deg"]), ROBOT)
    assert plan.statistics["coordinates"] == "full"
    knees = [i for i, joint in enumerate(ROBOT.joints) if "knee" in joint.name]
    assert np.ptp(plan.position[-1, 7:][knees]) > 0.1


def test_level_ground_has_the_pieces_that_it_had() -> None:
    for values, sloped in (({}, False), ({"landing_slope": [0.0, 0.0]}, False),
                           ({"landing_slope": [0.1, 0.0]}, True)):  # fmt: skip
        names = make_problem(task(**values), ROBOT).assembly.pieces
        size = int(names["stance"].value.size1_in(1))
        level = int(make_problem(task(), ROBOT).assembly.pieces["stance"].value.size1_in(1))
        assert size - level == (9 if sloped else 0)


def test_feet_must_hold_and_other_formulations_know_level_ground_only() -> None:
    steep = task(landing_slope=["30 deg", 0])
    ((key, text),) = contradictions(steep, ROBOT)
    assert key == "landing_slope"
    assert text.startswith("ground that rises 58 cm a metre needs a friction of more than 0.58")
    assert text.endswith("and the task says friction: 0.5; ask for a smaller slope")
    with pytest.raises(JumpTaskError, match="slope: landing_slope: ground that rises"):
        require_consistent(steep, ROBOT)
    require_consistent(task(landing_slope=["30 deg", 0], friction=0.7), ROBOT)
    with pytest.raises(PlanError, match="formulation srbm knows level ground only"):
        solve_jump(task(landing_slope=["5 deg", 0], formulation="srbm"), ROBOT)
