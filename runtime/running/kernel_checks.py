"""Checks of the kernels that are not aloft's own, before a run: mistakes in them are mistakes of the graph."""

from __future__ import annotations

from collections.abc import Mapping

from ...mathematics.compiling.kernel_call import KernelCall
from ..language.block import Block
from ..language.errors import ExitCode, RunError
from ..language.extensions import is_own
from ..language.stages import BlockSpec, CheckedGraph


class KernelMistake(RunError):
    """Kernels of some blocks cannot be right; the text has one line for each."""

    def __init__(self, message: str, *, block: str = "") -> None:
        super().__init__(message, block=block)
        self.exit_code = ExitCode.BAD_INPUT


def check_kernels(graph: CheckedGraph, blocks: Mapping[str, Block]) -> None:
    """Check the calls of users' kernels of a graph that is bound, on its memory as it is.

    Raises:
        KernelMistake: equations cannot be rewritten, sizes do not fit, or the first plain run fails.
    """
    found = {
        spec.path: text for spec in graph.blocks if (text := mistake_of(spec, blocks[spec.path]))
    }
    if found:
        first = next(iter(found))
        raise KernelMistake("\n".join(found.values()), block=first)


def mistake_of(spec: BlockSpec, block: Block) -> str:
    """Return what is wrong with a block's kernels, with its place in the graph; empty if nothing is."""
    for call in (*getattr(block, "kernel_calls", ()), *getattr(block, "update_calls", ())):
        if not isinstance(call, KernelCall) or is_own(call.kernel.__module__):
            continue
        from ...mathematics.compiling.rehearsal import mistake_in

        text = mistake_in(call.kernel, call.arguments, run=True)
        if text:
            place = f"{spec.where}: " if spec.where is not None else ""
            return f"{place}block '{spec.path}': {text}"
    return ""
