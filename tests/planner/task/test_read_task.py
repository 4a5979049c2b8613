"""A task file with changes: what is merged, what takes whose place, and the name.

Contradictions: found with their parameter, and never in a task that can be planned.
"""

from pathlib import Path
from typing import Any

import pytest
from tests.robots.example_robots import needs_robots

from aloft.planner.library.library import SHIPPED, solve_and_check
from aloft.planner.task.read_task import (
    changed_task,
    contradictions,
    describe_task,
    leg_travel,
    read_task,
)
from aloft.planner.task.task import JumpTaskError, make_task
from aloft.robots.description import find_robot

TEXT = "rise: 12 cm\nweights: {force: 0.01, impulse: 5}\nmargins: {joints: 0.06 rad}\n"


@pytest.fixture
def hop(tmp_path: Path) -> Path:
    path = tmp_path / "hop.yaml"
    path.write_text(TEXT)
    return path


def test_changes_are_merged_also_inside_weights_and_margins(hop: Path) -> None:
    changes = {"distance_x": "20 cm", "weights": {"impulse": 2}, "margins": {"pressure": 0.1}}
    task = changed_task(hop, changes)
    assert (task.rise, task.distance_x) == (0.12, 0.2)
    assert (task.weights.force, task.weights.impulse) == (0.01, 2.0)
    assert task.margins is not None
    assert (task.margins.joints, task.margins.pressure) == (0.06, 0.1)


def test_a_speed_takes_the_place_of_the_rise(hop: Path) -> None:
    task = changed_task(hop, {"take_off_speed": "1.5 m/s"})
    assert (task.rise, task.take_off_speed) == (None, 1.5)


def test_a_changed_task_is_called_by_what_it_asks_for(hop: Path) -> None:
    assert changed_task(hop, {"distance_x": 0.2}).name == "12 cm high, 20 cm ahead"
    assert changed_task(hop, {"distance_x": 0.2, "name": "far"}).name == "far"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rize": 0.1}, "task: rize: is no parameter of a task; the nearest is rise"),
        ({"rise": "12 deg"}, "task: rise: expected a number in m, found '12 deg'"),
        ({"distance_x": 0.05, "landing_height": 0.05}, "task: step_edge: the step's edge"),
    ],
)
def test_a_wrong_change_is_named(hop: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(JumpTaskError) as caught:
        changed_task(hop, changes)
    assert str(caught.value).startswith(words)


def test_what_is_wrong_in_the_file_has_its_line(hop: Path) -> None:
    hop.write_text(TEXT + "distans: 3\n")
    with pytest.raises(JumpTaskError, match=r"hop.yaml:4:1: distans"):
        changed_task(hop, {"rise": 0.1})


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"rise": 0.12, "distance_x": -0.1, "distance_y": -0.05}, "12 cm high, 10 cm back, 5 cm to the right"),
        ({"rise": 0.1, "twist": 0.5235987755982988}, "10 cm high, turned 30 deg"),
        ({"rise": 0.1, "landing_height": -0.05, "distance_x": 0.2}, "10 cm high, 20 cm ahead, 5 cm down"),
        ({"rise": 0.1, "repeat": 3}, "3 jumps"),
        ({"take_off_speed": 1.5}, "1.5 m per s up"),
    ],
)  # fmt: skip
def test_the_words(values: dict[str, Any], words: str) -> None:
    assert describe_task(make_task({"name": "", **values})) == words


ROBOT = find_robot("bruce")
STEP = {"rise": 0.15, "distance_x": 0.1, "landing_height": 0.05}


def found(**values: Any) -> list[tuple[str, str]]:
    return contradictions(make_task({"name": "odd", **values}), ROBOT)


@pytest.mark.parametrize("path", sorted((SHIPPED.parent / "tasks").glob("*.yaml")), ids=str)
def test_shipped_tasks_have_none(path: Path) -> None:
    assert contradictions(read_task(path), ROBOT) == []


@pytest.mark.parametrize(
    ("values", "key", "words"),
    [
        ({"rise": 0.15, "flight_time": 0.7}, "flight_time", "a rise of 0.15 m takes 0."),
        ({"rise": 0.15, "flight_time": 0.05}, "flight_time", "leave flight_time to the planner"),
        ({"take_off_speed": 1.5, "flight_time": 0.6}, "flight_time", "a take_off_speed of 1.5"),
        ({**STEP, "step_edge": 0.02}, "step_edge", "under the feet at the start, which reach from"),
        ({**STEP, "step_edge": 0.12}, "step_edge", "under the feet at the landing"),
        ({**STEP, "distance_x": 0.05}, "step_edge", "x = 0.025 m is under the feet at the start"),
        ({"rise": 0.1, "profile": "petrol"}, "profile", "there is koala, relaxed"),
        ({"rise": 0.1, "initial": {"right_ancle": 0.1}}, "initial.right_ancle", "right_ankle"),
        ({"rise": 0.1, "final": {"right_knee": 9}}, "final.right_knee", "outside the joint's lim"),
    ],
)
def test_what_contradicts_itself(values: dict[str, Any], key: str, words: str) -> None:
    problems = found(**values)
    assert problems[0][0] == key
    assert words in problems[0][1]


@needs_robots
def test_a_quadruped_stands_wholly_on_either_side_of_an_edge() -> None:
    """Its feet where they stand, and its knees, which reach behind them, where the ground is higher."""
    go2 = find_robot("go2")
    off = {"name": "off", "rise": 0.08, "landing_height": -0.15}

    def told(**values: Any) -> list[str]:
        return [text for _, text in contradictions(make_task({**off, **values}), go2)]

    assert "under the feet at the start, which reach from -0.19" in told(distance_x=0.3)[0]
    (knee,) = told(distance_x=0.6)
    assert "x = 0.3 m is under RL_calf at the landing, which reach from 0.2" in knee
    assert told(distance_x=0.6, landing_height=0.08) == [], "the knees are above that step"
    assert told(distance_x=0.75, step_edge=0.28) == []


def test_several_are_all_told() -> None:
    problems = found(**STEP, step_edge=0.0, flight_time=0.9, profile="petrol")
    assert [key for key, _ in problems] == ["profile", "flight_time", "step_edge"]


@pytest.mark.parametrize(
    "values",
    [
        {"rise": 0.15, "flight_time": 0.33},
        {"take_off_speed": 1.5, "flight_time": 0.3},
        {"rise": 0.12, "landing_height": -0.3, "flight_time": 0.45},
        {**STEP, "step_edge": 0.055},
        {"rise": 0.15, "landing_height": 0.05},
    ],
)
def test_what_can_be_is_let_through(values: dict[str, Any]) -> None:
    assert found(**values) == []


def test_each_of_several_jumps_is_looked_at() -> None:
    jumps = [{"landing_height": 0.05}, {"landing_height": -0.05, "flight_time": 0.9}]
    problems = found(rise=0.12, distance_x=0.1, jumps=jumps, repeat=2)
    assert [key for key, _ in problems] == ["jumps.1.flight_time"]
    problems = found(
        rise=0.12, distance_x=0.1, jumps=[{}, {"landing_height": 0.05, "step_edge": 0}]
    )
    assert [key for key, _ in problems] == ["jumps.1.step_edge"]
    assert "x = 0.1 m is under the feet at the start" in problems[0][1]


def test_legs_can_bend_more_than_they_can_stretch() -> None:
    low, high = leg_travel(ROBOT)
    assert -0.5 < low < -0.2
    assert 0.03 < high < 0.12


def test_nothing_is_solved_for_a_contradiction() -> None:
    def solve(*_: Any) -> Any:
        raise AssertionError("it was solved")

    with pytest.raises(JumpTaskError, match=r"odd: flight_time: a rise of 0\.15 m takes"):
        solve_and_check(
            make_task({"name": "odd", "rise": 0.15, "flight_time": 0.9}), ROBOT, None, solve
        )
