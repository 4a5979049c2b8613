"""Runs one graph with many seeds on all processors; the results come in the order of the seeds."""

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
    """Parse a text of seeds: ``0:20`` (20 excluded), ``1,5,7``, ``3``, or ``0:5,8``.

    Raises:
        AloftError: the text is not of this form, names no seed, names one twice or one below zero.
    """
    seeds: list[int] = []
    try:
        for part in text.split(","):
            first, colon, end = part.partition(":")
            seeds += range(int(first), int(end)) if colon else [int(first)]
    except ValueError:
        raise AloftError(
            f"seeds {text!r}: expected a range such as 0:20 or a list such as 1,5,7"
        ) from None
    if not seeds or len(set(seeds)) < len(seeds) or min(seeds) < 0:
        raise AloftError(
            f"seeds {text!r}: expected at least one seed, each once and none below zero"
        )
    return seeds


def overrides_for(graph: Graph, overrides: Sequence[str], seed: int) -> list[str]:
    """Return ``overrides``, and one more for every parameter of the graph that is called ``seed``.

    Raises:
        AloftError: the graph has no such parameter.
    """
    if not graph.seed_parameters:
        raise AloftError(f"graph {graph.checked.name} has no parameter called seed")
    return [*overrides, *(f"{name}={seed}" for name in graph.seed_parameters)]


def run_seeds(
    path: Path,
    overrides: Sequence[str],
    seeds: Sequence[int],
    *,
    plain: bool = False,
    fuse: bool = True,
) -> Generator[SeedRow, None, None]:
    """Run the graph once with each seed. A run does not depend on the others beside it.

    With ``plain`` the kernels run as plain Python; without ``fuse`` one by one.

    Raises:
        LoadError: the graph may not run.
        AloftError: the graph has no parameter called ``seed``.
    """
    graph = load(path, overrides)
    jobs = [(path, overrides_for(graph, overrides, seed), seed, plain, fuse) for seed in seeds]
    rows: dict[int, SeedRow] = {}
    done = 0
    # When this generator is closed, the robots of runs under way come to rest first.
    with closing(job_results(_run_one, jobs)) as results:
        for result in results:
            failed = SeedRow(seeds[result.index], False, result.error, {}, "")
            rows[result.index] = failed if result.error else result.value
            while (row := rows.pop(done, None)) is not None:
                yield row
                done += 1


def _run_one(job: tuple[Path, Sequence[str], int, bool, bool]) -> SeedRow:
    path, overrides, seed, plain, fuse = job
    result = load(path, overrides).run(log=False, plain=plain, fuse=fuse)
    data = result.to_json()
    return SeedRow(seed, result.success, result.reason, data["metrics"], result.run_hash)
