"""The times of plans in the loop: every kind gets hops within reach, and its rows say how they were planned."""

import pytest

from aloft.extensions.hopping.planner.hop_plans import level_reach, step_reach
from aloft.lab.benchmarks.planner.online_plans import GOALS, online_plans, requests
from aloft.robots.description import find_robot


@pytest.mark.parametrize("kind", GOALS)
def test_requests_are_of_their_kind(kind: str) -> None:
    found = requests(kind, 50)
    assert found == requests(kind, 50)
    assert all(one.level is (kind != "up and down") for one in found)
    assert all((one.aside == 0.0) is (kind == "straight") for one in found)
    if kind != "all coordinates":  # an ellipse bounds these, so some are shortened
        bruce = find_robot("bruce")
        reach = step_reach(bruce) if kind == "up and down" else level_reach(bruce)
        assert all(reach.nearest(one) == one for one in found)


@pytest.mark.long
def test_every_kind_has_its_times() -> None:
    rows = online_plans(2)
    assert [row.name for row in rows[::2]] == [
        f"plan in the loop, {kind}, median" for kind in GOALS
    ]
    assert all(0.0 < row.value < 2.0 for row in rows)
    assert all("table" in row.note and "planned" in row.note for row in rows[::2])
