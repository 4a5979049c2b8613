"""The cost of the runtime: a chain of 20 small vector blocks beside a hand-written loop.

Each filter of the chain computes y = 0.5 u + 0.5 x on vectors of 12 and then x' = y; the first reads
ones. Other frameworks run the same chain where they are installed (the extra ``peers``):
they do its arithmetic with NumPy in Python blocks, which is how their users would write a block of
their own. Whoever runs the chain must get the same bits as the hand-written loop.
"""

from __future__ import annotations

import contextlib
import gc
import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...blocks.general.vectors import Vector
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.stages import BlockSpec, CheckedGraph, ClockSpec, Wire
from ...runtime.running.memory import BoundGraph
from ...runtime.running.pacing import WallTime
from ...runtime.running.sink import Sink
from ...runtime.running.sinks import MemoryLog, RunHash
from ...runtime.running.ticker import Ticker
from ...runtime.testing.allocations import count_array_allocations
from .rows import Row, compare, take_turns

COUNT = 20
WIDTH = 12
HALF = np.array(0.5)


class Filter(Block):
    """A filter of the chain; takes its views once, in setup."""

    u = Input(Vector, default={"value": 1.0}, text="input")
    y = Output(Vector, text="output")
    x = State(Vector, text="the last output")

    def setup(self) -> None:
        """Make views and scratch memory."""
        self._u, self._y, self._x = self.u.value, self.y.value, self.x.value
        self._half_x = np.zeros(WIDTH)

    def step(self) -> None:
        """Make one tick."""
        y, x, half_x = self._y, self._x, self._half_x
        np.multiply(self._u, HALF, out=y)
        np.multiply(x, HALF, out=half_x)
        np.add(y, half_x, out=y)
        np.copyto(x, y)


class PlainFilter(Filter):
    """The same, looking its ports up as blocks are usually written."""

    def step(self) -> None:
        """Make one tick."""
        np.multiply(self.u.value, HALF, out=self.y.value)
        np.multiply(self.x.value, HALF, out=self._half_x)
        np.add(self.y.value, self._half_x, out=self.y.value)
        np.copyto(self.x.value, self.y.value)


def chain_graph(block_type: type[Block]) -> CheckedGraph:
    """Return the chain as a graph."""
    specs = []
    for i in range(COUNT):
        wires = {"u": Wire(f"b{i - 1}.y", f"b{i}.u")} if i else {}
        specs.append(BlockSpec(f"b{i}", block_type, block_type.Params(), wires, {"n": WIDTH}))
    return CheckedGraph("chain", 500.0, tuple(specs), tuple(spec.path for spec in specs))


def hand_loop() -> tuple[Callable[[int], None], list[NDArray[np.float64]]]:
    """Return the chain as a loop over 20 closures with preallocated arrays, and their outputs."""

    def closure(
        u: NDArray[np.float64],
        y: NDArray[np.float64],
        x: NDArray[np.float64],
        half_x: NDArray[np.float64],
    ) -> Callable[[], None]:
        def step() -> None:
            np.multiply(u, HALF, out=y)
            np.multiply(x, HALF, out=half_x)
            np.add(y, half_x, out=y)
            np.copyto(x, y)

        return step

    outputs: list[NDArray[np.float64]] = []
    steps = []
    u = np.ones(WIDTH)
    for _ in range(COUNT):
        y, x, half_x = (np.zeros(WIDTH) for _ in range(3))
        steps.append(closure(u, y, x, half_x))
        outputs.append(y)
        u = y

    def run(ticks: int) -> None:
        for _ in range(ticks):
            for step in steps:
                step()

    return run, outputs


PERIOD = 0.002
Case = Callable[[int], object]
Chain = tuple[Case, Callable[[], list[NDArray[np.float64]]]]
"""Runs that many ticks; gives the state of every filter."""


def drake_chain() -> Chain:
    """Return a diagram of 20 LeafSystems, one ``AdvanceTo`` a tick, as with hardware in the loop."""
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder, LeafSystem
    from pydrake.systems.primitives import ConstantVectorSource

    class Filter(LeafSystem):  # type: ignore[misc, unused-ignore]  # Drake may be missing
        def __init__(self) -> None:
            super().__init__()
            self.u = self.DeclareVectorInputPort("u", WIDTH)
            state = self.DeclareDiscreteState(WIDTH)
            self.DeclareVectorOutputPort("y", WIDTH, self.output)
            self.DeclarePeriodicDiscreteUpdateEvent(PERIOD, 0.0, self.update)
            self.state = state

        def value(self, context: Any) -> Any:
            return 0.5 * self.u.Eval(context) + 0.5 * context.get_discrete_state_vector().value()

        def output(self, context: Any, output: Any) -> None:
            output.SetFromVector(self.value(context))

        def update(self, context: Any, state: Any) -> None:
            state.set_value(self.state, self.value(context))

    builder = DiagramBuilder()
    source = builder.AddSystem(ConstantVectorSource(np.ones(WIDTH)))
    filters = []
    for i in range(COUNT):
        filters.append(builder.AddSystem(Filter()))
        before = filters[i - 1] if i else source
        builder.Connect(before.get_output_port(0), filters[i].get_input_port(0))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.Initialize()
    done = 0

    def run(ticks: int) -> None:
        nonlocal done
        for _ in range(ticks):  # half a period in between, so that no rounding decides
            simulator.AdvanceTo((done + 0.5) * PERIOD)
            done += 1

    def states() -> list[NDArray[np.float64]]:
        root = simulator.get_context()
        contexts = [system.GetMyContextFromRoot(root) for system in filters]
        return [np.array(c.get_discrete_state_vector().value()).ravel() for c in contexts]

    return run, states


def bdsim_chain() -> Chain:
    """Return a block diagram of 20 SampledBlocks; every call is a whole ``run``, the only way it
    has."""
    import bdsim

    class Filter(bdsim.block.SampledBlock):  # type: ignore[misc, name-defined, unused-ignore]  # bdsim may be missing
        nin = nout = 1

        def __init__(self, clock: Any, **options: Any) -> None:
            super().__init__(clock=clock, x0=np.zeros(WIDTH), feedthrough=True, **options)
            self.last = np.zeros(WIDTH)

        def output(self, t: float, inputs: list[Any], x: Any) -> list[Any]:
            return [0.5 * inputs[0] + 0.5 * x]

        def next(self, t: float, inputs: list[Any], x: Any) -> Any:
            self.last = 0.5 * inputs[0] + 0.5 * x
            self.runs += 1
            return self.last

        runs = 0

    with contextlib.redirect_stdout(io.StringIO()):  # it prints what it does not find
        simulation = bdsim.BDSim(graphics=False, progress=False, verbose=False)
        diagram = simulation.blockdiagram()
        clock = diagram.clock(PERIOD)
        before = diagram.CONSTANT(np.ones(WIDTH))
        filters = []
        for i in range(COUNT):
            block = Filter(clock, name=f"b{i}")
            diagram.add_block(block)
            diagram.connect(before, block)
            filters.append(block)
            before = block
        diagram.compile()

    def run(ticks: int) -> None:
        start = filters[0].runs
        with contextlib.redirect_stdout(io.StringIO()):
            simulation.run(diagram, T=(ticks + 0.5) * PERIOD)  # its first event is at T
        assert filters[0].runs - start == ticks, (filters[0].runs - start, ticks)

    return run, lambda: [block.last for block in filters]


PEERS: dict[str, Callable[[], Chain]] = {
    "pydrake LeafSystem diagram": drake_chain,
    "bdsim SampledBlock": bdsim_chain,
}


def peer_chains(
    expected: Sequence[NDArray[np.float64]], ticks: int
) -> tuple[dict[str, Case], dict[str, str]]:
    """Return the installed peers' cases by name, and the reasons why the others have none.

    Raises:
        AssertionError: a peer's chain differs from ``expected`` after ``ticks``: no fair peer.
    """
    cases: dict[str, Case] = {}
    missing: dict[str, str] = {}
    for name, build in PEERS.items():
        try:
            run, states = build()
        except ImportError as error:
            missing[name] = f"not installed: {error}"
            continue
        run(ticks)
        for i, (found, value) in enumerate(zip(states(), expected, strict=True)):
            assert found.tobytes() == value.tobytes(), f"{name}: block {i} differs"
        cases[name] = run
    return cases, missing


HAND = "hand-written loop"
BARE = "scheduler"
CHECKED = "scheduler with timing and checks"
FULL = "scheduler with timing, checks, log and hash"
PLAIN = "scheduler, ports looked up in step"
BARE_GOAL, CHECKED_GOAL = 1.10, 1.25
TICKS = 200
COMPARED_TICKS = 50


def _ticker(block_type: type[Block], *, checks: bool) -> Ticker:
    bound = BoundGraph(chain_graph(block_type))
    return Ticker(bound, ClockSpec(), WallTime(), timing=checks, finite_check=checks)


def scheduler(rounds: int = 60) -> list[Row]:
    """Measure ``rounds`` of 200 ticks for every case.

    Raises:
        AssertionError: some case's outputs differ in any bit from the hand-written loop's.
    """
    hand, expected = hand_loop()
    bare, checked = _ticker(Filter, checks=False), _ticker(Filter, checks=True)
    full, plain = _ticker(Filter, checks=True), _ticker(PlainFilter, checks=False)
    sinks: list[Sink] = [_BoundedLog(), RunHash()]
    for sink in sinks:
        sink.open(full.bound)
        full.records.append(sink.record)
    cases: dict[str, Case] = {
        HAND: hand,
        BARE: bare.advance,
        CHECKED: checked.advance,
        FULL: full.advance,
        PLAIN: plain.advance,
    }
    _assert_same(cases, expected, (bare, checked, full, plain))
    peers, missing = peer_chains(expected, COMPARED_TICKS)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        times = take_turns({**cases, **peers}, rounds, TICKS)
    finally:
        gc.enable()
        gc.unfreeze()
    rows = [
        Row(HAND, float(np.median(times[HAND])), "us/tick"),
        compare(BARE, times, HAND, goal=BARE_GOAL),
        compare(CHECKED, times, HAND, goal=CHECKED_GOAL),
        compare(FULL, times, HAND),
        compare(PLAIN, times, HAND),
        *(compare(name, times, HAND) for name in peers),
        *(Row(name, None, "us/tick", HAND, note=why) for name, why in missing.items()),
    ]
    return [*rows, _allocations(full)]


class _BoundedLog(MemoryLog):
    """A log that starts again when a chunk is full, because a benchmark has no end."""

    def record(self, tick: int) -> None:
        if len(self.ticks) == self.CHUNK:
            self.ticks.clear()
            self._used = 0
        super().record(tick)


def _assert_same(cases: dict[str, Case], expected: list[Any], tickers: tuple[Ticker, ...]) -> None:
    """Raise unless every case computes the same bits."""
    for case in cases.values():
        case(COMPARED_TICKS)
    for ticker in tickers:
        for i in range(COUNT):
            found: Any = ticker.bound.blocks[f"b{i}"]
            assert found.y.value.tobytes() == expected[i].tobytes(), f"block {i} differs"


def _allocations(ticker: Ticker) -> Row:
    """Count the arrays that NumPy allocates in a tick, with all features on."""
    ticks = 2000
    with count_array_allocations() as counted:
        ticker.advance(ticks)
    per_tick = (counted.count + counted.boxed) / ticks
    return Row(
        "array allocations per tick", per_tick, "1/tick", goal=0.0, note="also of one number"
    )
