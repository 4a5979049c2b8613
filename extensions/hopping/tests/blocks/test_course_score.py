"""A course is judged landing by landing: a good one passes, and what is wrong is said."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.blocks.scoring.footing import Footing
from aloft.extensions.hopping.blocks.course_score import CourseScore
from aloft.robots.description import find_robot
from aloft.robots.kinematics import standing_feet
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
PERIOD = 0.01


def truth_at(x: float, y: float, heading: float, *, flies: bool) -> dict[str, object]:
    """The truth of a robot that stands or flies there."""
    cosine, sine = math.cos(heading), math.sin(heading)
    points = []
    for contact in ROBOT.contacts:
        side = 0.076 if contact.foot == ROBOT.feet[1].name else -0.076
        ahead = float(contact.position[0]) - 0.0075
        points.append([x + cosine * ahead - sine * side, y + sine * ahead + cosine * side, 0.0])
    n, weight = len(points), Footing(ROBOT).weight
    middle = np.mean(points, axis=0)
    return {
        "base_position": [x, y, 0.4],
        "base_orientation": [0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading)],
        "com": [middle[0], middle[1], 0.32],
        "contact_position": points,
        "contact_force": np.tile([0.0, 0.0, 0.0 if flies else weight / n], (n, 1)),
        "contact_touched": np.full(n, not flies),
    }


def run(
    *landed: tuple[float, float, float], goals: list[tuple[float, float, float]], **params: float
):
    """Jump from the origin to each place in turn, where each goal is told when its jump begins."""
    bench = BlockBench(CourseScore, {"jumps": len(goals), **params}, robot=ROBOT, rate=1 / PERIOD)
    x, y, heading = 1.0, 2.0, 0.0
    for _ in range(20):
        bench.set("truth", **truth_at(x, y, heading, flies=False))
        bench.step()
    for number, (place, goal) in enumerate(zip(landed, goals, strict=True), start=1):
        bench.set("goal", number=number, position=goal[:2], heading=goal[2])
        for tick in range(280):
            flies = 50 <= tick < 75
            if tick == 60:
                x, y, heading = 1.0 + place[0], 2.0 + place[1], place[2]
            bench.set("truth", **truth_at(x, y, heading, flies=flies))
            bench.step()
            if bench.stop_reason is not None:
                break
    return bench


def test_a_course_that_lands_where_it_should_passes() -> None:
    places = [(0.2, 0.0, 0.5), (0.2, 0.1, 0.0)]
    bench = run(*places, goals=places)
    metrics = bench.block.metrics()
    assert metrics["success"] is True, metrics["reason"]
    assert metrics["jumps"] == 2
    assert metrics["worst_place_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert bench.stop_reason == "2 jumps are over"


def test_places_are_from_where_it_stood_and_errors_are_told() -> None:
    goals = [(0.2, 0.0, 0.0), (0.3, 0.0, 0.0)]
    metrics = run((0.2, 0.04, 0.0), (0.31, 0.0, 0.0), goals=goals).block.metrics()
    assert metrics["reason"] == "landed 40.0 mm from its place, limit 30 mm"
    assert metrics["mean_place_error_m"] == pytest.approx(0.025)
    assert metrics["last_place_error_m"] == pytest.approx(0.01)


def test_a_wrong_heading_and_a_missing_jump_are_no_success() -> None:
    metrics = run((0.2, 0.0, 0.3), goals=[(0.2, 0.0, 0.0)]).block.metrics()
    assert metrics["reason"] == "landed 17.2 deg off its heading, limit 10 deg"
    metrics = run((0.2, 0.0, 0.0), goals=[(0.2, 0.0, 0.0)], rest_time=9.0).block.metrics()
    assert metrics["reason"] == "the run ended before 9.0 s after touchdown"
    bench = BlockBench(CourseScore, {"jumps": 2}, robot=ROBOT, rate=1 / PERIOD)
    bench.set("truth", **truth_at(0.0, 0.0, 0.0, flies=False))
    bench.step()
    assert bench.block.metrics()["reason"] == "made 0 of 2 jumps"


def test_a_fall_ends_the_run() -> None:
    bench = BlockBench(CourseScore, {"jumps": 2}, robot=ROBOT, rate=1 / PERIOD)
    bench.set(
        "truth", **(truth_at(0.0, 0.0, 0.0, flies=False) | {"base_position": [0.0, 0.0, 0.05]})
    )
    bench.step()
    assert bench.stop_reason == "the robot fell"
    assert str(bench.block.metrics()["reason"]).startswith("fell at 0.000 s")


@pytest.mark.parametrize("heading", [0.0, 0.6, -2.5])
def test_feet_that_are_points_have_a_heading_together(heading: float) -> None:
    robot = find_robot("go2")
    bench = BlockBench(CourseScore, {"jumps": 1}, robot=robot, rate=1 / PERIOD)
    cosine, sine = math.cos(heading), math.sin(heading)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    points = standing_feet(robot) @ turn.T
    bench.set(
        "truth", base_position=[0.0, 0.0, 0.3],
        base_orientation=[0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading)],
        contact_position=points, contact_touched=np.ones(4, dtype=np.bool_),
    )  # fmt: skip
    bench.step()
    assert float(bench.block.record.start_heading) == pytest.approx(heading)
    assert np.asarray(bench.block.record.start) == pytest.approx(points.mean(axis=0)[:2])
