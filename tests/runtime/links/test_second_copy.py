"""A second copy of a part, started by mistake, is refused, and the run that is in progress goes on."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.links import peers
from aloft.runtime.links.part import BoundPart
from aloft.runtime.placement.placed import split_over_machines
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.transports.zenoh_transport import ZenohTransport

from ...waiting import free_port, wait_for
from .example_graphs import ring
from .test_free_running import free, in_a_thread


def lockstep() -> CheckedGraph:
    """The ring in lockstep, which would go on for a long time."""
    return ring({"factor": 1.0}, ticks=1_000_000)


@pytest.mark.long
@pytest.mark.parametrize("graph", [lambda: free(ticks=100_000), lockstep])
def test_the_run_goes_on_and_the_newcomer_says_why(
    graph: Callable[[], CheckedGraph], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peers, "REFUSED_FOR", 0.5)
    placed = split_over_machines(graph())
    machines = [replace(m, endpoint=f"tcp/127.0.0.1:{free_port()}") for m in placed.machines]
    # at an endpoint of its own: at the same one it could not even listen
    elsewhere = [replace(m, endpoint=f"tcp/127.0.0.1:{free_port()}") if m.name == "far" else m
                 for m in machines]  # fmt: skip
    waits = placed.graph.links.mode == "lockstep"
    parts = {
        m.name: BoundPart(placed, m.name, ZenohTransport("second", machines, wait=waits))
        for m in machines
    }
    results: dict[str, RunResult] = {}
    threads = {name: in_a_thread(part, results, name) for name, part in parts.items()}
    (near,) = parts["near"].receivers
    assert wait_for(lambda: near.received > 20)

    copy = BoundPart(placed, "far", ZenohTransport("second", elsewhere, wait=waits))
    in_a_thread(copy, results, "copy").join(60.0)
    refused = results["copy"]
    assert refused.exit_code is ExitCode.RUN_FAILED and refused.ticks == 0
    assert "'far' is running already" in refused.reason
    assert "that run goes on: stop it first" in refused.reason

    before = near.received
    assert wait_for(lambda: near.received > before + 50)
    assert not parts["near"].peers._gone, "the one that left was the copy"
    assert all(thread.is_alive() for thread in threads.values())
    parts["onboard"].clock.stop_reason = "enough"
    for thread in threads.values():
        thread.join(60.0)
        assert not thread.is_alive()
    assert all(result.success for name, result in results.items() if name != "copy"), results
