"""The same chain in other frameworks, where they are installed (``pip install aloft[peers]``).

Both do the chain's arithmetic with NumPy in Python blocks, which is how their users would write a
block of their own. Their state after some ticks is compared to the hand-written loop's, bit by bit.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .filter_chain import COUNT, WIDTH

PERIOD = 0.002
Case = Callable[[int], object]
Chain = tuple[Case, Callable[[], list[NDArray[np.float64]]]]
"""Runs that many ticks; gives the state of every filter."""


def drake_chain() -> Chain:
    """A diagram of 20 LeafSystems, one ``AdvanceTo`` a tick, as with hardware in the loop."""
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
    """A block diagram of 20 SampledBlocks; every call is a whole ``run``, the only way it has."""
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
    """The installed peers' cases by name, and why the others have none.

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
