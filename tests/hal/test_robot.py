from __future__ import annotations

from typing import Any

import pytest

from aloft.blocks.signals import DrivePhase
from aloft.blocks.signals.robot import HEALTHY
from aloft.hal.robot import Robot
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.testing.bench import BlockBench


class Recorded(Robot):
    """A robot that only writes down what is called."""

    def __init__(self, params: Parameters, context: Any) -> None:
        super().__init__(params, context)
        self.calls: list[str] = []

    def open(self) -> None:
        self.calls.append("open")

    def read(self) -> None:
        self.calls.append("read")

    def write(self) -> None:
        self.calls.append("write")

    def advance(self) -> None:
        self.calls.append("advance")

    def damp(self) -> None:
        self.calls.append("damp")


def test_a_robot_lives_through_its_four_methods() -> None:
    bench = BlockBench(Recorded, robot="bruce")
    bench.step(2)
    bench.block.stop_cycle()
    assert bench.block.calls == ["open", *["read", "write", "advance"] * 2, "damp"]
    assert Recorded.is_moore()


def test_the_simulated_robot_has_every_robots_ports() -> None:
    assert set(Robot.outputs) == {"imu", "joints", "contacts", "health"}
    assert set(Robot.inputs) == {"command"}
    for name, port in {**Robot.outputs, **Robot.inputs}.items():
        assert {**MujocoRobot.outputs, **MujocoRobot.inputs}[name].signal is port.signal
    assert MujocoRobot.outputs["truth"].truth and MujocoRobot.inputs["push"].optional
    assert not any(output.truth for output in Robot.outputs.values())


def test_a_robot_that_reports_nothing_of_itself_is_well() -> None:
    bench = BlockBench(Recorded, robot="bruce")
    bench.step(3)
    health = bench.get("health")
    assert set(health.condition.tolist()) == {HEALTHY} and health.state == DrivePhase.DRIVING
    assert health.joints_valid and health.imu_valid and health.contacts_valid
    assert health.stamp == 2 * 0.002 and not health.age.any()


def test_a_driver_that_lacks_a_method_cannot_be_made() -> None:
    class Half(Robot):
        def open(self) -> None: ...

        def read(self) -> None: ...

    with pytest.raises(TypeError, match="abstract"):
        BlockBench(Half, robot="bruce")
