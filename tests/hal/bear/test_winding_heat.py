"""What a jump heats the windings decides whether it may be made, and when."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

import aloft
from aloft.files.problems import LoadError
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.winding_heat import cooling_time, hot_winding, rise_of
from aloft.planner.library.library import PlanLibrary
from aloft.planner.task.plan import motor_load
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
GRAPHS = Path(aloft.__file__).parent / "graphs"
LOAD = dict.fromkeys(ROBOT.transmission.motors, 0.0) | {"left_knee_motor": 15.0}


def hardware(**drives: Any) -> Hardware:
    found = Hardware.for_twin(ROBOT)
    chosen = {"torque_constant": 0.35, **drives}
    return found.model_copy(update={"drives": found.drives.model_copy(update=chosen)})


def test_the_rise_is_the_copper_heat_of_the_plan() -> None:
    """15 N^2 m^2 s are 0.2 / 0.35^2 * 15 = 24.5 J at 25 deg C, and 39 % more at 125; half more of it in a run."""
    energy = 0.2 / 0.35**2 * 15.0
    assert rise_of(hardware(), "left_knee_motor", 25.0, LOAD) == pytest.approx(1.5 * energy / 15.0)
    assert rise_of(hardware(), "left_knee_motor", 125.0, LOAD) == pytest.approx(
        1.39 * 1.5 * energy / 15.0
    )
    assert rise_of(hardware(), "right_knee_motor", 25.0, LOAD) == 0.0
    assert rise_of(hardware(), "left_knee_motor", 25.0, None) == 5.0


def test_a_winding_cools_to_its_coolant() -> None:
    found = cooling_time(hardware(), 75.0, 50.0)
    assert found == pytest.approx(2.0 * 15.0 * math.log(2.0))
    assert cooling_time(hardware(), 50.0, 60.0) == 0.0
    assert cooling_time(hardware(), 50.0, 25.0) is None


def test_after_the_wait_that_is_said_the_jump_may_be_made() -> None:
    settings = hardware()
    hot = hot_winding(settings, "left_knee_motor", 74.0, LOAD)
    assert hot is not None and hot.wait is not None and hot.planned
    left = math.exp(-hot.wait / 30.0)
    cooled = 25.0 + 49.0 * left
    assert hot_winding(settings, "left_knee_motor", cooled - 1e-6, LOAD) is None
    assert hot_winding(settings, "left_knee_motor", cooled + 0.1, LOAD) is not None
    assert str(hot) == (
        "left_knee_motor has 74.0 deg C, and the plan heats it by 2.9 to 76.9: more than 75; wait 2 s"
    )
    assert hot_winding(settings, "right_knee_motor", 74.0, LOAD) is None
    never = hot_winding(settings, "left_knee_motor", 74.0, {"left_knee_motor": 600.0})
    assert "more than 75; it never cools so far: make a smaller jump" in str(never)
    usual = hot_winding(settings, "left_knee_motor", 71.0, None)
    assert "and a jump (`drives.jump_heating`) heats it by 5.0 to 76.0" in str(usual)


def test_the_load_of_a_kept_plan_is_read_without_the_plan() -> None:
    task = read_task(GRAPHS / "tasks" / "in_situ_12cm.yaml")
    library = PlanLibrary(ROBOT)
    plan = library.find(task)
    assert plan is not None
    assert library.load_of(task) == motor_load(plan.time, plan.joint_torque, ROBOT)
    assert library.load_of(task.model_copy(update={"rise": 0.0123})) is None


@pytest.mark.long
def test_a_twin_is_armed_by_what_its_plan_heats() -> None:
    """Of 71 deg C a jump of 12 cm leaves room, which a flat 5 K would not."""
    graph = aloft.load(
        GRAPHS / "jump_twin.yaml", overrides={"robot.actuators.windings": {"temperature": 71.0}}
    )
    task = read_task(GRAPHS / "tasks" / "in_situ_12cm.yaml")
    spec = next(block for block in graph.checked.blocks if block.path == "robot")
    assert spec.params.planned_load == PlanLibrary(ROBOT).load_of(task)  # type: ignore[attr-defined]
    assert graph.changed({"duration": "0.1 s"}).run(log=False).ticks == 50
    warmer = graph.changed({"robot.actuators.windings.temperature": 74.0}).run(log=False)
    assert not warmer.success
    text = r"left_knee_motor has 73\.\d deg C, and the plan heats it by 3\.0 to 76\.\d: more than 75; wait \d s"
    assert re.search(text, warmer.reason) and "ankle" not in warmer.reason
    flat = graph.changed({"robot.planned_load": None}).run(log=False)
    assert re.search(r"a jump \(`drives\.jump_heating`\) heats it by 5\.0 to 75\.\d", flat.reason)


def test_a_load_that_lacks_motors_is_refused() -> None:
    with pytest.raises(LoadError) as caught:
        aloft.load(
            GRAPHS / "jump_twin.yaml", overrides={"robot.planned_load": {"left_knee_motor": 3.0}}
        )
    assert "the planned load says nothing of right_yaw_motor, right_hip_motor_a" in str(
        caught.value
    )
    assert "planned_load: {from: plan.load}" in str(caught.value)


def test_nobody_reads_the_plan_for_a_graph_without_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr(PlanLibrary, "load_of", lambda self, task: asked.append(task))
    aloft.load(GRAPHS / "jump.yaml")
    assert asked == []
    aloft.load(GRAPHS / "jump_twin.yaml")
    assert len(asked) == 1
