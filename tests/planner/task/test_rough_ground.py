"""Uneven ground under a row of jumps, drawn by a seed."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from aloft.planner.task.ground import scene_of
from aloft.planner.task.task import JumpTask, TaskError, make_task
from aloft.robots.description import find_robot

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


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(TaskError, match=r"rough draws the ground: give rough, or landing_height"):
        row(landing_height=0.02)
    with pytest.raises(TaskError, match=r"it jumps 0\.1 m ahead, and cannot pass a gap of 0\.2 m"):
        scene_of(make_task({"name": "a", "rise": 0.1, "distance_x": 0.1, "gap": 0.2}), BRUCE)
    with pytest.raises(TaskError, match=r"at place 0 a foot at .* narrow the gap"):
        scene_of(make_task({"name": "a", "rise": 0.1, "distance_x": 0.2, "gap": 0.15}), BRUCE)
    with pytest.raises(TaskError, match=r"rough.step.*nearest is steps"):
        row(rough={"step": 0.02})
