"""One graph run with many seeds, spread over processes; rows come back in the order of the seeds."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...runtime.graph import Graph, load
from ...runtime.language.errors import AloftError
from .jobs import job_results


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
    rows: dict[int, SeedRow] = {}
    done = 0
    # The robots of runs that are under way when this is closed come to rest first.
    with closing(job_results(_run_one, jobs)) as results:
        for result in results:
            failed = SeedRow(seeds[result.index], False, result.error, {}, "")
            rows[result.index] = failed if result.error else result.value
            while (row := rows.pop(done, None)) is not None:
                yield row
                done += 1


def _run_one(job: tuple[Path, Sequence[str], int]) -> SeedRow:
    path, overrides, seed = job
    result = load(path, overrides).run(log=False)
    data = result.to_json()
    return SeedRow(seed, result.success, result.reason, data["metrics"], result.run_hash)
