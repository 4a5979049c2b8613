"""Sinks: the log grows as needed, the hash is that of the bytes."""

from hashlib import blake2b

import numpy as np
import pytest

from aloft.blocks.general.sources import SineWave
from aloft.runtime.running.executor import Executor, run
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.sink import Sink
from aloft.runtime.running.sinks import MemoryLog, RunHash
from aloft.runtime.testing.graphs import BlockUse, checked_graph


@pytest.fixture
def bound() -> BoundGraph:
    return BoundGraph(checked_graph({"a": BlockUse(SineWave, {"n": 3})}))


@pytest.mark.parametrize("expected", [None, 1, 1000, 3000])
def test_the_log_keeps_every_tick(bound: BoundGraph, expected: int | None) -> None:
    log = MemoryLog()
    log.expect(expected)
    log.open(bound)
    value = bound.blocks["a"].y.value
    for tick in range(2500):
        value[:] = [tick, 2 * tick, -tick]
        log.record(tick)
    assert log.rows().shape == (2500, 64)
    assert log.layout is not None
    values = log.layout.view(log.rows(), "a.y.value")
    assert np.array_equal(values, np.outer(np.arange(2500.0), [1.0, 2.0, -1.0]))
    assert log.ticks == list(range(2500))


def test_the_hash_is_that_of_all_bytes(bound: BoundGraph) -> None:
    result = run(bound, ticks=20)
    rows = b"".join(row.tobytes() for row in result.log.rows())
    assert result.run_hash == blake2b(rows, digest_size=16).hexdigest()


def test_a_log_opened_again_forgets(bound: BoundGraph) -> None:
    log, run_hash = MemoryLog(), RunHash()
    for _ in range(2):
        log.open(bound)
        run_hash.open(bound)
        log.record(0)
        run_hash.record(0)
    assert log.rows().shape == (1, 64)
    assert run_hash.hexdigest() == blake2b(bytes(64), digest_size=16).hexdigest()


def test_further_sinks_get_every_tick(bound: BoundGraph) -> None:
    seen: list[object] = []

    class Witness(Sink):
        def open(self, graph: BoundGraph) -> None:
            seen.append(graph is bound)

        def record(self, tick: int) -> None:
            seen.append((tick, bound.blocks["a"].y.value[0]))

        def close(self) -> None:
            seen.append("closed")

    result = Executor(bound, sinks=[Witness()]).run(2)
    values = result.signal("a.y.value")[:, 0].tolist()
    assert seen == [True, (0, values[0]), (1, values[1]), "closed"]
