"""The benchmark of link delays lets BRUCE jump with a controller that is told of the delay."""

import pytest

from aloft.benchmarks.link_delays import jump, link_delays, told, travel
from aloft.runtime.links.latest import LatestInbox


def test_what_the_controller_is_told() -> None:
    assert told(0.2e-3) == pytest.approx(4.4e-3) and told(3e-3) == pytest.approx(10e-3)
    assert travel(0.2e-3)("data/a/b/c", 5) == 200_000


@pytest.mark.long
def test_a_jump_with_short_links() -> None:
    (row,) = link_delays([0.2e-3], [1000])
    assert row.value == 0.0 and row.met and row.note == "1 of 1 succeed, told 4.4 ms"
    run = jump(0.2e-3, 1000)
    assert run.success and float(run.metrics["apex_above_standing_m"]) > 0.1  # type: ignore[arg-type]
    boxes = [box for part in run.parts.values() for box in part.inboxes]
    assert all(isinstance(box, LatestInbox) and box.lost == 0 for box in boxes)
    ages = [float(box.about()["age_p50_ms"]) for box in boxes]
    assert all(0.2 <= age <= 2.2 for age in ages)
