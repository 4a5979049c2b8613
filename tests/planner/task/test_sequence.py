"""Several jumps and sequences of contacts: how they are written, and what is refused.

Uneven ground under a row of jumps, drawn by a seed.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from aloft.planner.task.ground import scene_of
from aloft.planner.task.sequence import (
    LEVEL,
    Hop,
    StanceLocation,
    changes_ground,
    edge_of,
    step_of,
)
from aloft.planner.task.task import JumpTask, JumpTaskError, make_task
from aloft.robots.description import find_robot


def task(**values: Any) -> JumpTask:
    return make_task({"recipe": "paper", "name": "a", **values})


def test_a_jump_alone_is_one_of_a_row() -> None:
    one = task(rise=0.1, distance_x=0.05)
    assert one.hops() == (one.hops()[0],)
    assert (one.hops()[0].rise, one.hops()[0].distance_x) == (0.1, 0.05)
    assert [phase_spec.phase for phase_spec in one.phase_specs()] == [
        "squat",
        "thrust",
        "flight",
        "landing",
    ]


def test_jumps_take_from_the_task_what_they_do_not_say() -> None:
    both = task(rise="10 cm", distance_x=0.1, jumps=[{}, {"take_off_speed": 1.2}], repeat=2)
    assert [hop.rise for hop in both.hops()] == [0.1, None, 0.1, None]
    assert [hop.take_off_speed for hop in both.hops()] == [None, 1.2, None, 1.2]
    assert [place.x for place in both.places()] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_between_two_jumps_the_robot_lands_and_pushes_off() -> None:
    phase_specs = task(rise=0.1, repeat=2, contact_time="0.3 s").phase_specs()
    assert [phase_spec.phase for phase_spec in phase_specs] == [
        "squat", "thrust", "flight", "landing", "thrust", "flight", "landing",
    ]  # fmt: skip
    assert [phase_spec.time for phase_spec in phase_specs] == [
        0.4,
        0.25,
        None,
        0.15,
        0.15,
        None,
        0.5,
    ]


def test_places_add_up_and_edges_lie_between_them() -> None:
    steps = task(
        rise=0.15, distance_x=0.1, twist=0.2,
        jumps=[{"landing_height": "5 cm"}, {"landing_height": "-5 cm", "rotation": 6.28}],
    )  # fmt: skip
    assert steps.places()[1] == StanceLocation(0.1, 0.0, 0.05, 0.2, 0.0)
    assert steps.places()[2] == StanceLocation(0.2, 0.0, 0.0, 0.4, 6.28)
    edges = [edge_of(hop, at) for hop, at in zip(steps.hops(), steps.places(), strict=False)]
    assert edges == pytest.approx([0.05, 0.15])
    assert edge_of(Hop(landing_height=0.1, step_edge=0.02), StanceLocation(1.0, 0, 0, 0, 0)) == 1.02
    assert edge_of(Hop(landing_height=0.1), StanceLocation(1.0, 0, 0, 0, 0)) is None


@pytest.mark.parametrize("name", ["squat_time", "thrust_time", "landing_time", "flight_time"])
def test_times_may_be_free(name: str) -> None:
    free = task(rise=0.1, **{name: "free"})
    assert getattr(free, name) is None
    again = make_task(free.model_dump(mode="json"))
    assert again.hash(find_robot("bruce")) == free.hash(find_robot("bruce"))


def test_a_sequence_of_contacts() -> None:
    robot = find_robot("bruce")
    phase_specs = task(
        rise=0.1, flight_time=0.3, phases=[
            {"phase": "thrust"},
            {"phase": "thrust", "time": "50 ms", "contacts": "toe", "knots": 5},
            {"phase": "flight"},
            {"phase": "landing", "time": 0.4},
        ],
    ).phase_specs()  # fmt: skip
    assert [phase_spec.time for phase_spec in phase_specs] == [None, 0.05, 0.3, 0.4]
    assert [phase_spec.knots for phase_spec in phase_specs] == [16, 5, 28, 14]
    assert phase_specs[1].on_ground(robot) == (0, 2)
    assert phase_specs[2].on_ground(robot) == ()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"jumps": [{"rise": 0.1}, {}]}, "jump 2: say how high the jump is"),
        ({"rise": 0.1, "jumps": []}, "jumps: expected at least 1 value"),
        ({"rise": 0.1, "repeat": 0}, "repeat: expected at least 1"),
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
    with pytest.raises(JumpTaskError) as caught:
        task(**values)
    assert words in str(caught.value)


BRUCE = find_robot("bruce")


def row(**values: Any) -> JumpTask:
    rough = {"seed": 1, "steps": "3 cm", "gaps": "6 cm"}
    return make_task(
        {"name": "a", "rise": 0.06, "distance_x": 0.15, "repeat": 10, "rough": rough, **values}
    )


def test_landings_and_gaps_are_within_what_is_asked_for() -> None:
    task = row()
    assert all(abs(place.z) <= 0.03 for place in task.places())
    assert len({place.z for place in task.places()}) > 8
    gaps = [hop.gap or 0.0 for hop in task.hops()]
    assert max(gaps) <= 0.06 and max(gaps) > 0.03
    for hop, gap in zip(task.hops(), gaps, strict=True):
        assert hop.distance_x == pytest.approx(0.15 + gap)
        assert hop.rise == pytest.approx(0.06 + max(0.0, hop.landing_height or 0.0))


def test_a_seed_is_the_same_ground_always_and_another_seed_another() -> None:
    first = [place.z for place in row().places()][:4]
    assert first == pytest.approx([0.0, -0.022, 0.016, -0.0])
    other = row(rough={"seed": 2, "steps": "3 cm", "gaps": "6 cm"})
    assert other.hash(BRUCE) != row().hash(BRUCE) == row().hash(BRUCE)


def test_backwards_gaps_lengthen_too() -> None:
    task = row(distance_x=-0.15, rough={"seed": 1, "gaps": "6 cm"})
    assert all(hop.distance_x == pytest.approx(-0.15 - (hop.gap or 0.0)) for hop in task.hops())


def test_the_simulator_gets_boxes_with_gaps_between_them() -> None:
    task = row()
    scene = scene_of(task, BRUCE)
    assert scene["floor"] == pytest.approx(min(place.z for place in task.places()) - 0.1)
    boxes = sorted(scene["boxes"], key=lambda box: box["x"])
    assert len(boxes) == 11
    for place, box in zip(task.places(), boxes, strict=True):
        assert box["top"] == pytest.approx(place.z)
        assert box["x"][0] < place.x - 0.035 and place.x + 0.05 < box["x"][1]
    between = [after["x"][0] - before["x"][1] for before, after in pairwise(boxes)]
    assert between == pytest.approx([hop.gap for hop in task.hops()], abs=1e-5)


def test_one_gap_alone() -> None:
    task = make_task({"name": "a", "rise": 0.08, "distance_x": 0.3, "gap": "15 cm"})
    scene = scene_of(task, BRUCE)
    assert [box["x"] for box in scene["boxes"]] == [[-1.5, 0.075], [0.225, 1.8]]


def test_ground_goes_on_as_it_leans_unless_a_jump_says_otherwise() -> None:
    up = task(rise=0.15, distance_x=0.2, slope=["10 deg", 0], repeat=2)
    rise = 0.2 * math.tan(math.radians(10.0))
    assert [place.z for place in up.places()] == pytest.approx([0.0, rise, 2.0 * rise])
    assert {place.slope for place in up.places()} == {(math.radians(10.0), 0.0)}
    assert not any(changes_ground(*both) for both in zip(up.hops(), up.places(), strict=False))
    top = task(
        rise=0.15, distance_x=0.2, slope=["10 deg", 0],
        jumps=[{}, {"landing_slope": [0, 0], "landing_height": "-1 cm"}],
    )  # fmt: skip
    assert [place.slope for place in top.places()][1:] == [(math.radians(10.0), 0.0), LEVEL]
    hops, places = top.hops(), top.places()
    assert [changes_ground(*both) for both in zip(hops, places, strict=False)] == [False, True]
    assert places[2].z == pytest.approx(2.0 * rise - 0.01)
    assert edge_of(hops[1], places[1]) == pytest.approx(0.3)
    # Level ground that ends where the slope would be 1 cm higher begins half a rise and 1 cm lower.
    assert step_of(hops[1], places[1]) == pytest.approx(0.5 * rise - 0.01)


def test_what_leans_is_part_of_the_content_and_what_does_not_is_not() -> None:
    level = task(rise=0.15, distance_x=0.2)
    assert {"slope", "landing_slope", "stairs"}.isdisjoint(level.content())
    leaning = task(rise=0.15, distance_x=0.2, landing_slope=["5 deg", 0])
    assert leaning.hash(BRUCE) != level.hash(BRUCE)
    assert leaning.leans and not level.leans


def test_stairs_set_heights_and_edges() -> None:
    stairs = {"x": "9 cm", "rise": "3 cm", "run": "20 cm", "steps": 3}
    up = task(rise=0.12, distance_x=0.2, stairs=stairs, repeat=4)
    assert [place.z for place in up.places()] == pytest.approx([0.0, 0.03, 0.06, 0.09, 0.09])
    edges = [edge_of(hop, at) for hop, at in zip(up.hops(), up.places(), strict=False)]
    assert edges[:3] == pytest.approx([0.09, 0.29, 0.49])
    assert edges[3] is None
    # Over two edges at once the first one up, or the last one down, counts for both.
    for rise, edge in (("3 cm", 0.09), ("-3 cm", 0.29)):
        far = task(rise=0.16, distance_x=0.4, stairs=stairs | {"rise": rise})
        assert edge_of(far.hops()[0], far.places()[0]) == pytest.approx(edge)
        assert abs(far.places()[1].z) == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"landing_slope": ["50 deg", 0]}, "a slope is at most 45 deg, not 50 deg"),
        ({"slope": ["5 cm", 0]}, r"slope\.0: expected a number in rad, found '5 cm'"),
        ({"landing_slope": ["5 deg"]}, r"landing_slope\.1: is missing"),
        (
            {"slope": ["5 deg", 0], "stairs": {"x": 0.1, "rise": 0.03, "run": 0.2, "steps": 2}},
            "stairs says what the ground is: give stairs, or slope, not both",
        ),
        ({"stairs": {"x": 0.1, "rise": 0.03, "run": 0.2}}, r"stairs\.steps: is missing"),
    ],
)
def test_ground_that_cannot_be_is_refused(values: dict[str, Any], words: str) -> None:
    with pytest.raises(JumpTaskError, match=words):
        task(rise=0.1, distance_x=0.2, **values)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(
        JumpTaskError, match=r"rough says what the ground is: give rough, or landing_height"
    ):
        row(landing_height=0.02)
    with pytest.raises(
        JumpTaskError, match=r"it jumps 0\.1 m ahead, and cannot pass a gap of 0\.2 m"
    ):
        scene_of(make_task({"name": "a", "rise": 0.1, "distance_x": 0.1, "gap": 0.2}), BRUCE)
    with pytest.raises(JumpTaskError, match=r"at place 0 a foot at .* narrow the gap"):
        scene_of(make_task({"name": "a", "rise": 0.1, "distance_x": 0.2, "gap": 0.15}), BRUCE)
    with pytest.raises(JumpTaskError, match=r"rough.step.*nearest is steps"):
        row(rough={"step": 0.02})
