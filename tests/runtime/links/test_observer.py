"""What parts say of themselves reaches an observer, who sends nothing and slows nothing."""

import json
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.extensions.deployment.keys import make_keys
from aloft.runtime.language.stages import LinkPolicy, LinkSettings, MachineSpec
from aloft.runtime.links.observer import ROW_HEADER, Observer, StatusPublisher, read_row
from aloft.runtime.links.part import BoundPart, run_part
from aloft.runtime.placement.placed import PlacedGraph, split_over_machines, spread
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.transports.tls import secured
from aloft.runtime.transports.zenoh_transport import ZenohTransport

from ...waiting import free_port
from ..background.graphs import both
from .test_free_running import free, wait_for


class Running:
    """All parts of a graph in threads, over Zenoh, each showing itself."""

    def __init__(self, placed: PlacedGraph, keys: Path | None = None) -> None:
        self.results: dict[str, RunResult] = {}
        self.parts = {
            m.name: BoundPart(
                placed, m.name,
                ZenohTransport(
                    placed.graph.name, placed.machines, wait=False,
                    security=None if keys is None else secured(placed, keys, m.name),
                ),
            )
            for m in placed.machines
        }  # fmt: skip
        self.threads = [threading.Thread(target=self._run, args=(n,)) for n in self.parts]
        for thread in self.threads:
            thread.start()

    def _run(self, name: str) -> None:
        part = self.parts[name]
        showing = StatusPublisher(name, part.transport, part.peers, part.receivers)
        self.results[name] = run_part(part, sinks=[showing])

    def end(self) -> None:
        for part in self.parts.values():
            part.clock.stop_reason = "enough"
        for thread in self.threads:
            thread.join(90.0)
            assert not thread.is_alive()


def placed_at(protocol: str) -> PlacedGraph:
    graph = free(LinkPolicy(5.0, "hold"), ticks=60_000)
    machines = tuple(
        MachineSpec(spec.name, f"{protocol}/127.0.0.1:{free_port()}") for spec in graph.machines
    )
    return split_over_machines(replace(graph, machines=machines))


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as made:
        yield made


@pytest.mark.long
def test_statuses_and_signals_of_all_parts(stack: ExitStack) -> None:
    placed = placed_at("tcp")
    observer = stack.enter_context(Observer(placed))
    assert observer.state_of("far") == "silent" and observer.seconds_since("far") is None
    running = Running(placed)
    stack.callback(running.end)
    names = tuple(running.parts)
    assert observer.wait_for(names, 60.0) == ()
    assert wait_for(lambda: all(observer.statuses[n]["tick"] > 20 for n in names))
    assert wait_for(lambda: {observer.state_of(name) for name in names} == {"started"})
    status = observer.statuses["far"]
    assert status["base_rate_hz"] == 100.0 and 0.0 < status["rate_hz"] < 200.0
    (link,) = status["links"]
    assert link["name"] == "first@near -> far" and link["received"] > 5
    # a machine that stands still for a while may lose some
    assert link["damaged"] == 0 <= link["lost"] < link["received"] and link["age_ms"] >= 0.0
    assert set(status["clocks"]) == {"onboard", "near"}
    rows: list[tuple[int, bytes]] = []
    layout = running.parts["onboard"].memory.bus.layout
    observer.rows("onboard", layout.size, lambda tick, row: rows.append((tick, row)))
    assert wait_for(lambda: len(rows) > 3)
    running.end()
    log = running.results["onboard"].log
    assert log is not None
    for tick, row in rows[:4]:
        np.testing.assert_array_equal(np.frombuffer(row, np.uint8), log.rows()[tick])
    assert wait_for(lambda: observer.state_of("far") == "silent")


@pytest.mark.long
def test_late_results_of_a_background_block_are_shown(stack: ExitStack) -> None:
    background, _ = both(
        "Slow", 40, params={"sleep_at": 10}, ticks=60_000, background={"late": "hold"},
        clock={"kind": "paced"},
    )  # fmt: skip
    machines = {name: f"tcp/127.0.0.1:{free_port()}" for name in ("control", "thinking")}
    graph = spread(background, machines, {"block": "thinking"})
    placed = split_over_machines(
        replace(graph, links=LinkSettings("free", LinkPolicy(60.0, "hold")))
    )
    observer = stack.enter_context(Observer(placed))
    running = Running(placed)
    stack.callback(running.end)
    assert observer.wait_for(tuple(machines), 60.0) == ()
    assert wait_for(lambda: observer.statuses["thinking"]["late_results"] > 10)
    assert observer.statuses["control"]["late_results"] == 0
    lateness = observer.statuses["thinking"]["lateness"]
    assert lateness["late_after_us"] == pytest.approx(1000.0)
    assert 0.0 < lateness["p50_us"] <= lateness["p99_us"] <= lateness["max_us"]


def test_over_tls_an_observer_sees_and_a_stranger_does_not(
    stack: ExitStack, tmp_path: Path
) -> None:
    pytest.importorskip("cryptography")
    placed = placed_at("tls")
    make_keys(placed, tmp_path / "keys", ["viewer"])
    make_keys(placed, tmp_path / "others", ["viewer"])  # of another authority
    running = Running(placed, tmp_path / "keys")
    stack.callback(running.end)
    viewer = Observer(placed, tmp_path / "keys")
    stranger = Observer(placed, tmp_path / "others")
    with viewer, stranger:
        assert viewer.wait_for(tuple(running.parts), 60.0) == ()
        assert stranger.statuses == {}


class Bench:
    """An observer without a session, to which bytes are given."""

    def __init__(self) -> None:
        self.placed = split_over_machines(free())
        self.observer = Observer(self.placed)


@pytest.mark.parametrize(
    "data",
    [b"", b"[", b"[" * 100_000, b"{}", b'{"machine":"far"}',
     json.dumps({"machine": "x", "rate_hz": 1, "tick": 1, "hash": "", "phase": ""}).encode(),
     json.dumps({"machine": "far", "rate_hz": [], "tick": 1, "hash": "", "phase": ""}).encode()],
)  # fmt: skip
def test_statuses_that_nobody_meant(data: bytes) -> None:
    observer = Bench().observer
    observer._take(data)
    assert observer.statuses == {}


def test_another_graph_is_named() -> None:
    observer = Bench().observer
    status = {"machine": "far", "rate_hz": 1.0, "tick": 1, "hash": "another", "phase": "started"}
    observer._take(json.dumps(status).encode())
    assert observer.state_of("far") == "another graph"


def test_rows_are_checked() -> None:
    rng = np.random.default_rng(1)
    assert read_row(b"", 10) is None and read_row(bytes(ROW_HEADER + 9), 10) is None
    for _ in range(200):
        assert read_row(rng.bytes(ROW_HEADER + 10), 10) is None


def test_a_transport_that_fails_hinders_nothing() -> None:
    placed = split_over_machines(free())

    class Broken:
        is_open = True
        count = 0

        def background_publisher(self, key: str) -> Any:
            self.count += 1
            raise OSError("no network")

    broken: Any = Broken()
    part = BoundPart(placed, "far", broken)
    showing = StatusPublisher("far", broken, part.peers, [])
    showing.open(part)
    for tick in range(10):
        showing.record(tick)
    assert wait_for(lambda: broken.count > 2)
    began = time.monotonic()
    showing.close()
    assert time.monotonic() - began < 30.0
