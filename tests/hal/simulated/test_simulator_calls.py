"""The simulator steps to the same bytes by machine code and by its module for Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.hal.simulated import simulator_calls
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.runtime.testing.bench import BlockBench

from .simulated_bruce import hold

PUSHES = {3: [20.0, -5.0, 1.0], 9: [0.0, 40.0, 0.0]}


def run(ticks: int = 20, **options: Any) -> tuple[BlockBench[MujocoRobot], list[bytes]]:
    """A robot with every disturbance that is pushed at two points; its ports in every tick."""
    params = {**MujocoRobot.example_parameters(), "seed": 7}
    robot: BlockBench[MujocoRobot] = BlockBench(MujocoRobot, params, robot="bruce", **options)
    hold(robot)
    seen = []
    for tick in range(ticks):
        robot.set("push", force=PUSHES.get(tick, [0.0, 0.0, 0.0]), point=tick % 4)
        robot.step()
        seen.append(robot.memory.bus.buffer.tobytes())
    for _ in range(2):
        robot.block.stop_cycle()
    robot.block.emit()
    return robot, [*seen, robot.memory.bus.buffer.tobytes(), robot.snapshot().state]


def test_machine_code_and_python_simulate_the_same_bytes() -> None:
    quick, seen = run()
    slow, expected = run(plain=True)
    assert quick.block._ticking.native and quick.block._damped.native
    assert not slow.block._ticking.native
    assert seen == expected


def test_without_the_address_of_its_functions_python_calls_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(simulator_calls, "_addresses", lambda: (0, 0))
    robot, seen = run(5)
    assert not robot.block._ticking.native
    monkeypatch.undo()
    assert seen == run(5)[1]


def test_a_simulation_that_diverges_is_noticed() -> None:
    """What is not a number stays so, also where no interpreter looks at the simulator's warning."""
    robot, _ = run(2)
    data: Any = robot.block.plant.data
    data.qvel[3] = np.nan
    robot.step()
    robot.block.emit()
    assert np.isnan(robot.get("truth").base_angular_velocity).any()
