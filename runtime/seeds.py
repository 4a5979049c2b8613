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
    with ProcessPoolExecutor(workers, context, initializer=_take_signals) as pool:
        runs = [pool.submit(_run_one, job) for job in jobs]
        try:
            for run in runs:
                yield run.result()
        except BaseException:
            # The robots of runs that are under way come to rest before their process ends. What
            # is queued is not cancelled but let go by the workers: a pool that breaks because a
            # worker is stopped while it starts cannot cope with cancelled work, and hangs.
            for worker in set(multiprocessing.active_children()) - others:
                worker.terminate()
            raise


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _StoppedError(BaseException):
    """In a worker: told to stop before its run could take the signal itself."""


_told_to_stop = False
"""In a worker: what is still queued is not begun."""
_preparing = False
"""In a worker: a run is being loaded and set up."""


def _take_signals() -> None:
    """In a worker: SIGINT is the parent's, and SIGTERM never kills a worker that waits for work,
    which would break the pool. A run that is under way takes SIGTERM itself and stops cleanly."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _stop)


def _stop(number: int, frame: object) -> None:
    global _told_to_stop
    _told_to_stop = True
    if _preparing:
        raise _StoppedError


def _run_one(job: tuple[Path, Sequence[str], int]) -> SeedRow:
    global _told_to_stop, _preparing
    path, overrides, seed = job
    try:
        _preparing = True
        if _told_to_stop:
            raise _StoppedError
        result = load(path, overrides).run(log=False)
    except _StoppedError:
        return SeedRow(seed, False, "not begun", {}, "")
    except AloftError as error:
        return SeedRow(seed, False, str(error), {}, "")
    finally:
        _preparing = False
    _told_to_stop |= result.exit_code in (ExitCode.INTERRUPTED, ExitCode.TERMINATED)
    data = result.to_json()
    return SeedRow(seed, result.success, result.reason, data["metrics"], result.run_hash)
