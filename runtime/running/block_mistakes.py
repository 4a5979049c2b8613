"""Mistakes in users' blocks with compiled steps, found without a run."""

from __future__ import annotations

from dataclasses import replace

from ...mathematics.compiling.fingerprint import numba_functions
from ...mathematics.compiling.kernel_registry import is_kernel
from ...mathematics.compiling.numba_calls import uses_blas
from ..language.errors import ExitCode, RunError
from ..language.extensions import is_own
from ..language.stages import CheckedGraph
from .memory import BoundGraph


def mistakes_of(graph: CheckedGraph) -> dict[str, str]:
    """Return the mistakes in the kernels and in ``setup`` of users' blocks that have compiled steps, by
    block. Each is set up by itself, with the defaults of its inputs."""
    found: dict[str, str] = {}
    for spec in graph.blocks:
        kind = spec.block_type
        if is_own(kind.__module__) or not any(map(is_kernel, kind.named_steps.values())):
            continue
        alone = replace(graph, blocks=(replace(spec, wires={}),), order=(spec.path,))
        try:
            BoundGraph(alone)
        except RunError as error:
            if error.exit_code == ExitCode.BAD_INPUT:
                found[spec.path] = str(error)
    return found


def tied_to_machine(graph: CheckedGraph) -> list[str]:
    """Return a word on each block with a function of Numba that uses BLAS, whose bits the machine decides."""
    found = []
    for spec in graph.blocks:
        for step in spec.block_type.named_steps.values():
            names = (
                {uses_blas(each) for each in numba_functions(step)} if is_kernel(step) else set()
            )
            found += [
                f"block '{spec.path}': numba function {name} multiplies or solves by BLAS, so its bits depend on the machine"
                for name in sorted(names - {""})
            ]
    return found
