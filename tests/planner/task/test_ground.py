"""The ground of a task: every jump finds its own height, and what cannot be built is said."""

import math
from typing import Any

import pytest

from aloft.hal.simulated.scenes import SceneParameters
from aloft.planner.task.ground import scene_of
from aloft.planner.task.sequence import ground_axes
from aloft.planner.task.task import JumpTaskError, make_task
from aloft.robots.description import find_robot
from aloft.robots.terrain import Terrain

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


def built(**values: Any) -> Terrain:
    """The simulator's ground of a task."""
    return SceneParameters.model_validate(scene(**values)).build()


@pytest.mark.parametrize(
    "jumps",
    [
        [["10 deg", 0]],
        [[0, "-12 deg"]],
        [["8 deg", "3 deg"], None],
        [["-8 deg", 0], ["8 deg", "5 deg"]],
    ],
)
def test_the_simulators_ground_is_where_the_planner_has_it(jumps: list[Any]) -> None:
    values = {"distance_x": 0.2, "jumps": [{"landing_slope": slope} for slope in jumps]}
    task, ground = make_task({"name": "odd", "rise": 0.12, **values}), built(**values)
    for place in task.places():
        for x, y in ((0.0, 0.0), (0.06, 0.1), (-0.06, -0.1)):
            at = place.x + x, place.y + y
            assert ground.height(*at) == pytest.approx(float(place.height(*at)), abs=1e-6)
            assert ground.normal(*at) == pytest.approx(ground_axes(place.slope)[:, 2], abs=1e-9)


def test_the_score_is_told_what_the_ground_rises_under_the_feet_alone() -> None:
    tangent = math.tan(math.radians(10.0))
    found = built(distance_x=0.2, landing_slope=["10 deg", 0]).uneven
    assert found == pytest.approx((0.0425 + 0.02) * tangent, abs=1e-4)
    level_again = [{"landing_slope": ["10 deg", 0]}, {"landing_slope": [0, 0]}]
    assert built(distance_x=0.2, jumps=level_again).uneven == 0.0


@pytest.mark.parametrize(
    "values",
    [
        {"slope": ["5 deg", "-3 deg"]},
        {"slope": ["-8 deg", 0], "distance_x": 0.2},
        {"slope": [0, "8 deg"], "distance_x": 0.2, "landing_slope": [0, 0]},
    ],
)
def test_a_start_where_the_ground_leans(values: dict[str, Any]) -> None:
    task, ground = make_task({"name": "odd", "rise": 0.12, **values}), built(**values)
    for place in task.places():
        for x, y in ((0.0, 0.0), (0.06, 0.1), (-0.06, -0.1)):
            at = place.x + x, place.y + y
            assert ground.height(*at) == pytest.approx(float(place.height(*at)), abs=1e-6)


def test_where_it_stood_the_ground_cannot_lean_otherwise() -> None:
    with pytest.raises(
        JumpTaskError,
        match="landing_slope: it lands where it stood, and the ground leans otherwise",
    ):
        scene(landing_slope=["5 deg", 0])


@pytest.mark.parametrize("rise", ["3 cm", "-3 cm"])
def test_known_stairs_are_the_scenes(rise: str) -> None:
    values = {"distance_x": 0.3, "stairs": {"x": 0.15, "rise": rise, "run": 0.3, "steps": 2},
              "repeat": 3}  # fmt: skip
    task, ground = make_task({"name": "odd", "rise": 0.12, **values}), built(**values)
    assert len({place.z for place in task.places()}) == 3
    for place in task.places():
        assert ground.height(place.x, place.y) == pytest.approx(place.z, abs=1e-9)
    with pytest.raises(
        JumpTaskError, match=r"stairs: at place 1 a foot at x = 0\.\d+ m is on another"
    ):
        scene(distance_x=0.2, stairs={"x": 0.18, "rise": rise, "run": 0.3, "steps": 2})


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
    assert "robot.ground.scene" in str(caught.value)
