"""Searches on a ladder find its end, with few tries and none of them twice."""

from collections.abc import Callable, Generator

import pytest

from aloft.benchmarks.frontier.ladders import furthest, outward


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
@pytest.mark.parametrize("end", range(31))
def test_the_last_rung_is_found(start: int, end: int) -> None:
    found, tried = walked(furthest(start, 30), lambda rung: rung <= end)
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
