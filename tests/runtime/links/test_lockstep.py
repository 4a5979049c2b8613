"""In lockstep a graph on several machines gives the bytes of one process, whatever the network does."""

import random
import re
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import pytest

from aloft.runtime.language.errors import AloftError, ExitCode
from aloft.runtime.links.part import BoundPart
from aloft.runtime.loading import checked_file
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.placement.placed import split_over_machines, spread
from aloft.runtime.running.executor import run
from aloft.runtime.testing.spread import run_spread
from aloft.runtime.transports.hub import Hub

from ...waiting import wait_for
from .example_graphs import Counter, endpoints, random_graph, ring

GRAPHS = Path(__file__).parents[3] / "graphs"
SEEDS = 8
"""How many random graphs there are."""


@pytest.mark.parametrize("seed", range(SEEDS))
def test_any_graph_in_any_split_gives_the_bytes_of_one_process(seed: int) -> None:
    graph = random_graph(np.random.default_rng(seed))
    alone = run(graph)
    assert alone.success, alone.reason
    spread_out = run_spread(graph)
    assert spread_out.ticks == alone.ticks
    assert spread_out.run_hash == alone.run_hash
    np.testing.assert_array_equal(spread_out.rows, alone.log.rows() if alone.log else None)


def test_the_random_graphs_go_forth_and_back_within_a_tick() -> None:
    # otherwise the test above would not test it
    returns = 0
    for seed in range(SEEDS):
        graph = random_graph(np.random.default_rng(seed))
        machines = [graph.block(path).machine for path in graph.order]
        blocks = {spec.path: spec for spec in graph.blocks}
        links = split_over_machines(graph).links
        assert links
        for path, machine in zip(graph.order, machines, strict=True):
            for wire in blocks[path].wires.values():
                source = blocks[wire.source_block]
                for further in source.wires.values():
                    origin = blocks[further.source_block]
                    if not source.block_type.is_moore() and source.machine != machine:
                        returns += origin.machine == machine
    assert returns >= 5


def test_a_jump_in_a_random_split() -> None:
    rng = np.random.default_rng(0)
    graph = checked_file(GRAPHS / "jump.yaml", {"robot.seed": 3})
    machines = endpoints("a", "b", "c")
    places = {spec.path: str(rng.choice(list(machines))) for spec in graph.blocks}
    alone = run(graph, 60)  # first: compiling kernels takes longer than parts wait for each other
    assert run_spread(spread(graph, machines, places), 60).run_hash == alone.run_hash


def test_what_stops_the_run_stops_all_parts_after_the_same_tick() -> None:
    graph = ring({"stop_at": 17})
    alone, spread_out = run(graph), run_spread(graph)
    assert spread_out.ticks == alone.ticks == 18
    assert spread_out.run_hash == alone.run_hash
    assert {r.reason for r in spread_out.results.values()} == {"counted enough"}
    assert all(r.success for r in spread_out.results.values())


def test_a_fault_ends_all_parts_before_the_same_tick() -> None:
    graph = ring({"fail_at": 17})
    alone, spread_out = run(graph), run_spread(graph)
    assert alone.exit_code is ExitCode.RUN_FAILED and alone.log is not None
    assert spread_out.ticks == len(alone.log.ticks) == 17
    assert spread_out.run_hash == alone.run_hash
    here = "block 'first' failed at tick 17 (0.034 s): the spring broke"
    assert {name: result.reason for name, result in spread_out.results.items()} == {
        "near": here, "onboard": f"machine 'near': {here}", "far": f"machine 'near': {here}",
    }  # fmt: skip
    for result in spread_out.results.values():
        assert result.exit_code is ExitCode.RUN_FAILED
        assert result.error is not None
        assert (result.error.block, result.error.tick) == ("first", 17)


def test_the_tick_with_a_value_that_is_not_finite_is_recorded_everywhere() -> None:
    graph = ring({"nan_at": 17})
    alone, spread_out = run(graph), run_spread(graph)
    assert alone.log is not None
    assert spread_out.ticks == len(alone.log.ticks) == 18
    assert spread_out.run_hash == alone.run_hash
    assert "block 'first' wrote a value that is not finite" in spread_out.results["near"].reason
    assert all(r.exit_code is ExitCode.RUN_FAILED for r in spread_out.results.values())


def change(parts: Mapping[str, BoundPart], at: int, machine: str, value: float) -> list[str]:
    """Hand in a change of ``first.factor`` at ``machine`` when tick ``at`` runs there."""
    part = parts[machine]
    answers: list[str] = []

    def submit() -> None:
        try:
            part.parameters.submit(adjust(part.blocks, {"first.factor": value}), 10.0)
            answers.append("")
        except AloftError as error:
            answers.append(str(error))

    thread = threading.Thread(target=submit, daemon=True)
    block = part.blocks["~coordinator"]
    before: Callable[[], None] = block.update  # type: ignore[attr-defined]

    def update() -> None:
        if part.clock.tick == at:
            thread.start()
            while not part.parameters.handed_in:
                time.sleep(1e-3)
        before()

    block.update = update  # type: ignore[attr-defined]
    return answers


@pytest.mark.parametrize("machine", ["near", "onboard"])
def test_a_parameter_changes_everywhere_in_one_tick(machine: str) -> None:
    answers: list[list[str]] = []
    spread_out = run_spread(
        ring(), prepare=lambda parts, hub: answers.append(change(parts, 9, machine, 2.0))
    )
    wait_for(lambda: answers[0])  # the thread that asked may run later than the run ends
    assert answers == [[""]]
    for part in spread_out.parts.values():
        assert [(c.tick, c.path, c.new) for c in part.parameters.changes] == [
            (10, "first.factor", 2.0)
        ]
    # the same change at the same tick in one process gives the same bytes
    log = run_at_tick_10(2.0)
    np.testing.assert_array_equal(spread_out.rows, log)


def run_at_tick_10(value: float) -> np.ndarray:
    from aloft.runtime.running.executor import Executor

    executor = Executor(ring())
    parameters = executor.bound.parameters
    adjustment = adjust(executor.bound.blocks, {"first.factor": value})
    executor.ticker.records.append(
        lambda tick: parameters.requests.append(adjustment) if tick == 9 else None
    )
    result = executor.run()
    assert adjustment.tick == 10 and result.log is not None
    return result.log.rows()


@pytest.mark.parametrize("machine", ["near", "far"])
def test_a_change_that_a_block_refuses_changes_nothing_anywhere(machine: str) -> None:
    answers: list[list[str]] = []
    spread_out = run_spread(
        ring(), prepare=lambda parts, hub: answers.append(change(parts, 9, machine, 7.0))
    )
    wait_for(lambda: answers[0])
    assert answers == [["block 'first' refuses the change: seven is refused"]]
    assert spread_out.run_hash == run(ring()).run_hash
    for part in spread_out.parts.values():
        assert part.parameters.changes == []
        assert part.blocks["first"].params.factor == 1.0  # type: ignore[attr-defined]


# -- what a network does to messages ---------------------------------------------------------------


def doubled(key: str, data: bytes) -> Iterable[bytes]:
    return (data, data)


class Older:
    """Sends each message of a link once more after the next, so that old ones come among new."""

    def __init__(self) -> None:
        self.last: dict[str, bytes] = {}

    def __call__(self, key: str, data: bytes) -> Iterable[bytes]:
        older = self.last.get(key)
        self.last[key] = data
        return (data,) if older is None else (data, older)


def late(key: str, data: bytes) -> Iterable[bytes]:
    if key.startswith("data"):
        time.sleep(random.Random(len(data)).choice([0.0, 0.001]))
    return (data,)


class LosesBeacons:
    """Loses half of the beacons, which parts repeat."""

    def __init__(self) -> None:
        self.rng = random.Random(4)

    def __call__(self, key: str, data: bytes) -> Iterable[bytes]:
        return () if key.startswith("beacon") and self.rng.random() < 0.5 else (data,)


class AndDamagedCopies:
    """Sends a changed, a cut and a random copy before each message of a link."""

    def __init__(self) -> None:
        self.rng = random.Random(4)

    def __call__(self, key: str, data: bytes) -> Iterable[bytes]:
        changed = bytearray(data)
        changed[self.rng.randrange(len(data))] ^= 1 << self.rng.randrange(8)
        if key.startswith("data"):
            return (bytes(changed), data[:-3], self.rng.randbytes(len(data)), b"", data)
        return (self.rng.randbytes(40), b"", b"{}", b"[1]", b"null", data)


@pytest.mark.parametrize(
    "interfere",
    [doubled, late, Older(), LosesBeacons(), AndDamagedCopies()],
    ids=["doubled", "late", "reordered", "beacons lost", "damaged copies"],
)
def test_what_a_network_may_do_changes_no_byte(
    interfere: Callable[[str, bytes], Iterable[bytes]],
) -> None:
    spread_out = run_spread(ring(), interfere=interfere)
    assert spread_out.run_hash == run(ring()).run_hash


def test_damaged_and_doubled_messages_are_counted() -> None:
    spread_out = run_spread(ring(), interfere=AndDamagedCopies())
    receiver = spread_out.parts["near"].receivers[0]
    assert receiver.received == 40 and receiver.damaged >= 4 * 40
    spread_out = run_spread(ring(), interfere=doubled)
    receiver = spread_out.parts["near"].receivers[0]
    assert 79 <= receiver.received <= 80 and receiver.surplus >= 38


class FromMessage:
    """Does something to every message of one link from its n-th on."""

    def __init__(self, key: str, count: int, what: Callable[[bytes], Iterable[bytes]]) -> None:
        self.key, self.count, self.what = key, count, what

    def __call__(self, key: str, data: bytes) -> Iterable[bytes]:
        if key == self.key:
            self.count -= 1
            if self.count < 0:
                return self.what(data)
        return (data,)


@pytest.mark.parametrize(
    ("what", "told"),
    [
        (lambda data: (), ""),
        (lambda data: (data[:-1],), r"; \d+ were damaged, the last: it has \d+ bytes, expected"),
        (lambda data: (data[:-1] + b"x",), r"; \d+ were damaged, the last: its checksum is wrong"),
    ],
    ids=["lost", "truncated", "corrupted"],
)
def test_a_message_that_is_lost_for_good_ends_the_run_in_order(
    what: Callable[[bytes], Iterable[bytes]], told: str
) -> None:
    Counter.LOG.clear()
    interfere = FromMessage("data/near/far/first", 20, what)
    spread_out = run_spread(ring(), interfere=interfere, timeout=2.0)
    reasons = [r.reason for r in spread_out.results.values()]
    # the robot waits for its command, and the machine that sends it for the message that is lost
    lost = r"link (first@near -> far|last@far -> onboard): the message of tick (\d+) has not come"
    matches = [
        re.search(lost + r" in 2 s \(links.patience\). \d+ came before", reason)
        for reason in reasons
    ]
    assert all(matches), reasons
    (tick,) = {int(match[2]) for match in matches if match}
    assert 10 <= tick <= 20
    for match, reason in zip(matches, reasons, strict=True):
        if match and match[1] == "first@near -> far":
            assert re.search(re.escape(match[0]) + told, reason)
    assert spread_out.ticks == tick
    assert all(r.exit_code is ExitCode.RUN_FAILED for r in spread_out.results.values())
    assert ["robot starts", *["robot rests"] * 5, "robot closes"] == Counter.LOG


def test_a_machine_that_is_gone_ends_the_run_at_once() -> None:
    def prepare(parts: Mapping[str, BoundPart], hub: Hub) -> None:
        block = parts["near"].blocks["first"]
        before: Callable[[], None] = block.step  # type: ignore[attr-defined]

        def step() -> None:
            if block.tick == 21:
                hub.leave("near")
                time.sleep(1.0)
            before()

        block.step = step  # type: ignore[attr-defined]

    Counter.LOG.clear()
    began = time.monotonic()
    spread_out = run_spread(ring(), prepare=prepare, timeout=120.0)
    assert time.monotonic() - began < 60.0
    for name in ("onboard", "far"):
        assert "machine 'near' is gone" in spread_out.results[name].reason
        assert spread_out.results[name].exit_code is ExitCode.RUN_FAILED
    assert Counter.LOG[1:6] == ["robot rests"] * 5
