"""A library that only an extra brings is asked for in one line."""

import sys
from pathlib import Path

import pytest

from aloft.extensions.ros2.node import NodeAddress, join
from aloft.planner.solving.solve import solve_jump
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import MissingExtraError, need_extra

ROOT = Path(__file__).parents[3]


def test_what_is_there_is_not_asked_for() -> None:
    need_extra("numpy", "plan", "counting")


def test_planning_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    task = read_task(ROOT / "graphs" / "tasks" / "in_situ_12cm.yaml")
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(MissingExtraError) as raised:
        solve_jump(task, find_robot("bruce"))
    assert str(raised.value) == (
        "planning a jump needs the library casadi: pip install 'casadi>=3.8'"
    )


def test_topics_say_what_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(MissingExtraError, match=r"topic of ROS 2 .* 'rosbags"):
        join(NodeAddress("tcp/127.0.0.1:1", 0, "", "n"))
