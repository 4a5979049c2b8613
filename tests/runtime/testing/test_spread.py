"""The helper that runs all parts of a graph in threads."""

from dataclasses import replace

import numpy as np
import pytest

from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.stages import CheckedGraph, LinkPolicy, LinkSettings
from aloft.runtime.links.free_link import LatestReceiver
from aloft.runtime.links.part import BoundPart
from aloft.runtime.testing.spread import VirtualRun, run_spread, run_virtual

from ..links.example_graphs import Counter, ring
from ..links.test_free_running import free


def test_rows_of_parts_that_ended_apart_are_refused() -> None:
    spread_out = run_spread(ring(ticks=10))
    assert spread_out.ticks == 10 and len(spread_out.rows) == 10
    log = spread_out.results["near"].log
    assert log is not None
    log.ticks.append(10)
    with pytest.raises(AloftError, match=r"recorded different numbers of ticks: .*'near': 11"):
        _ = spread_out.rows


def test_parts_that_do_not_end_are_an_error() -> None:
    with pytest.raises(AloftError, match=r"not all parts ended within 0.3 s"):
        # The factor keeps the ring's numbers small: they must not end the run by an overflow.
        run_spread(ring({"factor": 0.5}, ticks=10**7), wall_time=0.3)


MS = 1_000_000


def graph(ticks: int = 50, watchdog: float | None = None, late: str = "hold") -> CheckedGraph:
    made = free(LinkPolicy(0.025, late), ticks=ticks)  # type: ignore[arg-type]
    return replace(made, links=LinkSettings("free", made.links.policy, {}, {}, watchdog))


def receiver(run: VirtualRun, machine: str) -> LatestReceiver:
    (box,) = run.parts[machine].receivers
    assert isinstance(box, LatestReceiver)
    return box


def counted(part: BoundPart) -> float:
    return float(part.memory.bus.field("robot.y.value"))


@pytest.mark.parametrize(
    ("delay", "phase", "age"),
    # far ticks 3 ms after near sends: 3 ms old. A message that takes longer is read a tick later
    [(0, 0.3, 3.0), (2 * MS, 0.3, 3.0), (4 * MS, 0.3, 13.0), (0, 0.0, 0.0)],
)
def test_a_message_is_as_old_as_delay_and_phase_make_it(
    delay: int, phase: float, age: float
) -> None:
    phases = {"onboard": 0.0, "near": 0.0, "far": phase}
    run = run_virtual(graph(), lambda key, now: delay, phases)
    assert run.success and run.reason == "ran to its end"
    ages = receiver(run, "far").about()
    assert ages["age_p50_ms"] == pytest.approx(age) and ages["lost"] == 0


def test_the_same_run_gives_the_same_numbers() -> None:
    rng = np.random.default_rng(1)
    delays = rng.integers(0, 15 * MS, 5000).tolist()
    runs = []
    for _ in range(2):
        left = iter(delays)
        run = run_virtual(graph(), lambda key, now, left=left: next(left), {"near": 0.5})  # type: ignore[misc]
        runs.append((counted(run.parts["onboard"]), receiver(run, "far").about()))
    assert runs[0] == runs[1]
    assert runs[0][1]["surplus"] > 0  # some overtook others


def test_lost_messages_are_counted() -> None:
    sent: list[str] = []

    def travel(key: str, now: int) -> int | None:
        sent.append(key)
        return None if len(sent) % 4 == 0 else 0

    run = run_virtual(graph(), travel, {"near": 0.2, "far": 0.4})
    total = sum(receiver(run, name).lost for name in run.parts)
    assert 0.2 * len(sent) < total + 3 and total <= len(sent) // 4


def test_a_cut_link_stops_the_run_by_its_policy() -> None:
    def travel(key: str, now: int) -> int | None:
        return None if key.endswith("/last") and now > 1_000_000_000 + 200 * MS else 0

    run = run_virtual(graph(late="stop"), travel)
    assert run.reason.startswith("onboard: link last@far -> onboard: nothing has come for 30.0 ms")
    assert run.duration_s == pytest.approx(0.24, abs=0.02)


@pytest.mark.parametrize("watchdog", [0.02, 0.015])
def test_commands_that_fall_silent_damp_in_time(watchdog: float) -> None:
    # virtual time shows the instant exactly: the tick in which the silence exceeds what is allowed
    Counter.LOG.clear()
    cut = 1_000_000_000 + 201 * MS
    run = run_virtual(
        graph(watchdog=watchdog),
        lambda key, now: None if key.endswith("/last") and now > cut else 0,
    )
    assert "link last@far -> onboard brings commands and was silent for" in run.reason
    last = 0.2  # the last message came at this instant
    assert last + watchdog < run.duration_s <= last + watchdog + 0.01 + 1e-9
    assert Counter.LOG.count("robot rests") == 1
