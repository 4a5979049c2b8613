"""Jumps from a gantry: the robot hangs, is put down, stands, and only then the plan begins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.blocks.signals import Phase
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.stepping import SteppedRun

GRAPH = Path(aloft.__file__).parent / "graphs" / "from_gantry.yaml"


def run(log: bool = False, **overrides: Any) -> Any:
    names = {name.replace("__", "."): value for name, value in overrides.items()}
    return Executor(aloft.load(GRAPH, names).checked, log=log).run()


def test_the_plan_begins_when_all_switches_have_been_loaded() -> None:
    with SteppedRun(aloft.load(GRAPH, {"robot.seed": 5}).checked) as stepped:
        closed, phases, times = [], [], []
        while not stepped.reason and len(phases) < 1000:
            stepped.step()
            closed.append(np.array(stepped["robot.contacts.closed"]))
            phases.append(int(stepped["phase.phase.phase"]))
            times.append(float(stepped["plan.reference.time"]))
    stands = phases.index(Phase.STAND)
    assert 1.2 < 0.002 * stands < 2.0
    assert set(phases[:stands]) == {Phase.HANG} and Phase.HANG not in phases[stands:]
    assert max(times[: stands + 1]) < 0.0 and times[stands + 1] >= 0.0
    assert not np.any(closed[:250]) and np.mean(closed[stands - 100 : stands]) > 0.95


@pytest.mark.long
def test_a_robot_that_nobody_puts_down_waits_without_a_fault() -> None:
    result = run(robot__start__gantry={"height": 0.04, "lower_after": None})
    assert not result.success and result.reason == "the plan has not begun"
    assert result.metrics["safety_fault"] == "none"


@pytest.mark.long
def test_it_jumps_from_a_gantry_through_the_driver() -> None:
    gantry = {"height": 0.06, "speed": 0.1, "lower_after": 1.0}
    result = run(robot__use="hal.TwinRobot", robot__seed=1, robot__start__gantry=gantry)
    assert result.success, result.reason
