"""Blocks of kernels as one compiled call: the same bytes, times, failures and stops as one by one."""

import time
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.integrators_and_delays import UnitDelay
from aloft.blocks.general.sources import SineWave
from aloft.blocks.general.vectors import Vector
from aloft.files.problems import LoadError
from aloft.mathematics.compiling import chain_code
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.kernel import kernel
from aloft.runtime.graph import load
from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.errors import DeclarationError, RunError
from aloft.runtime.language.kernel_block import KernelBlock
from aloft.runtime.language.parameters import Parameters, live_parameter, parameter
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.running import timing
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.pacing import WallTime
from aloft.runtime.running.sink import Sink
from aloft.runtime.running.ticker import Ticker
from aloft.runtime.testing import BlockUse, checked_graph

from ...shipped import kinds

GRAPHS = Path(__file__).parents[3] / "graphs"


class Counts(Signal):
    """Steps so far."""

    steps = Field(dtype="int64", text="how many")


@kernel
def low_pass(u, gain, steps, y):
    steps[()] += 1
    for i in range(u.shape[0]):
        y[i] += gain[0] * (u[i] - y[i])


@kernel
def divide(y, steps, limit, attention):
    attention[0] = 1 if steps[()] == limit else 0
    for i in range(y.shape[0]):
        y[i] = y[i] / (steps[()] - 2.0 * limit)


class InPython(Block):
    """The size of a vector's elements, in plain Python."""

    class Params(Parameters):
        n: int = parameter(1, text="elements")

    params: Params
    u = Input(Vector, text="a vector")
    y = Output(Vector, text="its elements without sign")

    def step(self) -> None:
        np.absolute(self.u.value, out=self.y.value)


class Smooth(KernelBlock):
    """A low-pass filter that divides by zero when it has run twice ``limit`` times."""

    class Params(Parameters):
        n: int = parameter(1, text="elements")
        gain: float = live_parameter(0.25, text="of the filter")
        limit: int = parameter(1000, text="the step that wants attention")
        attend: str = parameter("note", text="what happens then")

    params: Params
    u = Input(Vector, text="what is filtered")
    y = Output(Vector, text="filtered")
    counts = State(Counts, text="steps")

    def setup(self) -> None:
        self.attended: list[int] = []

    def prepare(self) -> None:
        """The calls are made anew, which a chain must notice."""
        gain, limit = np.array([self.params.gain]), self.params.limit
        self.event = np.zeros(1, np.int64)
        self.kernel_calls = (
            KernelCall(low_pass, self.u.value, gain, self.counts.steps, self.y.value),
            KernelCall(divide, self.y.value, self.counts.steps, limit, self.event),
        )

    def on_event(self) -> None:
        self.attended.append(self.tick)
        if self.params.attend == "stop":
            self.request_stop("enough")
        if self.params.attend == "fail":
            raise ValueError("not so")
        end = time.monotonic() + 60.0
        while self.params.attend == "hang" and time.monotonic() < end:
            pass


def graph(**params: object):
    """Three filters in a row, the second at half the rate, with a block of Python in between."""
    return checked_graph(
        {
            "wave": BlockUse(SineWave, {"frequency": 10.0}),
            "one": BlockUse(Smooth, wires={"u": "wave.y"}),
            "slow": BlockUse(Smooth, params, {"u": "one.y"}, period_ticks=2, offset_ticks=1),
            "two": BlockUse(Smooth, wires={"u": "slow.y"}),
            "gain": BlockUse(InPython, wires={"u": "two.y"}),
            "three": BlockUse(Smooth, wires={"u": "gain.y"}),
        }
    )


def ticker(fuse: bool, **params: object) -> Ticker:
    from aloft.mathematics.compiling.compile_calls import compile_calls

    bound = BoundGraph(graph(**params))
    assert compile_calls(bound.kernel_calls) == ""
    made = Ticker(bound, ClockSpec(), WallTime())
    if fuse:
        assert made.fuse()
    return made


def chains(made: Ticker) -> list[tuple[str, ...]]:
    return [
        tuple(owner.name for owner in chain.owners)
        for program in made.programs
        for chain in program.chains
    ]


def test_consecutive_blocks_of_a_phase_are_one_call_with_the_same_bytes() -> None:
    fused, single = ticker(fuse=True), ticker(fuse=False)
    assert chains(fused) == [
        ("wave", "one", "two"),
        ("three", ""),  # and the finite check
        ("wave", "one", "slow", "two"),
        ("three", ""),
    ]
    assert chains(single) == []
    for _ in range(40):
        fused.advance(1)
        single.advance(1)
        assert fused.bound.snapshot() == single.bound.snapshot()
    assert fused.bound.memory.bus.field("three.y.value").any()


@pytest.mark.parametrize("fuse", [True, False])
def test_a_value_that_is_not_finite_ends_the_run_before_updates(fuse: bool) -> None:
    graph = checked_graph(
        {
            "wave": BlockUse(SineWave, {"frequency": 10.0}),
            "one": BlockUse(Smooth, wires={"u": "wave.y"}),
            "behind": BlockUse(UnitDelay, {"initial": [0.5]}, {"u": "one.y"}),
        }
    )
    executor = Executor(graph, fuse=fuse)
    executor.start()
    made = executor.ticker
    assert chains(made) == ([("behind", "wave", "one", "", "behind")] if fuse else [])
    made.advance(3)
    before = made.bound.memory.state.field("behind.x.value").copy()
    made.bound.memory.bus.field("one.y.value")[0] = np.nan
    wrong = r"block 'one' wrote a value that is not finite at tick 3 .*: one.y.value\[0\] is nan"
    with pytest.raises(RunError, match=wrong):
        made.advance(1)
    assert np.array_equal(made.bound.memory.state.field("behind.x.value"), before)


def test_the_executor_fuses_unless_it_is_told_not_to() -> None:
    results = {}
    for fuse in (True, False):
        executor = Executor(graph(), fuse=fuse)
        results[fuse] = executor.run(30)
        assert bool(chains(executor.ticker)) == fuse
    assert results[True].run_hash == results[False].run_hash
    plain = Executor(graph(), plain=True)
    assert plain.run(30).run_hash == results[True].run_hash
    assert not chains(plain.ticker)


def test_every_block_keeps_its_times() -> None:
    result = Executor(graph()).run(300)  # stamps are folded in between
    assert [times.calls for times in result.blocks.values()] == [300, 300, 150, 300, 300, 300]
    for times in result.blocks.values():
        assert 0.0 < times.p50_us <= times.max_us < 1e6
    fused = ticker(fuse=True)
    fused.advance(130)
    for program in fused.programs:
        program.fold()
        kept = program._kept[: min(program.ticks, len(program._kept))]
        assert (kept >= 0).all() and kept.sum() > 0


def test_a_long_run_without_deadlines_is_timed_now_and_then(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(timing, "FIRST_TIMED", 100)
    result = Executor(graph()).run(1480)
    assert [times.calls for times in result.blocks.values()] == [1480, 1480, 740, 1480, 1480, 1480]
    for times in result.blocks.values():
        assert 0.0 < times.p50_us <= times.max_us and times.mean_us < 1e6
    fused = ticker(fuse=True)
    fused.advance(1480)
    for program in fused.programs:
        program.fold()
        assert program.ticks == 740 - program.untimed == 100 + 740 // 32 - 100 // 32
        assert (program._kept[: program.ticks] >= 0).all()


def test_the_block_that_ran_at_an_instant_is_known() -> None:
    fused = ticker(fuse=True)
    fused.advance(1)
    (program,) = (p for p in fused.programs if p.ticks or p._cursor)
    row = program._stamps[0]
    ends = row[program._ends].tolist()
    assert ends == sorted(ends)
    assert program.owners[:3] == ("wave", "one", "two")
    for before, end, owner in zip([0, *ends], ends, program.owners, strict=False):
        assert end == before or program.running_at(end - 1) == owner


@pytest.mark.parametrize("fuse", [True, False])
def test_a_request_to_stop_comes_in_the_same_tick(fuse: bool) -> None:
    result = Executor(graph(limit=5, attend="stop"), fuse=fuse).run(30)
    assert (result.ticks, result.reason) == (10, "enough")
    assert result.success


@pytest.mark.parametrize("fuse", [True, False])
def test_a_failure_names_the_block(fuse: bool) -> None:
    result = Executor(graph(limit=3), fuse=fuse).run(30)
    assert result.reason == (
        "block 'slow' failed at tick 11 (0.022 s): ZeroDivisionError: "
        f"{__file__}:54: kernel divide divided by zero"
    )
    assert result.error is not None and (result.error.block, result.error.tick) == ("slow", 11)


@pytest.mark.parametrize("fuse", [True, False])
def test_a_failure_in_attend_names_the_block(fuse: bool) -> None:
    executor = Executor(graph(limit=3, attend="fail"), fuse=fuse)
    result = executor.run(30)
    assert result.reason == "block 'slow' failed at tick 5 (0.010 s): ValueError: not so"
    assert result.error is not None
    assert result.error.where.startswith(__file__)


@pytest.mark.parametrize("fuse", [True, False])
def test_a_hang_in_attend_names_the_block(fuse: bool) -> None:
    clock = ClockSpec(hangs_after=0.4)
    result = Executor(graph(limit=3, attend="hang"), clock=clock, fuse=fuse).run(30)
    assert result.reason.startswith("block 'slow' hung at tick 5 (0.010 s): it did not return")
    assert result.error is not None and result.error.where.startswith(__file__)


def test_after_attention_the_rest_of_the_chain_runs_once() -> None:
    fused, single = ticker(fuse=True, limit=2), ticker(fuse=False, limit=2)
    for made in (fused, single):
        made.advance(6)
        slow = made.bound.blocks["slow"]
        assert isinstance(slow, Smooth) and slow.attended == [3]
    assert fused.bound.snapshot() == single.bound.snapshot()
    assert fused.bound.memory.state.field("two.counts.steps") == 6


@pytest.mark.parametrize("fuse", [True, False])
def test_a_chain_takes_over_calls_that_new_parameters_have_made(fuse: bool) -> None:
    class Change(Sink):
        """A sink that changes the gain after tick 9."""

        def open(self, bound: BoundGraph) -> None:
            self.bound = bound

        def record(self, tick: int) -> None:
            if tick == 9:
                blocks = self.bound.parameters.blocks
                self.bound.parameters.requests.append(adjust(blocks, ["two.gain=0.75"]))

    hashes = {
        plain: Executor(graph(), plain=plain, fuse=fuse, sinks=[Change()]).run(30).run_hash
        for plain in (True, False)
    }
    assert hashes[True] == hashes[False] != Executor(graph()).run(30).run_hash


@kernel
def count_up(steps, every, turn):
    steps[()] += 1
    turn[0] = 1 if steps[()] % every == 0 else 0


@kernel
def add_one(y):
    for i in range(y.shape[0]):
        y[i] += 1.0


class Sometimes(KernelBlock):
    """Adds one in every ``every``-th step."""

    class Params(Parameters):
        n: int = parameter(1, text="elements")
        every: int = parameter(3, text="steps between two additions")

    params: Params
    y = Output(Vector, text="how often it was added")
    counts = State(Counts, text="steps")

    def setup(self) -> None:
        turn = np.ones(1, np.int64)
        adding = KernelCall(add_one, self.y.value)
        adding.when = turn
        counting = KernelCall(count_up, self.counts.steps, self.params.every, turn)
        self.kernel_calls = (counting, adding)


@pytest.mark.parametrize("options", [{}, {"fuse": False}, {"plain": True}])
def test_a_call_is_left_out_where_it_is_not_its_turn(options: dict[str, bool]) -> None:
    """Also as the last one of a block, after which a time stamp is taken."""
    counters = {
        name: BlockUse(Sometimes, {"every": every})
        for name, every in (("a", 3), ("b", 1), ("c", 100))
    }
    result = Executor(checked_graph(counters), **options).run(10)  # type: ignore[arg-type]
    found = [result.signal(f"{name}.y.value")[:, 0].tolist() for name in "abc"]
    assert found == [[n // 3 for n in range(1, 11)], list(range(1, 11)), [0.0] * 10]
    assert [times.calls for times in result.blocks.values()] == [10, 10, 10]


def test_the_jumps_controller_has_no_python_where_its_blocks_are_kernels() -> None:
    from aloft.mathematics.compiling.compile_calls import compile_calls

    bound = BoundGraph(load(GRAPHS / "jump.yaml").checked)
    assert compile_calls(bound.kernel_calls) == ""
    made = Ticker(bound, ClockSpec(), WallTime())
    assert made.fuse()
    found = chains(made)
    before = "contacts", "estimator", "ahead", "dynamics", "load", "plan", "phase", "step"
    assert any(chain[: len(before)] == before for chain in found)
    assert any("wbc" in chain for chain in found)
    assert any("ahead/command~delay" in chain for chain in found)


def test_a_step_of_its_own_is_refused() -> None:
    with pytest.raises(DeclarationError, match=r"Own: a KernelBlock has no step of its own; setup"):

        class Own(KernelBlock):
            def step(self) -> None:
                pass


def test_the_step_is_shown_in_the_file_of_the_class() -> None:
    assert Smooth.step.__code__.co_filename == __file__
    assert KernelBlock.step.__code__.co_filename != __file__


def test_a_call_that_is_not_compiled_is_not_taken_over() -> None:
    made = ticker(fuse=True)
    one = made.bound.blocks["one"]
    assert isinstance(one, Smooth)
    one.kernel_calls[1].use_plain()
    with pytest.raises(RunError, match="block 'one' has a kernel that did not compile"):
        made.refresh_chains()


def test_without_a_clock_for_machine_code_timed_blocks_are_not_fused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("aloft.runtime.running.ticker.clock_address", lambda: 0)
    assert not ticker(fuse=False).fuse()
    monkeypatch.undo()
    assert chain_code.clock_address() != 0
    assert ticker(fuse=False).fuse()


SHIPPED = kinds(of_robots=True)


@pytest.mark.long
@pytest.mark.parametrize("address", SHIPPED)
def test_every_kind_of_shipped_graph_has_the_same_bytes(address: str) -> None:
    try:
        checked = load(SHIPPED[address]).checked
    except LoadError as error:
        if "pip install example-robot-data" in str(error):
            pytest.skip("example-robot-data is not installed")
        raise
    if any(spec.block_type.outside == "real" for spec in checked.blocks):
        pytest.skip("needs the robot")
    executor = Executor(checked, clock=ClockSpec(), log=False)
    fused = executor.run(700)
    assert chains(executor.ticker)
    plain = Executor(checked, clock=ClockSpec(), log=False, fuse=False).run(700)
    fused.raise_if_failed()
    plain.raise_if_failed()
    assert fused.run_hash == plain.run_hash
