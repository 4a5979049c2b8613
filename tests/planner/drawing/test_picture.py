"""The picture of a plan: well-formed SVG with the plan's own figures, postures and panels.

The panels of a plan: limits, the ground and the phases are where they belong.
"""

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from aloft.planner.checking.evidence import Evidence
from aloft.planner.checking.replay import replay
from aloft.planner.drawing.picture import phases_of, plan_panels, write_picture
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import read_task
from aloft.plotting import Curve, Panel
from aloft.robots.description import find_robot

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.long
def test_a_plans_picture(by_hand: PlannedJump, tmp_path: Path) -> None:
    robot = find_robot("bruce")
    path = write_picture(tmp_path / "a" / "p.svg", by_hand, robot)
    root = ElementTree.parse(path).getroot()
    texts = [element.text or "" for element in root.iter(f"{SVG}text")]
    assert any(text.startswith("by_hand: rise 8.5 cm, flight 291 ms") for text in texts)
    assert {"right_toe", "pitch", "up", "time [s]", "motor torque [N m]"} <= set(texts)
    assert {"squat", "flight", "landing", "ground", "limit at its speed"} <= set(texts)
    named = [group.get("id", "") for group in root.iter(f"{SVG}g")]
    assert named.count("line") > 40
    assert sum(name.startswith("centre-of-mass-") for name in named) == 9, "one in every posture"
    assert sum(name.startswith("posture-") for name in named) == 9 * len(robot.feet)
    before = path.read_bytes()
    assert write_picture(path, by_hand, robot).read_bytes() == before, "the same bytes each time"


ROBOT = find_robot("bruce")


@pytest.fixture(scope="module")
def step_up() -> Evidence:
    task = read_task(SHIPPED.parent / "tasks" / "step_up_5cm.yaml")
    plan = PlanLibrary(ROBOT, Path("nowhere")).find(task)
    assert plan is not None
    return Evidence(plan, ROBOT, replay(plan, ROBOT))


def panel(e: Evidence, title: str) -> Panel:
    return next(panel for panel in plan_panels(e) if panel.title.startswith(title))


def limits(of: Panel) -> list[Curve]:
    return [line for line in of.lines if line.limit]


def test_phases_follow_each_other_without_gaps(step_up: Evidence) -> None:
    phases = phases_of(step_up.plan)
    assert [phase.name for phase in phases] == ["squat", "thrust", "flight", "landing"]
    assert phases[0].start == 0.0 and phases[-1].end == step_up.plan.time[-1]
    assert all(a.end == b.start for a, b in pairwise(phases))
    assert phases[2].start == step_up.plan.lift_off_time
    assert phases[2].end == step_up.plan.touchdown_time
    assert all(len(panel.shades) == 4 for panel in plan_panels(step_up))


def test_the_ground_under_the_feet_is_the_step(step_up: Evidence) -> None:
    feet = panel(step_up, "height of the contact points")
    for line in limits(feet):
        assert set(np.round(line.y, 6)) == {0.0, 5.0}
        assert line.y[0] == pytest.approx(0.0, abs=1e-9)
        assert line.y[-1] == pytest.approx(5.0)


def test_no_torque_leaves_what_its_speed_allows(step_up: Evidence) -> None:
    torque = panel(step_up, "motor torque [N m]")
    drawn = [line for line in torque.lines if not line.limit]
    peak = ROBOT.profiles["koala"].peak_torque
    for line, level in zip(drawn, limits(torque), strict=True):
        known = np.isfinite(level.y)
        assert known.mean() > 0.9
        assert np.all(np.abs(line.y) <= np.abs(level.y) + 0.03 * peak, where=known)
        assert np.all(line.y * level.y >= 0.0, where=known)
    lowest = min(float(np.nanmin(np.abs(level.y))) for level in limits(torque))
    assert lowest < 0.9 * peak, "the limit depends on the speed"


def test_limits_are_drawn(step_up: Evidence) -> None:
    effort = 100.0 * step_up.plan.task.effort
    for title, limit in (("friction", 100.0), ("motor torque [%", effort), ("motor speed", effort)):
        (level,) = limits(panel(step_up, title))
        assert set(level.y.tolist()) == {limit}
        highest = max(float(np.nanmax(line.y)) for line in panel(step_up, title).lines)
        assert 50.0 < highest < 105.0


def test_lines_that_hide_behind_another_are_not_named(step_up: Evidence) -> None:
    names = [line.name for line in panel(step_up, "motor speed").lines if line.name]
    assert len(names) == len({name.removeprefix("right_").removeprefix("left_") for name in names})
