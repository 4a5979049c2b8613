"""Tasks: what is read, what is refused and with which words, and what decides the hash."""

import math
from pathlib import Path

import pytest

from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import _LEADING, JumpTask, JumpTaskError, Knots, make_task
from aloft.robots.description import find_robot


def test_quantities_are_read_with_their_units() -> None:
    task = make_task({"name": "a", "rise": "15 cm", "twist": "30 deg", "thrust_time": "200 ms"})
    assert task.rise == pytest.approx(0.15)
    assert task.twist == pytest.approx(math.pi / 6)
    assert task.thrust_time == pytest.approx(0.2)


def test_about_sixty_intervals() -> None:
    assert 55 <= Knots().total <= 70


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"rise": 0.1, "take_off_speed": 1.0}, "give rise or take_off_speed, not both"),
        ({}, "say how high the jump is: rise, take_off_speed or flight_time"),
        (
            {"rise": 0.05, "landing_height": 0.3},
            "a rise of 0.05 m cannot reach ground that is 0.3 m higher; ask for",
        ),
        ({"rise": "3 kg"}, "rise: expected a number in m, found '3 kg'"),
        ({"rise": -0.1}, "rise: expected more than 0 m, found -0.1"),
        ({"rise": 0.1, "hight": 2}, "hight: is no parameter of a task; the nearest is "),
        ({"rise": 0.1, "knots": {"flight": 1}}, "knots.flight: expected at least"),
        ({"rise": 0.1, "formulation": "fast"}, "formulation: expected 'full', 'paper'"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(values: dict[str, object], words: str) -> None:
    with pytest.raises(JumpTaskError) as caught:
        make_task({"name": "a", **values}, where="jump.yaml")
    assert f"jump.yaml: {words}" in str(caught.value)


COPIED = (
    {"rise": 0.1, "distance_x": 0.1},
    {"rise": 0.1, "jumps": [{"distance_x": 0.1}, {"rise": 0.05}], "repeat": 2},
    {"rise": 0.1, "slope": [0.05, 0.0], "jumps": [{"landing_slope": [0.0, 0.1]}]},
    {"rise": 0.1, "repeat": 3, "rough": {"seed": 1}},
)


@pytest.mark.parametrize("values", COPIED)
def test_a_copy_keeps_where_it_leads_unless_that_changes(values: dict[str, object]) -> None:
    task = make_task({"name": "a", **values})
    hops, places = task.hops(), task.places()
    same = task.model_copy(update={"effort": 0.7, "name": "b"})
    assert same.hops() is hops and same.places() is places
    moved = task.model_copy(update={"twist": 0.3})
    assert moved.hops() == make_task({"name": "a", "twist": 0.3, **values}).hops() != hops


@pytest.mark.parametrize("values", COPIED)
def test_hops_and_places_follow_from_what_counts_as_leading(values: dict[str, object]) -> None:
    task, read = make_task({"name": "a", **values}), set[str]()

    class Watched:
        def __getattr__(self, name: str) -> object:
            read.add(name)
            return getattr(task, name)

    for name in ("_every_hop", "_every_place"):
        vars(JumpTask)[name].func(Watched())
    assert read & set(JumpTask.model_fields) <= _LEADING


def test_all_that_is_wrong_is_said_at_once() -> None:
    with pytest.raises(JumpTaskError) as caught:
        make_task({"name": "a", "rise": -1.0, "friction": 9.0, "distance_x": 7.0})
    assert len(str(caught.value).splitlines()) == 3


def test_a_file_gives_the_task_its_name(tmp_path: Path) -> None:
    path = tmp_path / "hop.yaml"
    path.write_text("rise: 5 cm\ninitial: {right_knee: -40 deg}\n")
    task = read_task(path)
    assert task.name == "hop"
    assert task.initial["right_knee"] == pytest.approx(math.radians(-40))


@pytest.mark.parametrize(
    ("text", "words"),
    [("rise: [", "broken.yaml:1:8: did not find"), ("- 3", "expected keys such as")],
)
def test_a_file_that_is_no_task(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(JumpTaskError, match=words):
        read_task(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(JumpTaskError, match=r"cannot read .*no\.yaml: No such file"):
        read_task(tmp_path / "no.yaml")


def test_an_unknown_joint_of_a_stance_is_named() -> None:
    task = make_task({"name": "a", "rise": 0.1, "final": {"right_elbow": 0.1}})
    with pytest.raises(
        JumpTaskError, match="final: bruce has no joint right_elbow; there is right_"
    ):
        task.end_joints(find_robot("bruce"))
    assert task.start_joints(find_robot("bruce"))["left_knee"] == -0.8


def test_held_joints_that_take_part() -> None:
    robot = find_robot("bruce").changed(held={"left_hip_yaw": 0.1, "right_hip_yaw": -0.1})
    still = make_task({"name": "a", "rise": 0.1})
    moves = make_task({"name": "a", "rise": 0.1, "moving": ["*_hip_yaw"]})
    assert "moving" not in still.content() and still.hash(robot) != moves.hash(robot)
    assert still.equipped(robot) is robot and not moves.equipped(robot).held
    assert moves.equipped(moves.equipped(robot)) == moves.equipped(robot)
    assert moves.start_joints(moves.equipped(robot)) == still.start_joints(robot)
    wrong = make_task({"name": "a", "rise": 0.1, "moving": ["*_elbow"]})
    with pytest.raises(
        JumpTaskError, match=r"moving: bruce has no joint '\*_elbow'; it holds left"
    ):
        wrong.equipped(robot)


def test_the_hash_follows_what_decides_the_plan() -> None:
    robot = find_robot("bruce")
    base = JumpTask(name="a", rise=0.15)
    assert base.hash(robot) == JumpTask(name="b", rise=0.15).hash(robot), "a name decides nothing"
    assert base.hash(robot) != JumpTask(name="a", rise=0.16).hash(robot)
    assert base.hash(robot) != JumpTask(name="a", rise=0.15, touchdown_lean=0.2).hash(robot)
    assert "touchdown_lean" not in base.content(), "what is not given decides nothing"
    heavier = robot.model_copy(update={"text": "another robot"})
    assert base.hash(robot) != base.hash(heavier)
