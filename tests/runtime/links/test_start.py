"""Nothing moves before all parts run the same graph and every link has worked both ways."""

import threading
from collections.abc import Iterable, Mapping
from typing import Any

import pytest

from aloft import BlockError
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.links.part import BoundPart, part_graph, run_part
from aloft.runtime.placement.placed import split_over_machines
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.testing.spread import run_spread
from aloft.runtime.transports.hub import Hub

from .example_graphs import Counter, ring


def run_parts(graphs: Mapping[str, CheckedGraph], timeout: float = 60.0) -> dict[str, RunResult]:
    """Run each machine with a graph of its own."""
    hub = Hub()
    results: dict[str, RunResult] = {}

    def run(machine: str) -> None:
        part = BoundPart(
            split_over_machines(graphs[machine]), machine, hub.transport(), connect_timeout=timeout
        )
        results[machine] = run_part(part)

    threads = [threading.Thread(target=run, args=(machine,), daemon=True) for machine in graphs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(90.0)
    return results


def test_parts_of_different_graphs_refuse_to_start() -> None:
    other = ring({"factor": 1.0})
    blocks = tuple(
        type(spec)(**{**vars(spec), "period_ticks": 2}) if spec.path == "last" else spec
        for spec in other.blocks
    )
    other = type(other)(**{**vars(other), "blocks": blocks})
    Counter.LOG.clear()
    results = run_parts({"onboard": ring(), "near": ring(), "far": other})
    assert len(results) == 3
    for result in results.values():
        assert result.exit_code is ExitCode.RUN_FAILED and result.ticks == 0
        assert "do not fit together: the schema is" in result.reason
        assert "the first difference is 'last: every" in result.reason
        assert "'last: every 1 ticks from 0'" in result.reason
        assert "'last: every 2 ticks from 0'" in result.reason
    assert Counter.LOG == []


@pytest.mark.long
def test_a_part_that_does_not_come_is_named_with_its_endpoint() -> None:
    Counter.LOG.clear()
    results = run_parts({"onboard": ring(), "near": ring()}, timeout=2.0)
    for result in results.values():
        assert "nothing was heard of far (tcp/127.0.0.1:7452) for 2 s" in result.reason
        assert "aloft run GRAPH --machine NAME" in result.reason
    assert Counter.LOG == []


@pytest.mark.parametrize("key", ["data/onboard/near/robot", "data/far/onboard/last"])
def test_a_link_that_carries_nothing_keeps_all_motors_off(key: str) -> None:
    def interfere(sent: str, data: bytes) -> Iterable[bytes]:
        return () if sent == key else (data,)

    Counter.LOG.clear()
    results = run_spread(ring(), interfere=interfere, timeout=2.0).results
    assert all(result.exit_code is ExitCode.RUN_FAILED for result in results.values())
    assert all(result.ticks == 0 for result in results.values())
    assert "did not become linked in 2 s" in " ".join(r.reason for r in results.values())
    assert Counter.LOG == []


def test_a_block_that_cannot_start_keeps_all_motors_off() -> None:
    def prepare(parts: Mapping[str, BoundPart], hub: Hub) -> None:
        def start() -> None:
            raise BlockError("no device")

        parts["far"].blocks["last"].start = start  # type: ignore[method-assign]

    Counter.LOG.clear()
    results = run_spread(ring(), prepare=prepare).results
    assert results["far"].reason == "block 'last' failed in start: no device"
    assert "machine 'far' does not start: block 'last' failed in start" in results["onboard"].reason
    assert Counter.LOG == []


def test_motors_are_enabled_last_and_damped_first() -> None:
    seen: list[str] = []

    def prepare(parts: Mapping[str, BoundPart], hub: Hub) -> None:
        Counter.LOG = seen
        for name in ("near", "far"):
            block = parts[name].blocks["first" if name == "near" else "last"]
            block.start = lambda name=name: seen.append(f"{name} starts")  # type: ignore[method-assign]
            block.close = lambda name=name: seen.append(f"{name} closes")  # type: ignore[method-assign]

    assert all(r.success for r in run_spread(ring(), prepare=prepare).results.values())
    assert sorted(seen[:2]) == ["far starts", "near starts"]
    assert seen[2:8] == ["robot starts", *["robot rests"] * 5]
    assert sorted(seen[8:]) == ["far closes", "near closes", "robot closes"]


def test_the_graph_of_a_part() -> None:
    graph = part_graph(split_over_machines(ring()), "near")
    # what is received is waited for right before it is read, and sent on at once
    assert graph.order == ("robot", "first", "first~to~far", "~coordinator")
    assert part_graph(split_over_machines(ring()), "onboard").order == (
        "robot", "robot~to~near", "last", "~coordinator",
    )  # fmt: skip
    kinds: dict[str, Any] = {spec.path: spec.block_type.__name__ for spec in graph.blocks}
    assert kinds["robot"] == "LinkInputCounter" and kinds["first"] == "Failing"
