"""Parts that keep their own time: they start together, wait for nobody, and survive one another."""

import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace

import pytest

from aloft.runtime.language.errors import AloftError, ExitCode
from aloft.runtime.language.stages import CheckedGraph, ClockSpec, LinkPolicy, LinkSettings
from aloft.runtime.links.free_link import LatestReceiver
from aloft.runtime.links.part import BoundPart, part_clock, run_part
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.placement.placed import split_over_machines
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.testing.spread import run_spread
from aloft.runtime.transports.hub import Hub

from ...waiting import wait_for
from .example_graphs import Counter, ring

HOLD = LinkPolicy(0.2, "hold")


def free(
    policy: LinkPolicy = HOLD, of: Mapping[str, LinkPolicy] | None = None, ticks: int = 60
) -> CheckedGraph:
    """The ring at 100 Hz, each part with its own clock."""
    links = LinkSettings("free", policy, of or {})
    graph = ring({"factor": 1.0}, ticks=ticks)
    return replace(graph, base_rate=100.0, clock=ClockSpec("paced"), links=links)


def inbox_of(part: BoundPart) -> LatestReceiver:
    (receiver,) = part.receivers
    assert isinstance(receiver, LatestReceiver)
    return receiver


def test_values_go_round_and_nothing_is_lost() -> None:
    run = run_spread(free(ticks=150))  # long enough for a machine that is busy otherwise
    for machine, result in run.results.items():
        assert result.success, result.reason
        receiver = inbox_of(run.parts[machine])
        assert receiver.received > 30
        assert (receiver.lost, receiver.surplus, receiver.damaged) == (0, 0, 0)
    log = run.results["onboard"].log
    assert log is not None and log.layout is not None
    rows = log.rows()
    received = log.layout.view(rows, "last~from~far.health.received")
    age = log.layout.view(rows, "last~from~far.health.age")
    assert received[-1] > 30 and (age >= 0.0).all()
    # what the robot reads came round: it counts faster than by one a tick
    assert log.layout.view(rows, "robot.y.value")[-1] > len(rows)


def test_every_part_is_paced() -> None:
    placed = split_over_machines(free())
    hub = Hub()
    for machine in placed.machines:
        part = BoundPart(placed, machine.name, hub.transport())
        assert part_clock(part).kind == "paced"


class Quiet:
    """Loses all messages of one link from the n-th on."""

    def __init__(self, key: str, after: int) -> None:
        self.key, self.left = key, after

    def __call__(self, key: str, data: bytes) -> Iterable[bytes]:
        self.left -= key == self.key
        return () if key == self.key and self.left < 0 else (data,)


def test_a_link_that_goes_quiet_stops_all_in_order() -> None:
    Counter.LOG.clear()
    graph = free(of={"last": LinkPolicy(0.1, "stop")}, ticks=1000)
    run = run_spread(graph, interfere=Quiet("data/far/onboard/last", 60))
    assert run.results["onboard"].ticks < 1000
    reason = run.results["onboard"].reason
    assert reason.startswith("link last@far -> onboard: nothing has come for ")
    assert reason.endswith("at most 100 ms are allowed")
    assert run.results["near"].reason == "machine 'onboard' has ended its run"
    assert ["robot starts", *["robot rests"] * 5, "robot closes"] == Counter.LOG


def test_a_link_that_goes_quiet_reads_zeros_where_that_is_safe() -> None:
    graph = free(of={"last": LinkPolicy(0.05, "safe")}, ticks=200)
    run = run_spread(graph, interfere=Quiet("data/far/onboard/last", 20))
    log = run.results["onboard"].log
    assert run.results["onboard"].success and log is not None and log.layout is not None
    values = log.layout.view(log.rows(), "last.y.value")
    assert values[-1] == 0.0 and values.max() > 0.0
    assert log.layout.view(log.rows(), "last~from~far.health.late")[-1]


def test_a_fault_ends_all_parts() -> None:
    graph = free(ticks=1000)
    blocks = tuple(
        replace(spec, params=spec.params.model_copy(update={"fail_at": 30}))
        if spec.path == "first"
        else spec
        for spec in graph.blocks
    )
    run = run_spread(replace(graph, blocks=blocks))
    for name, result in run.results.items():
        assert result.exit_code is ExitCode.RUN_FAILED, name
        assert "block 'first' failed at tick 30" in result.reason
    assert run.results["far"].reason.startswith("machine 'near' failed: ")


def in_a_thread(
    part: BoundPart, results: dict[str, RunResult], name: str, ticks: int | None = None
) -> threading.Thread:
    def run() -> None:
        results[name] = run_part(part, ticks)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def test_a_part_that_is_started_again_joins_without_the_others_starting_again() -> None:
    Counter.LOG.clear()
    placed = split_over_machines(free(LinkPolicy(None, "hold"), ticks=20_000))
    hub = Hub()
    parts = {m.name: BoundPart(placed, m.name, hub.transport()) for m in placed.machines}
    results: dict[str, RunResult] = {}
    threads = {name: in_a_thread(part, results, name) for name, part in parts.items()}
    far = inbox_of(parts["far"])
    assert wait_for(lambda: far.received > 20)
    parts["near"].peers._transport.close()  # as if the process were gone: it sends no more
    assert wait_for(lambda: "near" in parts["far"].peers._gone)
    time.sleep(0.2)
    before = far.received
    assert all(thread.is_alive() for thread in threads.values())
    parts["near"].clock.stop_reason = "its process is gone"
    again = BoundPart(placed, "near", hub.transport())
    threads["again"] = in_a_thread(again, results, "again")
    assert wait_for(lambda: far.received > before + 20)
    assert wait_for(lambda: inbox_of(again).received > 20)
    assert Counter.LOG == ["robot starts"]  # nothing was enabled again
    again.clock.stop_reason = "enough"
    for thread in threads.values():
        thread.join(60.0)
        assert not thread.is_alive()
    assert results["onboard"].reason == "machine 'near' has ended its run"
    assert far.lost == 0


def results_of(ticks: Mapping[str, int], *, stop: str = "") -> dict[str, RunResult]:
    """Results of a chain in which the robot goes to ``near`` and that to ``far``, from which nobody
    reads, with so many ticks for each part; ``stop`` is a part that is asked to end at once."""
    graph = free()
    blocks = [replace(s, wires={}) if s.path == "robot" else s for s in graph.blocks]
    placed = split_over_machines(replace(graph, blocks=tuple(blocks)))
    hub = Hub()
    parts = {m.name: BoundPart(placed, m.name, hub.transport()) for m in placed.machines}
    results: dict[str, RunResult] = {}
    threads = [in_a_thread(part, results, name, ticks[name]) for name, part in parts.items()]
    if stop:
        assert wait_for(lambda: parts[stop].clock.tick > 5)
        parts[stop].clock.stop_reason = "enough"
    for thread in threads:
        thread.join(60.0)
        assert not thread.is_alive()
    return results


def test_a_part_from_which_nobody_reads_ends_alone() -> None:
    results = results_of({"onboard": 80, "near": 20_000, "far": 20})
    assert (results["far"].ticks, results["onboard"].ticks) == (20, 80)
    assert all(result.success for result in results.values())
    assert results["near"].reason == "machine 'onboard' has ended its run"


def test_a_part_from_which_another_reads_ends_all() -> None:
    results = results_of({"onboard": 20_000, "near": 20, "far": 20_000})
    assert results["near"].ticks == 20
    for name in ("onboard", "far"):
        assert results[name].success and results[name].ticks < 20_000
        assert results[name].reason.endswith("has ended its run")


def test_a_part_from_which_nobody_reads_ends_all_where_it_is_asked_to_end() -> None:
    results = results_of({"onboard": 20_000, "near": 20_000, "far": 20_000}, stop="far")
    assert results["far"].reason == "enough"
    for name in ("onboard", "near"):
        assert results[name].success and results[name].ticks < 20_000
        assert results[name].reason.endswith("has ended its run")


@pytest.mark.long
def test_a_part_with_actuators_does_not_join_by_itself() -> None:
    Counter.LOG.clear()
    placed = split_over_machines(free(LinkPolicy(None, "hold"), ticks=20_000))
    hub = Hub()
    parts = {m.name: BoundPart(placed, m.name, hub.transport()) for m in placed.machines}
    results: dict[str, RunResult] = {}
    threads = [in_a_thread(part, results, name) for name, part in parts.items()]
    assert wait_for(lambda: inbox_of(parts["far"]).received > 10)
    parts["onboard"].peers._transport.close()
    parts["onboard"].clock.stop_reason = "its process is gone"
    threads[0].join(60.0)
    Counter.LOG.clear()
    again = in_a_thread(BoundPart(placed, "onboard", hub.transport()), results, "again")
    again.join(60.0)
    assert "this part moves actuators, which it never enables by itself" in results["again"].reason
    assert results["again"].exit_code is ExitCode.RUN_FAILED
    assert "robot starts" not in Counter.LOG
    for thread in threads:
        thread.join(60.0)
        assert not thread.is_alive()


def test_parameters_change_where_their_block_runs() -> None:
    answers: list[str] = []

    def submit(part: BoundPart) -> None:
        try:
            part.parameters.submit(adjust(part.blocks, {"first.factor": 2.0}), 60.0)
            answers.append("")
        except AloftError as error:
            answers.append(str(error))

    def prepare(parts: Mapping[str, BoundPart], hub: Hub) -> None:
        def both() -> None:
            for name in ("onboard", "near"):
                wait_for(lambda: parts["far"].clock.tick > 5)
                submit(parts[name])
            parts["far"].clock.stop_reason = "enough"

        threading.Thread(target=both, daemon=True).start()

    run = run_spread(free(ticks=20_000), prepare=prepare)
    assert answers == [
        (
            "block 'first' runs on near, and parts that run free change only their own parameters; "
            "change it there"
        ),
        "",
    ]
    assert [c.new for c in run.parts["near"].parameters.changes] == [2.0]


def test_the_clocks_of_the_others_are_estimated() -> None:
    run = run_spread(free(ticks=30))
    for part in run.parts.values():
        for name in part.peers.names:
            clock = part.peers.clock_of(name)
            # all parts have one clock here
            assert clock.uncertainty >= 0 and abs(clock.offset) <= clock.uncertainty


@pytest.mark.long
@pytest.mark.parametrize("policy", ["hold", "safe"])
def test_a_part_that_is_gone_does_not_end_the_others(policy: str) -> None:
    graph = free(LinkPolicy(0.05, policy), ticks=250)  # type: ignore[arg-type]

    def prepare(parts: Mapping[str, BoundPart], hub: Hub) -> None:
        def kill() -> None:
            wait_for(lambda: parts["near"].clock.tick > 20)
            parts["near"].peers._transport.close()

        threading.Thread(target=kill, daemon=True).start()

    run = run_spread(graph, prepare=prepare)
    for name in ("onboard", "far"):
        # the part that ends first ends the other
        assert run.results[name].success and run.results[name].ticks > 40
    assert inbox_of(run.parts["far"]).late_ticks > 10
