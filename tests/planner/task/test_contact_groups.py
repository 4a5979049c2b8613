"""Contact points by name and side, and phases in which they leave the ground and land in turn."""

from __future__ import annotations

from typing import Any

import pytest

from aloft.planner.task.contact_groups import contact_points, in_turn
from aloft.planner.task.read_task import contradictions
from aloft.planner.task.sequence import PhaseSpec
from aloft.planner.task.task import JumpTask, JumpTaskError, make_task
from aloft.robots.description import find_robot

GO2, BRUCE = find_robot("go2"), find_robot("bruce")
NAMES = [contact.name for contact in GO2.contacts]


def task(**values: Any) -> JumpTask:
    return make_task({"recipe": "paper", "name": "a", "robot": "go2", "rise": 0.1, **values})


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("all", NAMES),
        ("fore", ["FL", "FR"]),
        ("hind", ["RL", "RR"]),
        ("left", ["FL", "RL"]),
        (["FL", "RR"], ["FL", "RR"]),  # a diagonal
        ("R", ["FR", "RL", "RR"]),  # a part of a name
        ("toe", []),
    ],
)
def test_points_are_meant_by_name_or_by_side(words: Any, expected: list[str]) -> None:
    assert [NAMES[k] for k in contact_points(GO2, words)] == expected


def test_sides_are_those_of_points_and_names_come_first() -> None:
    names = [contact.name for contact in BRUCE.contacts]
    fore = [names[k] for k in contact_points(BRUCE, "fore")]
    assert sorted(fore) == ["left_toe", "right_toe"]
    assert sorted(names[k] for k in contact_points(BRUCE, "left")) == ["left_heel", "left_toe"]


def test_feet_leave_and_land_one_after_the_other() -> None:
    phase_specs = task(
        thrust_time="0.25 s",
        take_off={"FL": "80 ms", "RR": "80 ms", "FR": "30 ms"},
        touchdown={"hind": "60 ms"},
        landing_time="0.5 s",
    ).phase_specs()
    assert [phase_spec.phase for phase_spec in phase_specs] == [
        "squat", "thrust", "thrust", "thrust", "flight", "landing", "landing",
    ]  # fmt: skip
    on = [[NAMES[k] for k in phase_spec.on_ground(GO2)] for phase_spec in phase_specs]
    assert on[1:4] == [NAMES, ["FR", "RL"], ["RL"]]
    assert on[5:] == [["FL", "FR"], NAMES]
    assert [phase_spec.time for phase_spec in phase_specs[1:4]] == pytest.approx([0.17, 0.05, 0.03])
    assert [phase_spec.time for phase_spec in phase_specs[5:]] == pytest.approx([0.06, 0.44])


def test_a_free_time_is_that_of_the_part_on_all_points() -> None:
    parts = in_turn({"phase": "thrust", "time": None}, {"fore": 0.1}, 12, landing=False)
    assert [part["time"] for part in parts] == [None, 0.1]


def test_in_a_row_feet_leave_in_turn_every_time() -> None:
    phase_specs = task(repeat=2, take_off={"fore": "60 ms"}).phase_specs()
    before = [k - 1 for k, phase_spec in enumerate(phase_specs) if phase_spec.phase == "flight"]
    assert [phase_specs[k].raised for k in before] == [("fore",), ("fore",)]


def test_a_plan_is_kept_under_the_same_hash_whether_or_not_feet_could_leave_in_turn() -> None:
    plain = task()
    assert "take_off" not in plain.content() and "touchdown" not in plain.content()
    assert task(take_off={"fore": 0.08}).hash(GO2) != plain.hash(GO2)
    assert "raised" not in task(phases=[{"phase": "squat"}, {"phase": "thrust"}, {"phase": "flight"},
                                        {"phase": "landing"}]).content()["phases"][0]  # fmt: skip


@pytest.mark.parametrize(
    ("values", "where", "text"),
    [
        ({"take_off": {"FX": 0.1}}, "take_off.FX", "like 'FX'; there is FL, FR, RL, RR, or a side: fore, hind"),
        ({"take_off": {"fore": 0.1, "hind": 0.05}}, "take_off", "names all contact points of go2"),
        ({"take_off": {"fore": 0.1}, "formulation": "srbm"}, "take_off", "formulation srbm has nothing for it"),
        ({"phases": [{"phase": "thrust"}, {"phase": "thrust", "contacts": "toe"}, {"phase": "flight"},
                     {"phase": "landing"}]}, "phases.1.contacts", "like 'toe'"),
    ],
)  # fmt: skip
def test_what_no_robot_can_do_is_said(values: dict[str, Any], where: str, text: str) -> None:
    [(key, said)] = contradictions(task(**values), GO2)
    assert key == where and text in said


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"take_off": {}}, "name contact points and a time"),
        ({"take_off": {"fore": 0.1}, "phases": [{"phase": "thrust"}, {"phase": "flight"}, {"phase": "landing"}]},
         "give take_off, or phases"),
        ({"take_off": {"fore": "10 cm"}}, "take_off"),
        ({"take_off": {"fore": 0.2}, "thrust_time": 0.2}, "take_off: fore: expected .* up to 0.17 s in this thrust, found 0.2"),
        ({"touchdown": {"hind": 0.0}}, "touchdown: hind: expected a time above 0 and up to 0.5 s"),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_refused(values: dict[str, Any], text: str) -> None:
    with pytest.raises(JumpTaskError, match=text):
        task(**values)


def test_raised_points_are_not_on_the_ground() -> None:
    phase_spec = PhaseSpec(phase="thrust", contacts="left", raised=("fore",))
    assert [NAMES[k] for k in phase_spec.on_ground(GO2)] == ["RL"]
    assert PhaseSpec(phase="flight").on_ground(GO2) == ()
