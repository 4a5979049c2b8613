"""Directions are rays of valid tasks, and their loosest form leaves nothing to the feedback.

Searches on a ladder find its end, with few tries and none of them twice.
"""

import math
from collections.abc import Callable, Generator

import pytest

from aloft.extensions.commissioning.reach.directions import DIRECTIONS, GOALS, Direction
from aloft.extensions.commissioning.reach.search import furthest, outward
from aloft.planner.task.read_task import require_consistent
from aloft.robots.description import find_robot

BY_NAME = {direction.name: direction for direction in DIRECTIONS}


def test_every_direction_and_the_pairs_are_there() -> None:
    assert set(GOALS) < set(BY_NAME)
    assert set(BY_NAME) - set(GOALS) == {
        "ahead and up", "ahead and turn", "aside and turn", "step up and ahead",
    }  # fmt: skip


@pytest.mark.parametrize("way", DIRECTIONS, ids=lambda way: way.name)
def test_every_rung_is_a_task_of_a_few_lines(way: Direction) -> None:
    robot = find_robot("bruce")
    assert 1 <= way.start <= way.most
    hashes = set[str]()
    for rung in range(1, way.most + 1):
        task = way.task(rung)
        if rung > 1:  # a step that is nearer than the feet are long contradicts itself
            require_consistent(task, robot)
        assert len(task.model_fields_set - {"name"}) <= 3
        hashes |= {task.hash(robot), way.loosest(rung).hash(robot)}
    assert len(hashes) == 2 * way.most


def test_rungs_are_read_in_the_directions_unit() -> None:
    assert BY_NAME["up"].value(22) == 22.0
    turn = BY_NAME["turn"]
    assert (turn.value(9), turn.task(9).twist) == (90.0, pytest.approx(math.pi / 2))
    assert BY_NAME["back"].task(10).distance_x == -0.25
    pair = BY_NAME["ahead and up"].task(10)
    assert (pair.distance_x, pair.rise) == (GOALS["ahead"], GOALS["up"])


def test_the_loosest_task_has_all_of_the_motors_and_no_margins() -> None:
    robot = find_robot("bruce")
    task, loosest = BY_NAME["step down"].task(3), BY_NAME["step down"].loosest(3)
    usual, found = task.resolved(robot), loosest.resolved(robot)
    assert usual.effort < 1.0 and usual.margins is not None
    assert (found.effort, found.margins, found.foot_clearance) == (1.0, None, 0.02)
    assert found.impact and found.phases == usual.phases


def walked(
    search: Generator[int, bool, int], works: Callable[[int], bool]
) -> tuple[int, list[int]]:
    tried: list[int] = []
    try:
        rung = next(search)
        while True:
            tried.append(rung)
            rung = search.send(works(rung))
    except StopIteration as end:
        return end.value, tried


@pytest.mark.parametrize("start", range(1, 31))
def test_the_last_rung_is_found(start: int) -> None:
    for end in range(31):
        found, tried = walked(furthest(start, 30), end.__ge__)
        assert found == end
        assert len(set(tried)) == len(tried) <= 10
        assert all(1 <= rung <= 30 for rung in tried)


@pytest.mark.parametrize("end", range(7, 21))
def test_what_is_known_to_work_is_not_tried(end: int) -> None:
    found, tried = walked(furthest(8, 20, good=7), lambda rung: rung <= end)
    assert found == end
    assert all(rung > 7 for rung in tried)


def test_nothing_to_try() -> None:
    assert walked(furthest(8, 7, good=7), lambda _: True) == (7, [])


def test_the_walk_ends_after_two_failures_in_a_row() -> None:
    works = {5, 6, 8}
    assert walked(outward(5, 20), works.__contains__) == (8, [5, 6, 7, 8, 9, 10])


def test_the_walk_goes_inwards_where_it_cannot_go_outwards() -> None:
    assert walked(outward(5, 20), lambda rung: rung <= 3) == (3, [5, 6, 4, 3])
    assert walked(outward(2, 20), lambda rung: False) == (0, [2, 3, 1])
    assert walked(outward(5, 6), lambda rung: True) == (6, [5, 6])
