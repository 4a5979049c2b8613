"""The ground of a task: every jump finds its own height, and what cannot be built is said."""

from typing import Any

import pytest

from aloft.planner.task.ground import scene_of
from aloft.planner.task.task import JumpTaskError, make_task
from aloft.robots.description import find_robot

BRUCE = find_robot("bruce")


def scene(**values: Any) -> Any:
    return scene_of(make_task({"name": "odd", "rise": 0.12, **values}), BRUCE)


def boxes(**values: Any) -> list[tuple[float, float, float, float]]:
    """The boxes as from and to along x, top and bottom."""
    return [(*b["x"], b["top"], b["bottom"]) for b in scene(**values)["boxes"]]


def test_level_jumps_need_no_steps() -> None:
    assert scene(distance_x=0.2, twist=1.0) == "flat"
    assert scene(repeat=3, distance_x=0.1) == "flat"


def test_a_step_up_begins_at_its_edge() -> None:
    up = scene(distance_x=0.2, landing_height=0.05)
    assert up["floor"] == 0.0
    assert boxes(distance_x=0.2, landing_height=0.05) == [(0.1, 1.7, 0.05, 0.0)]
    assert boxes(distance_x=0.2, landing_height=0.05, step_edge=0.075)[0][0] == 0.075


def test_a_step_down_ends_the_platform_that_it_starts_on() -> None:
    assert scene(distance_x=0.2, landing_height=-0.15)["floor"] == -0.15
    assert boxes(distance_x=0.2, landing_height=-0.15, step_edge=0.07) == [(-1.5, 0.07, 0.0, -0.15)]


def test_backward_the_step_is_behind() -> None:
    assert boxes(distance_x=-0.2, landing_height=0.05) == [(-1.7, -0.1, 0.05, 0.0)]
    assert boxes(distance_x=-0.3, landing_height=-0.35, step_edge=-0.1) == [(-0.1, 1.5, 0.0, -0.35)]


def test_aside_the_edge_is_along_y() -> None:
    (box,) = scene(distance_y=0.3, landing_height=0.03)["boxes"]
    assert box["y"] == [0.15, 1.8]
    assert box["x"] == [-0.75, 0.75]


def test_up_and_down_in_a_row_is_a_platform_between_two_edges() -> None:
    jumps = [{"landing_height": 0.05, "step_edge": 0.075},
             {"landing_height": -0.05, "step_edge": 0.07, "distance_x": 0.15}]  # fmt: skip
    assert boxes(distance_x=0.14, jumps=jumps) == [(0.075, 0.21, 0.05, 0.0)]


def test_stairs_are_one_box_each() -> None:
    found = boxes(distance_x=0.2, landing_height=0.04, repeat=2)
    assert found == [(0.1, 0.3, 0.04, 0.0), (0.3, 1.9, 0.08, 0.0)]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"landing_height": 0.05}, "it lands 0.05 m higher or lower where it stood"),
        (
            {"jumps": [{"distance_x": 0.2, "landing_height": 0.05},
                       {"distance_y": 0.3, "landing_height": 0.05}]},
            "one jump has its step ahead and another aside",
        ),
        (
            {"distance_y": 0.1, "landing_height": 0.05},
            "m needs ground at 0 m, and the steps of the task put it at 0.05 m",
        ),
        (
            {"jumps": [{"distance_x": 0.2, "landing_height": 0.05}, {"distance_x": -0.2}]},
            "at place 2 a foot at",
        ),
    ],
)  # fmt: skip
def test_ground_that_cannot_be_built_is_refused(values: dict[str, Any], words: str) -> None:
    with pytest.raises(JumpTaskError) as caught:
        scene(**values)
    assert "landing_height: " in str(caught.value)
    assert words in str(caught.value)
    assert "robot.scene" in str(caught.value)
