"""Mistakes in users' blocks with compiled steps, found without a run."""

from __future__ import annotations

from dataclasses import replace

from ...mathematics.compiling.kernel_registry import is_kernel
from ..language.errors import ExitCode, RunError
from ..language.stages import CheckedGraph
from .kernel_checks import OWN
from .memory import BoundGraph


def mistakes_of(graph: CheckedGraph) -> dict[str, str]:
    """Return the mistakes in the kernels and in ``setup`` of users' blocks that have compiled steps, by
    block. Each is set up by itself, with the defaults of its inputs."""
    found: dict[str, str] = {}
    for spec in graph.blocks:
        kind = spec.block_type
        if kind.__module__.startswith(OWN) or not any(map(is_kernel, kind.named_steps.values())):
            continue
        alone = replace(graph, blocks=(replace(spec, wires={}),), order=(spec.path,))
        try:
            BoundGraph(alone)
        except RunError as error:
            if error.exit_code == ExitCode.BAD_INPUT:
                found[spec.path] = str(error)
    return found
