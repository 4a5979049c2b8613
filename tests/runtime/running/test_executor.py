"""What a run computes: simultaneous semantics, loops through delays, several rates, the result."""

import gc
import itertools
import json
import threading
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain, Sum
from aloft.blocks.general.integrators_and_delays import Integrator, UnitDelay
from aloft.blocks.general.sources import Constant, SineWave
from aloft.blocks.general.vectors import Vector
from aloft.runtime.graph import load
from aloft.runtime.language import collector
from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.errors import AloftError, ExitCode
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.language.stages import CheckedGraph, Wire
from aloft.runtime.running.executor import Executor, run
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Filter(Block):
    """y = 0.5 u + 0.5 x, x' = y."""

    class Params(Parameters):
        n: int = 1

    u = Input(Vector, text="input")
    y = Output(Vector, text="output")
    x = State(Vector, text="the last output")

    def step(self) -> None:
        np.multiply(self.u.value, 0.5, out=self.y.value)
        self.y.value += 0.5 * self.x.value
        np.copyto(self.x.value, self.y.value)


class Ticks(Block):
    """Writes the tick and counts its runs."""

    class Params(Parameters):
        n: int = 1

    y = Output(Vector, text="the tick")

    def step(self) -> None:
        self.y.value.fill(self.tick)


class Sampler(Block):
    """A Moore block that emits what it took in last."""

    class Params(Parameters):
        n: int = 1

    u = Input(Vector, text="input")
    y = Output(Vector, text="the last input")
    x = State(Vector, text="the last input")

    def emit(self) -> None:
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        np.copyto(self.x.value, self.u.value)


class Stopper(Block):
    """Asks for the end at a tick and reports."""

    class Params(Parameters):
        at: int = 3
        good: bool | None = None

    y = Output(Vector, text="nothing")

    @classmethod
    def dimensions(cls, params: Parameters, robot: object) -> dict[str, int]:
        return {"n": 1}

    def step(self) -> None:
        if self.tick == self.params.at:
            self.request_stop("seen enough")
            self.request_stop("a later reason")

    def metrics(self) -> dict[str, float | bool | str]:
        verdict = {
            None: {},
            True: {"success": True, "reason": "it stands"},
            False: {"success": False, "reason": "it fell"},
        }[self.params.good]
        return {"height_m": 0.5, "stopper_only": np.float64(2.0), **verdict}


def chain(block_type: type[Block], count: int = 20) -> CheckedGraph:
    blocks = {"source": BlockUse(Constant, {"value": [1.0]})}
    before = "source.y"
    for i in range(count):
        blocks[f"b{i}"] = BlockUse(block_type, {}, {"u": before})
        before = f"b{i}.y"
    return checked_graph(blocks, ticks=30)


def test_after_one_tick_the_twentieth_block_is_half_to_the_twentieth() -> None:
    result = run(chain(Filter))
    assert result.signal("b19.y.value")[0, 0] == 0.5**20
    # and all later ticks: y_i[n] = 0.5 y_{i-1}[n] + 0.5 y_i[n-1], exactly
    expected = np.zeros((30, 20))
    for n, i in itertools.product(range(30), range(20)):
        before = expected[n, i - 1] if i else 1.0
        expected[n, i] = 0.5 * before + 0.5 * (expected[n - 1, i] if n else 0.0)
    for i in range(20):
        assert np.array_equal(result.signal(f"b{i}.y.value")[:, 0], expected[:, i])


def test_a_chain_of_moore_blocks_shifts_by_one_block_a_tick() -> None:
    result = run(chain(Sampler))
    for i in range(20):
        expected = [1.0 if n > i else 0.0 for n in range(30)]
        assert result.signal(f"b{i}.y.value")[:, 0].tolist() == expected


def test_the_order_in_the_file_does_not_matter() -> None:
    graph = chain(Filter)
    names = {"source": BlockUse(Constant, {"value": [1.0]})}
    backwards = {
        f"b{i}": BlockUse(Filter, {}, {"u": f"b{i - 1}.y" if i else "source.y"})
        for i in reversed(range(20))
    }
    other = checked_graph({**backwards, **names}, ticks=30)
    assert other.order == graph.order
    assert np.array_equal(run(other).signal("b19.y.value"), run(graph).signal("b19.y.value"))


def test_a_ring_with_two_delays() -> None:
    graph = checked_graph(
        {
            "a": BlockUse(Gain, {"gain": 2.0}, {"u": Wire("b.y", "a.u", 1, {"value": 1.0})}),
            "b": BlockUse(Gain, {"gain": 3.0}, {"u": Wire("a.y", "b.u", 2, {"value": 10.0})}),
        },
        ticks=8,
    )
    a, b = [], []
    for n in range(8):  # a[n] = 2 b[n-1], b[n] = 3 a[n-2], with the initial values before
        a.append(2.0 * (b[n - 1] if n >= 1 else 1.0))
        b.append(3.0 * (a[n - 2] if n >= 2 else 10.0))
    result = run(graph)
    assert result.signal("a.y.value")[:, 0].tolist() == a
    assert result.signal("b.y.value")[:, 0].tolist() == b
    assert (a[:5], b[:5]) == ([2.0, 60.0, 60.0, 12.0, 360.0], [30.0, 30.0, 6.0, 180.0, 180.0])


def test_a_ring_through_an_integrator() -> None:
    graph = checked_graph(
        {
            "feedback": BlockUse(Gain, {"gain": -1.0}, {"u": "level.y"}),
            "level": BlockUse(Integrator, {"initial": 1.0}, {"u": "feedback.y"}),
        },
        rate=2.0,
        ticks=6,
    )
    levels = run(graph).signal("level.y.value")[:, 0].tolist()
    assert levels == [0.5**n for n in range(6)]


RATES = [(1, 0), (2, 0), (2, 1), (3, 0), (3, 2), (5, 0), (5, 3), (4, 1)]


@pytest.mark.parametrize(("source", "reader"), list(itertools.product(RATES, RATES)))
def test_between_all_pairs_of_rates(source: tuple[int, int], reader: tuple[int, int]) -> None:
    ticks = 64
    graph = checked_graph(
        {
            "a": BlockUse(Ticks, {}, {}, *source),
            "b": BlockUse(Gain, {"gain": 2.0}, {"u": "a.y"}, *reader),
            "c": BlockUse(Sampler, {}, {"u": "a.y"}, *reader),
        },
        ticks=ticks,
    )
    written, sampled, remembered, emitted = 0.0, 0.0, 0.0, 0.0
    a, b, c = [], [], []
    for n in range(ticks):
        if n % reader[0] == reader[1]:
            emitted = remembered  # a Moore block emits before it reads
        if n % source[0] == source[1]:
            written = float(n)  # a slow source is held in between
        if n % reader[0] == reader[1]:
            sampled = 2.0 * written  # a slow reader samples
            remembered = written
        a.append(written)
        b.append(sampled)
        c.append(emitted)
    result = run(graph)
    assert result.signal("a.y.value")[:, 0].tolist() == a
    assert result.signal("b.y.value")[:, 0].tolist() == b
    assert result.signal("c.y.value")[:, 0].tolist() == c
    runs = len([n for n in range(ticks) if n % reader[0] == reader[1]])
    assert result.blocks["b"].calls == result.blocks["c"].calls == runs


def test_a_block_at_a_slower_rate_has_a_longer_period() -> None:
    graph = checked_graph(
        {
            "one": BlockUse(Constant, {"value": [1.0]}),
            "slow": BlockUse(Integrator, {}, {"u": "one.y"}, 5, 2),
        },
        rate=100.0,
        ticks=20,
    )
    level = run(graph).signal("slow.y.value")[:, 0]
    assert level[[0, 2, 7, 12, 17]].tolist() == pytest.approx([0.0, 0.0, 0.05, 0.1, 0.15])


def test_the_result_of_a_run() -> None:
    graph = checked_graph(
        {"a": BlockUse(SineWave, {"n": 3}), "b": BlockUse(Gain, {"n": 3}, {"u": "a.y"})}, ticks=300
    )
    result = run(graph)
    assert (result.success, result.reason) == (True, "ran to its end")
    assert result.exit_code is ExitCode.SUCCESS
    assert (result.ticks, result.duration_s) == (300, pytest.approx(0.6))
    assert result.signal("b.y.value").shape == (300, 3)
    assert result.time[[0, 1, -1]].tolist() == pytest.approx([0.0, 0.002, 0.598])
    assert list(result.blocks) == ["a", "b"]
    times = result.blocks["a"]
    assert times.calls == 300
    assert 0.0 < times.p50_us <= times.p99_us <= times.max_us
    assert times.mean_us <= times.max_us
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert data["success"] is True and data["blocks"]["b"]["calls"] == 300
    assert data["run_hash"] == result.run_hash and len(result.run_hash) == 32


def test_an_unknown_signal_names_the_nearest() -> None:
    result = run(checked_graph({"a": BlockUse(SineWave)}, ticks=1))
    with pytest.raises(KeyError, match=r"no signal 'a.y.values'; the nearest is a.y.value"):
        result.signal("a.y.values")
    assert result.signals() == ("a.y.value",)


def test_without_a_log_there_are_no_signals() -> None:
    result = run(checked_graph({"a": BlockUse(SineWave)}, ticks=1), log=False)
    with pytest.raises(RuntimeError, match="this run kept no log; run it with log=True"):
        result.signal("a.y.value")


def test_a_block_ends_the_run_after_its_tick() -> None:
    result = run(checked_graph({"s": BlockUse(Stopper), "t": BlockUse(Ticks)}, ticks=100))
    assert (result.success, result.reason, result.ticks) == (True, "seen enough", 4)
    assert result.signal("t.y.value")[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert result.metrics == {"height_m": 0.5, "stopper_only": 2.0}


def test_metrics_that_say_so_make_a_run_unsuccessful() -> None:
    result = run(checked_graph({"s": BlockUse(Stopper, {"good": False})}))
    assert (result.success, result.reason) == (False, "it fell")
    assert result.exit_code is ExitCode.NOT_SUCCESSFUL
    assert result.error is None
    assert "success" not in result.metrics


def test_a_judge_that_is_content_gives_the_reason() -> None:
    result = run(checked_graph({"s": BlockUse(Stopper, {"good": True})}))
    assert (result.success, result.reason) == (True, "it stands")
    both = run(
        checked_graph(
            {"s": BlockUse(Stopper, {"good": True}), "t": BlockUse(Stopper, {"good": False})}
        )
    )
    assert (both.success, both.reason) == (False, "it fell")


def test_metrics_of_one_name_are_told_apart_by_block() -> None:
    result = run(checked_graph({"s": BlockUse(Stopper), "t": BlockUse(Stopper, {"good": False})}))
    assert set(result.metrics) == {
        "s.height_m", "t.height_m", "s.stopper_only", "t.stopper_only",
    }  # fmt: skip
    assert result.success is False


def test_a_run_in_stretches_is_the_run_in_one() -> None:
    whole = run(chain(Filter))
    executor = Executor(chain(Filter))
    executor.life.start()
    assert [executor.ticker.advance(n) for n in (1, 7, 22)] == [1, 7, 22]
    last = executor.bound.blocks["b19"].y.value
    assert last.tobytes() == whole.signal("b19.y.value")[-1].tobytes()


def test_a_run_restored_from_a_snapshot_goes_on_bit_for_bit() -> None:
    graph = checked_graph(
        {
            "a": BlockUse(SineWave, {"frequency": 13.0}),
            "b": BlockUse(Filter, {}, {"u": Wire("a.y", "b.u", delay=3)}, 2, 1),
            "c": BlockUse(Integrator, {}, {"u": "b.y"}),
            "d": BlockUse(UnitDelay, {}, {"u": "c.y"}, 3, 2),
            "e": BlockUse(Sum, {}, {"a": "c.y", "b": "d.y"}),
        },
        ticks=100,
    )
    first = BoundGraph(graph)
    executor = Executor(first)
    executor.ticker.advance(41)
    snapshot = first.snapshot()
    states = []
    for _ in range(30):
        executor.ticker.advance(1)
        states.append(first.memory.bus.buffer.tobytes() + first.memory.state.buffer.tobytes())
    for bound in (first, BoundGraph(graph)):
        bound.restore(snapshot)
        again = Executor(bound)
        assert bound.clock.tick == 41
        for expected in states:
            again.ticker.advance(1)
            found = bound.memory.bus.buffer.tobytes() + bound.memory.state.buffer.tobytes()
            assert found == expected


def test_a_restored_graph_runs_what_is_left_of_its_time() -> None:
    whole = run(chain(Filter))
    bound = BoundGraph(chain(Filter))
    Executor(bound).ticker.advance(11)
    again = BoundGraph(chain(Filter))
    again.restore(bound.snapshot())
    rest = run(again)
    assert (rest.ticks, rest.log.ticks) == (19, list(range(11, 30)))
    assert rest.time[0] == pytest.approx(0.022)
    name = "b19.y.value"
    assert np.array_equal(rest.signal(name), whole.signal(name)[11:])


def test_the_hash_is_the_same_with_and_without_log_timing_and_checks() -> None:
    hashes = {
        run(chain(Filter), log=log, timing=timing, finite_check=check).run_hash
        for log, timing, check in itertools.product((True, False), repeat=3)
    }
    assert len(hashes) == 1
    assert hashes != {run(chain(Filter), ticks=29).run_hash}


def test_two_runs_of_one_executor_are_refused() -> None:
    executor = Executor(chain(Filter))
    assert executor.run().success
    with pytest.raises(AloftError, match="a graph that is stopped cannot be run again"):
        executor.run()


@pytest.mark.parametrize("frozen_before", [False, True])
def test_the_collector_is_quiet_while_running_and_as_before_afterwards(
    frozen_before: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    monkeypatch.setattr(collector, "_frozen_elsewhere", False)
    (gc.freeze if frozen_before else gc.unfreeze)()

    class Witness(Ticks):
        def step(self) -> None:
            seen.append((gc.isenabled(), gc.get_freeze_count() > 0))

    assert gc.isenabled()
    frozen = gc.get_freeze_count()
    assert (frozen > 0) == frozen_before
    try:
        run(checked_graph({"w": BlockUse(Witness)}, ticks=2))
        assert seen == [(False, True)] * 2
        # what is freed meanwhile, such as an entry of a cache, is frozen no more
        assert gc.isenabled() and 0.999 * frozen <= gc.get_freeze_count() <= frozen
    finally:
        gc.freeze()  # as tests/conftest.py leaves it


def test_it_runs_in_another_thread() -> None:
    results = []
    thread = threading.Thread(target=lambda: results.append(run(chain(Filter))))
    thread.start()
    thread.join(60.0)
    assert results[0].success


def test_an_empty_graph_runs() -> None:
    result = run(checked_graph({}, ticks=3))
    assert (result.success, result.ticks, result.signals()) == (True, 3, ())


def test_a_block_that_writes_its_input_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "writes_input.py").write_text(
        "from aloft.blocks.general.arithmetic import Gain\n\n\n"
        "class WritesInput(Gain):\n"
        "    def step(self):\n"
        "        self.u.value[0] = 1.0\n"
    )
    (tmp_path / "g.yaml").write_text(
        "rate: 100 Hz\nduration: 1 s\nblocks:\n  wave: {use: blocks.SineWave}\n"
        "  bad: {use: 'writes_input:WritesInput', in: {u: wave.y}}\n"
    )
    reason = load(tmp_path / "g.yaml").run().reason
    assert reason.startswith("block 'bad' failed at tick 0 ") and "read-only; an input" in reason
