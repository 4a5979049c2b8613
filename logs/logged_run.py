"""A run to look at: the graph that ran and every signal of every tick of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..runtime.layout import Layout
from ..runtime.run_result import RunResult
from ..runtime.signals import Field
from ..runtime.stages import CheckedGraph


@dataclass(frozen=True)
class LoggedRun:
    """The ``graph``, the ``ticks`` that were kept (n,) and the bus of each, ``rows`` (n, bytes)."""

    graph: CheckedGraph
    ticks: NDArray[np.int64]
    rows: NDArray[np.uint8]
    layout: Layout

    @classmethod
    def of(cls, result: RunResult) -> Self:
        """The run that gave ``result``. Raises ``RuntimeError`` if it kept no log."""
        if result.graph is None or result.log is None or result.log.layout is None:
            raise RuntimeError("this run kept no log; run it with log=True")
        ticks = np.array(result.log.ticks, np.int64)
        return cls(result.graph, ticks, result.log.rows(), result.log.layout)

    def fields(self) -> Iterator[tuple[str, Field]]:
        """Every field of every output with its name ``block.port.field``, in file order."""
        for spec in self.graph.blocks:
            for port, output in spec.block_type.outputs.items():
                for name, field in output.signal.fields.items():
                    yield f"{spec.path}.{port}.{name}", field

    def signal(self, name: str) -> NDArray[Any]:
        """One field at every tick, (n, ...). Raises ``KeyError``."""
        return self.layout.view(self.rows, name)


def entity_of(kind: str, name: str) -> str:
    """The entity that holds ``block.port.field``; nested blocks nest."""
    return f"{kind}/{name.replace('.', '/')}"


def time_columns(graph: CheckedGraph, ticks: NDArray[np.int64]) -> list[Any]:
    """The timelines ``t`` and ``tick``; nanoseconds as integers, because floats would round."""
    import rerun as rr

    nanoseconds = np.rint(ticks * (1e9 / graph.base_rate)).astype("timedelta64[ns]")
    return [rr.TimeColumn("t", duration=nanoseconds), rr.TimeColumn("tick", sequence=ticks)]
