"""A robot in a gantry hangs, swings as a pendulum, is let down, and then the rope pulls no more."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.blocks.signals import CommandMode
from aloft.hal.simulated.gantry import DISTANCE, PAID_OUT

from .simulated_bruce import bench, hold

WAITS = {"lower_after": None}


def lowest(robot: Any) -> float:
    return float(robot.get("truth").contact_position[:, 2].min())


def load(robot: Any) -> float:
    return float(robot.get("truth").contact_force[:, 2].sum())


@pytest.mark.parametrize("height", [0.02, 0.1])
def test_it_hangs_with_its_weight_on_the_rope(height: float) -> None:
    robot = bench(gantry={"height": height, **WAITS})
    hold(robot)
    for _ in range(200):
        robot.step()
    assert lowest(robot) == pytest.approx(height, abs=1e-3)
    assert load(robot) == 0.0 and not robot.get("contacts").closed.any()
    plant = robot.block.plant
    stretch = plant.physics.gantry[DISTANCE] - plant.gantry._rope.length[0]
    pull = plant.gantry._rope.stiffness * stretch
    assert pull == pytest.approx(robot.block.robot.weight, rel=0.01)


def test_it_is_let_down_at_the_speed_asked_for_and_then_stands_alone() -> None:
    robot = bench(gantry={"height": 0.04, "lower_after": 0.1, "speed": 0.08, "slack": 0.2})
    hold(robot)
    heights = []
    for _ in range(600):
        robot.step()
        heights.append(lowest(robot))
    assert heights[45] == pytest.approx(0.04, abs=1e-3)
    sinking = (heights[100] - heights[200]) / 0.2
    assert sinking == pytest.approx(0.08, rel=0.05)
    assert load(robot) == pytest.approx(robot.block.robot.weight, rel=0.02)
    assert robot.get("contacts").closed.all()
    assert robot.block.plant.physics.gantry[PAID_OUT] > 0.2


def test_somebody_lets_it_down_and_lifts_it_again() -> None:
    robot = bench(gantry={"height": 0.03, "slack": 0.1, **WAITS})
    hold(robot)
    for _ in range(100):
        robot.step()
    assert load(robot) == 0.0
    robot.block.plant.gantry.let_down()
    for _ in range(500):
        robot.step()
    assert load(robot) > 40.0
    robot.block.plant.gantry.lift()
    for _ in range(500):
        robot.step()
    assert load(robot) == 0.0 and lowest(robot) == pytest.approx(0.03, abs=3e-3)


def test_the_slack_catches_a_robot_that_collapses() -> None:
    robot = bench(gantry={"height": 0.01, "lower_after": 0.0, "speed": 0.2, "slack": 0.05})
    hold(robot)
    for _ in range(250):
        robot.step()
    standing = float(robot.get("truth").base_position[2])
    robot.set("command", mode=CommandMode.OFF)
    for _ in range(750):
        robot.step()
    assert standing - float(robot.get("truth").base_position[2]) == pytest.approx(0.06, abs=0.02)


def test_a_restored_run_goes_on_bit_for_bit() -> None:
    robot = bench(gantry={"height": 0.03, "lower_after": 0.05, "speed": 0.1})
    hold(robot)
    for _ in range(100):
        robot.step()
    kept = robot.snapshot()
    ends = []
    for _ in range(2):
        robot.restore(kept)
        for _ in range(200):
            robot.step()
        ends.append(np.array(robot.get("truth").com))
    assert ends[0].tobytes() == ends[1].tobytes()
