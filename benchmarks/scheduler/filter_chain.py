"""The workload of the scheduler's benchmark: a chain of 20 filters on vectors of 12.

Each filter computes y = 0.5 u + 0.5 x and then x' = y; the first reads ones. Whoever runs the chain
must get the same bits as the hand-written loop.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...blocks.general.vectors import Vector
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.stages import BlockSpec, CheckedGraph, Wire

COUNT = 20
WIDTH = 12
HALF = np.array(0.5)


class Filter(Block):
    """A filter of the chain; takes its views once, in setup."""

    u = Input(Vector, default={"value": 1.0}, text="input")
    y = Output(Vector, text="output")
    x = State(Vector, text="the last output")

    def setup(self) -> None:
        """Views and scratch."""
        self._u, self._y, self._x = self.u.value, self.y.value, self.x.value
        self._half_x = np.zeros(WIDTH)

    def step(self) -> None:
        """One tick."""
        y, x, half_x = self._y, self._x, self._half_x
        np.multiply(self._u, HALF, out=y)
        np.multiply(x, HALF, out=half_x)
        np.add(y, half_x, out=y)
        np.copyto(x, y)


class PlainFilter(Filter):
    """The same, looking its ports up as blocks are usually written."""

    def step(self) -> None:
        """One tick."""
        np.multiply(self.u.value, HALF, out=self.y.value)
        np.multiply(self.x.value, HALF, out=self._half_x)
        np.add(self.y.value, self._half_x, out=self.y.value)
        np.copyto(self.x.value, self.y.value)


def chain_graph(block_type: type[Block]) -> CheckedGraph:
    """The chain as a graph."""
    specs = []
    for i in range(COUNT):
        wires = {"u": Wire(f"b{i - 1}.y", f"b{i}.u")} if i else {}
        specs.append(BlockSpec(f"b{i}", block_type, block_type.Params(), wires, {"n": WIDTH}))
    return CheckedGraph("chain", 500.0, tuple(specs), tuple(spec.path for spec in specs))


def hand_loop() -> tuple[Callable[[int], None], list[NDArray[np.float64]]]:
    """The chain as a loop over 20 closures with preallocated arrays, and their outputs."""

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
