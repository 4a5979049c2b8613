"""Several jumps and sequences of contacts: how they are written, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from aloft.planner.task.sequence import Hop, Place, edge_of
from aloft.planner.task.task import JumpTask, TaskError, make_task
from aloft.robots.description import find_robot


def task(**values: Any) -> JumpTask:
    return make_task({"recipe": "paper", "name": "a", **values})


def test_a_jump_alone_is_one_of_a_row() -> None:
    one = task(rise=0.1, distance_x=0.05)
    assert one.hops() == (one.hops()[0],)
    assert (one.hops()[0].rise, one.hops()[0].distance_x) == (0.1, 0.05)
    assert [span.phase for span in one.spans()] == ["squat", "thrust", "flight", "landing"]


def test_jumps_take_from_the_task_what_they_do_not_say() -> None:
    both = task(rise="10 cm", distance_x=0.1, jumps=[{}, {"take_off_speed": 1.2}], repeat=2)
    assert [hop.rise for hop in both.hops()] == [0.1, None, 0.1, None]
    assert [hop.take_off_speed for hop in both.hops()] == [None, 1.2, None, 1.2]
    assert [place.x for place in both.places()] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_between_two_jumps_the_robot_lands_and_pushes_off() -> None:
    spans = task(rise=0.1, repeat=2, contact_time="0.3 s").spans()
    assert [span.phase for span in spans] == [
        "squat", "thrust", "flight", "landing", "thrust", "flight", "landing",
    ]  # fmt: skip
    assert [span.time for span in spans] == [0.4, 0.25, None, 0.15, 0.15, None, 0.5]


def test_places_add_up_and_edges_lie_between_them() -> None:
    steps = task(
        rise=0.15, distance_x=0.1, twist=0.2,
        jumps=[{"landing_height": "5 cm"}, {"landing_height": "-5 cm", "rotation": 6.28}],
    )  # fmt: skip
    assert steps.places()[1] == Place(0.1, 0.0, 0.05, 0.2, 0.0)
    assert steps.places()[2] == Place(0.2, 0.0, 0.0, 0.4, 6.28)
    edges = [edge_of(hop, at) for hop, at in zip(steps.hops(), steps.places(), strict=False)]
    assert edges == pytest.approx([0.05, 0.15])
    assert edge_of(Hop(landing_height=0.1, step_edge=0.02), Place(1.0, 0, 0, 0, 0)) == 1.02
    assert edge_of(Hop(landing_height=0.1), Place(1.0, 0, 0, 0, 0)) is None


@pytest.mark.parametrize("name", ["squat_time", "thrust_time", "landing_time", "flight_time"])
def test_times_may_be_free(name: str) -> None:
    free = task(rise=0.1, **{name: "free"})
    assert getattr(free, name) is None
    again = make_task(free.model_dump(mode="json"))
    assert again.hash(find_robot("bruce")) == free.hash(find_robot("bruce"))


def test_a_sequence_of_contacts() -> None:
    names = [contact.name for contact in find_robot("bruce").contacts]
    spans = task(
        rise=0.1, flight_time=0.3, phases=[
            {"phase": "thrust"},
            {"phase": "thrust", "time": "50 ms", "contacts": "toe", "knots": 5},
            {"phase": "flight"},
            {"phase": "landing", "time": 0.4},
        ],
    ).spans()  # fmt: skip
    assert [span.time for span in spans] == [None, 0.05, 0.3, 0.4]
    assert [span.knots for span in spans] == [16, 5, 28, 14]
    assert spans[1].on_ground(names) == (0, 2)
    assert spans[2].on_ground(names) == ()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"jumps": [{"rise": 0.1}, {}]}, "jump 2: say how high the jump is"),
        ({"rise": 0.1, "jumps": []}, "jumps: Tuple should have at least 1 item"),
        ({"rise": 0.1, "repeat": 0}, "repeat: Input should be greater than or equal to 1"),
        (
            {"rise": 0.05, "jumps": [{"landing_height": 0.3}]},
            "jump 1: a rise of 0.05 m cannot reach ground that is 0.3 m higher",
        ),
        (
            {"rise": 0.1, "phases": [{"phase": "thrust"}, {"phase": "landing"}]},
            "the phases must be squat or thrust, then flights",
        ),
        (
            {"rise": 0.1, "repeat": 2, "phases": [
                {"phase": "thrust"}, {"phase": "flight"}, {"phase": "landing"}]},
            "there are 1 flights among the phases but 2 jumps",
        ),
        (
            {"rise": 0.1, "phases": [
                {"phase": "thrust"}, {"phase": "flight"},
                {"phase": "landing", "contacts": "toe"}]},
            "stands on all contact points in the first and in the last",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(values: dict[str, Any], words: str) -> None:
    with pytest.raises(TaskError) as caught:
        task(**values)
    assert words in str(caught.value)
