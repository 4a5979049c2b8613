"""The calls of a tick: one list, which the ticker, analyses of one period and exported libraries follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from ..language.block import Block
from ..language.stages import CheckedGraph

Method = Literal["emit", "step", "update"]
Calls = Literal["kernel_calls", "update_calls"]
"""The kernel calls of a block's ``step`` or ``emit``, or those of its ``update``."""


@dataclass(frozen=True)
class TickCall:
    """A call of a block's method, in the ticks of a ``period`` from an ``offset`` [ticks]."""

    path: str
    method: Method
    period: int
    offset: int

    @property
    def calls(self) -> Calls:
        """The attribute of the block with the kernel calls that the method makes."""
        return "update_calls" if self.method == "update" else "kernel_calls"


class TickCalls(NamedTuple):
    """The calls of a hyperperiod, each part in the order of execution.

    Attributes:
        outputs: ``emit`` of Moore and ``step`` of Mealy blocks; one for each block in the order.
        updates: of Moore blocks, once all outputs of the tick are written.
    """

    outputs: tuple[TickCall, ...]
    updates: tuple[TickCall, ...]


def tick_calls(graph: CheckedGraph, blocks: Mapping[str, Block]) -> TickCalls:
    """Return the calls of the blocks of a bound graph."""
    outputs, updates = [], []
    for path in graph.order:
        spec, is_moore = graph.block(path), type(blocks[path]).is_moore()
        rate = spec.period_ticks, spec.offset_ticks
        outputs.append(TickCall(path, "emit" if is_moore else "step", *rate))
        if is_moore:
            updates.append(TickCall(path, "update", *rate))
    return TickCalls(tuple(outputs), tuple(updates))


def can_be_chained(block: Block, which: Calls = "kernel_calls") -> bool:
    """Return whether a block's step, or its update, is nothing but compiled kernels."""
    calls = getattr(block, which)
    names = {"update"} if which == "update_calls" else {"step", "emit"}
    if names & type(block).overridden_steps:
        return False  # there is Python around the calls
    return bool(calls) and all(call.compiled is not None for call in calls)
