"""The benchmark of link delays lets BRUCE jump with a controller that knows the delay."""

import pytest
from tests.cli.conftest import run_for_json

from aloft.lab.benchmarks.links.link_delays import expected_delay, jump, link_delays, travel
from aloft.runtime.links.free_link import LatestReceiver


def test_what_the_controller_expects() -> None:
    assert expected_delay(0.2e-3) == pytest.approx(4.4e-3) and expected_delay(
        3e-3
    ) == pytest.approx(10e-3)
    assert travel(0.2e-3)("data/a/b/c", 5) == 200_000


def test_jitter_and_loss_are_drawn_for_each_link_from_the_seed() -> None:
    assert expected_delay(1e-3, 0.5e-3) == pytest.approx(6.5e-3)
    first, again, other = (travel(1e-3, 0.5e-3, 0.1, seed) for seed in (3, 3, 4))
    times = [first("a", k) for k in range(2000)]
    alone = [again("a", k) for k in range(1000)]
    mixed = [[again(key, k) for key in ("b", "a")][1] for k in range(1000)]
    assert times == alone + mixed, "what another link carries changes nothing"
    assert times[:1000] != [other("a", k) for k in range(1000)]
    assert times[:1000] != [first("b", k) for k in range(1000)]
    come = [time for time in times if time is not None]
    assert 1_000_000 <= min(come) < 1_010_000 and 1_490_000 < max(come) <= 1_500_000
    assert len(times) - len(come) == pytest.approx(200, abs=60)


@pytest.mark.long
def test_a_jump_with_jitter_and_loss() -> None:
    (row,) = link_delays([1e-3], [9100], 0.5e-3, 0.02)
    assert row.name == "jumps that fail, links of 1 to 1.5 ms each way, 2 % lost"
    assert row.note.startswith("1 of 1 succeed, nominally 6.5 ms")
    run = jump(1e-3, 9100, 0.5e-3, 0.02)
    boxes = [box for part in run.parts.values() for box in part.receivers]
    lost = sum(box.lost for box in boxes if isinstance(box, LatestReceiver))
    came = sum(box.received for box in boxes if isinstance(box, LatestReceiver))
    assert 0.01 < lost / (lost + came) < 0.03


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["links", "--jitter", "1 ms"], "--jitter is for link_delays, not for links"),
        (["link_delays", "--jitter", "1 m"], "--jitter cannot be '1 m'; expected '1 ms', up to a"),
        (["link_delays", "--loss", "1.5"], "--loss cannot be '1.5'; expected '5 %', less than all"),
        (["link_delays", "--jitter", "-1 ms"], "--jitter cannot be '-1 ms'"),
    ],
)
def test_options_that_make_no_sense(arguments: list[str], reason: str) -> None:
    assert run_for_json("bench", *arguments, code=2)["reason"].startswith(reason)


@pytest.mark.long
def test_a_jump_with_short_links() -> None:
    (row,) = link_delays([0.2e-3], [1000])
    assert row.value == 0.0 and row.met and row.note == "1 of 1 succeed, nominally 4.4 ms"
    run = jump(0.2e-3, 1000)
    assert run.success and float(run.metrics["apex_above_standing_m"]) > 0.1  # type: ignore[arg-type]
    boxes = [box for part in run.parts.values() for box in part.receivers]
    assert all(isinstance(box, LatestReceiver) and box.lost == 0 for box in boxes)
    ages = [float(box.about()["age_p50_ms"]) for box in boxes]
    assert all(0.2 <= age <= 2.2 for age in ages)
