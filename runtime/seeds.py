"""One graph run with many seeds, spread over processes; rows come back in the order of the seeds."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Generator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import AloftError, ExitCode
from .graph import Graph, load


@dataclass(frozen=True)
class SeedRow:
    """The outcome of one run."""

    seed: int
    success: bool
    reason: str
    metrics: dict[str, Any]
    run_hash: str


def parse_seeds(text: str) -> list[int]:
    """``0:20`` (20 not among them), ``1,5,7`` or ``3``, or several of these with commas.

    Raises:
        AloftError: the text is neither, or names no seed or one twice.
    """
    seeds: list[int] = []
    try:
        for part in text.split(","):
            first, colon, end = part.partition(":")
            seeds += range(int(first), int(end)) if colon else [int(first)]
    except ValueError:
        raise AloftError(f"seeds {text!r} are neither a range 0:20 nor a list 1,5,7") from None
    if not seeds or len(set(seeds)) < len(seeds) or min(seeds) < 0:
        raise AloftError(f"seeds {text!r} are none, one of them twice, or below zero")
    return seeds


def overrides_for(graph: Graph, overrides: Sequence[str], seed: int) -> list[str]:
    """``overrides`` and every parameter called ``seed`` set.

    Raises:
        AloftError: the graph has no such parameter.
    """
    if not graph.seed_parameters:
        raise AloftError(f"graph {graph.checked.name} has no parameter called seed")
    return [*overrides, *(f"{name}={seed}" for name in graph.seed_parameters)]


def run_seeds(
    path: Path, overrides: Sequence[str], seeds: Sequence[int]
) -> Generator[SeedRow, None, None]:
    """Run the graph once a seed, on all processors; each run is what it would be by itself.

    Raises:
        LoadError: the graph may not run.
        AloftError: the graph has no parameter called ``seed``.
    """
    graph = load(path, overrides)
    jobs = [(path, overrides_for(graph, overrides, seed), seed) for seed in seeds]
    workers = min(len(seeds), processors())
    # Spawned, not forked: no state of this process reaches a run.
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(workers, context, initializer=_leave_signals_to_parent) as pool:
        try:
            yield from pool.map(_run_one, jobs)
        except BaseException:
            # The robots of runs that are under way come to rest before their process ends.
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in set(multiprocessing.active_children()) - others:
                worker.terminate()
            raise


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _leave_signals_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


_stopped_by_signal = False
"""In a worker: its run was told to stop, so what is still queued is not begun."""


def _run_one(job: tuple[Path, Sequence[str], int]) -> SeedRow:
    global _stopped_by_signal
    path, overrides, seed = job
    if _stopped_by_signal:
        return SeedRow(seed, False, "not begun", {}, "")
    try:
        result = load(path, overrides).run(log=False)
    except AloftError as error:
        return SeedRow(seed, False, str(error), {}, "")
    _stopped_by_signal = result.exit_code in (ExitCode.INTERRUPTED, ExitCode.TERMINATED)
    data = result.to_json()
    return SeedRow(seed, result.success, result.reason, data["metrics"], result.run_hash)
