"""The charts of a plan: limits, the ground and the phases are where they belong."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from aloft.planner.checking.evidence import Evidence
from aloft.planner.checking.replay import replay
from aloft.planner.drawing.line_chart import Chart, Line
from aloft.planner.drawing.plan_charts import charts_of, phases_of
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.task.task import read_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.fixture(scope="module")
def step_up() -> Evidence:
    task = read_task(SHIPPED.parent / "tasks" / "step_up_5cm.yaml")
    plan = PlanLibrary(ROBOT, Path("nowhere")).find(task)
    assert plan is not None
    return Evidence(plan, ROBOT, replay(plan, ROBOT))


def chart(e: Evidence, title: str) -> Chart:
    return next(chart for chart in charts_of(e) if chart.title.startswith(title))


def levels(of: Chart) -> list[Line]:
    return [line for line in of.lines if line.level]


def test_phases_follow_each_other_without_gaps(step_up: Evidence) -> None:
    phases = phases_of(step_up.plan)
    assert [name for _, _, name in phases] == ["squat", "thrust", "flight", "landing"]
    assert phases[0][0] == 0.0 and phases[-1][1] == step_up.plan.time[-1]
    assert all(a[1] == b[0] for a, b in pairwise(phases))
    assert phases[2][:2] == (step_up.plan.lift_off_time, step_up.plan.touchdown_time)
    assert all(len(chart.shaded) == 4 for chart in charts_of(step_up))


def test_the_ground_under_the_feet_is_the_step(step_up: Evidence) -> None:
    feet = chart(step_up, "height of toes")
    for line in levels(feet):
        assert set(np.round(line.y, 6)) == {0.0, 5.0}
        assert line.y[0] == pytest.approx(0.0, abs=1e-9)
        assert line.y[-1] == pytest.approx(5.0)


def test_no_torque_leaves_what_its_speed_allows(step_up: Evidence) -> None:
    torque = chart(step_up, "motor torque [N m]")
    drawn = [line for line in torque.lines if not line.level]
    peak = ROBOT.profiles["koala"].peak_torque
    for line, level in zip(drawn, levels(torque), strict=True):
        known = np.isfinite(level.y)
        assert known.mean() > 0.9
        assert np.all(np.abs(line.y) <= np.abs(level.y) + 0.03 * peak, where=known)
        assert np.all(line.y * level.y >= 0.0, where=known)
    lowest = min(float(np.nanmin(np.abs(level.y))) for level in levels(torque))
    assert lowest < 0.9 * peak, "the limit depends on the speed"


def test_limits_are_drawn(step_up: Evidence) -> None:
    for title, limit in (("friction", 100.0), ("motor torque [%", 100.0), ("motor speed", 100.0)):
        (level,) = levels(chart(step_up, title))
        assert level.y.tolist() == [limit, limit]
        highest = max(float(np.nanmax(line.y)) for line in chart(step_up, title).lines)
        assert 50.0 < highest < 105.0


def test_lines_that_hide_behind_another_are_not_named(step_up: Evidence) -> None:
    names = [line.name for line in chart(step_up, "motor speed").lines if line.name]
    assert len(names) == len({name.removeprefix("right_").removeprefix("left_") for name in names})
