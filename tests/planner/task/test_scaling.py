"""What a task leaves unsaid suits the robot's size; what it says stays."""

import pytest
from tests.robots.limbed_robots import quadruped

from aloft.planner.task.scaling import scaled_defaults, standing_height
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

HEAVY = quadruped().changed(
    links=tuple(link.model_copy(update={"mass": 4.0 * link.mass}) for link in quadruped().links)
)


def test_the_robot_of_the_defaults_changes_none() -> None:
    robot, task = find_robot("bruce"), make_task({"recipe": "paper", "name": "a", "rise": 0.1})
    assert standing_height(robot) == pytest.approx(0.3287, abs=1e-4)
    assert scaled_defaults(task, robot) == {}
    assert task.resolved(robot).content() == task.content() | {"profile": "koala"}


def test_a_heavier_robot_pays_less_for_forces() -> None:
    task = make_task({"recipe": "paper", "name": "a", "rise": 0.1})
    light, heavy = (task.resolved(robot) for robot in (quadruped(), HEAVY))
    assert heavy.weights.force == pytest.approx(light.weights.force / 16.0, rel=0.02)
    assert heavy.weights.impulse == pytest.approx(light.weights.impulse / 16.0, rel=0.02)
    assert heavy.weights.orientation == task.weights.orientation
    assert heavy.thrust_time == light.thrust_time
    assert light.resolved(quadruped()) == light


def test_what_is_said_stays() -> None:
    said = {
        "recipe": "paper",
        "name": "a",
        "rise": 0.1,
        "thrust_time": 0.25,
        "weights": {"force": 0.001},
    }
    task = make_task(said).resolved(HEAVY)
    assert (task.thrust_time, task.weights.force) == (0.25, 0.001)
    assert task.weights.impulse < 0.05
    assert task.squat_time != 0.4


def test_a_plans_file_says_all_so_that_it_is_never_scaled_again() -> None:
    task = make_task({"recipe": "paper", "name": "a", "rise": 0.1}).resolved(HEAVY)
    again = make_task(task.model_dump(mode="json"))
    assert again.hash(HEAVY) == task.hash(HEAVY)
    assert again.resolved(HEAVY).content() == task.content()
