"""Makes those runs of a study that are not in its journal, on all processors or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from time import perf_counter

from ..runtime.language.errors import AloftError, ExitCode
from ..runtime.running.run_result import RunResult
from .batch.jobs import JobPool
from .expansion import Cell, Job, job, seeded_graph
from .journal import Journal, Outcome
from .shared_start import shared_result


@dataclass(frozen=True)
class Run:
    """A cell with a seed and, once it is there, the outcome."""

    cell: Cell
    seed: int
    outcome: Outcome | None = None

    @property
    def key(self) -> str:
        """The key under which the run is kept."""
        return f"{self.cell.key}-{self.seed}"


def run_job(work: Job) -> Outcome:
    """Make one run, in the process that does the work.

    Draws that differ in live parameters share their beginning, with the same bytes. A run that fails is an outcome,
    and so is a graph that cannot be set up.

    Raises:
        AloftError: the process was told to stop.
    """
    begin = perf_counter()
    try:
        result = shared_result(work) or seeded_graph(work).run(log=False)
    except AloftError as error:
        text = str(error)
        return Outcome(False, text, error=text, wall_time_s=perf_counter() - begin)
    return outcome_of(result, perf_counter() - begin)


def outcome_of(result: RunResult, wall_time: float = 0.0) -> Outcome:
    """Return the part of a run's result that is kept.

    Raises:
        AloftError: a signal ended the run, so it has no outcome.
    """
    if result.exit_code in (ExitCode.INTERRUPTED, ExitCode.TERMINATED):
        raise AloftError(result.reason)
    failed = result.exit_code == ExitCode.RUN_FAILED or result.error is not None
    return Outcome(
        result.success,
        result.reason,
        result.run_hash,
        result.to_json()["metrics"],
        result.reason if failed else "",
        wall_time,
    )


def run_pool(workers: int = 0, cluster: str = "") -> JobPool:
    """Start the processes, or the cluster, that make runs."""
    return JobPool(run_job, workers=workers, cluster=cluster)


def make_runs(
    runs: Sequence[Run],
    journal: Journal,
    pool: JobPool,
    *,
    on_run: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Run]:
    """Make all runs and return them with their outcomes, in the order of ``runs``; ``pool`` is one
    of ``run_pool``.

    Runs that are in the journal are not made again. Every other run is kept as soon as it is done.
    Runs with the same key are made once, and ``on_run`` is called once for them. The death of a
    run's process is an error here, but it is not kept, so the run is tried again the next time.

    Raises:
        AloftError: as ``JobPool.results``.
    """
    missing = {run.key: run for run in runs if run.key not in journal.outcomes}
    for key in dict.fromkeys(run.key for run in runs if run.key not in missing):
        on_run(journal.outcomes[key])
    order = list(missing.values())
    lost: dict[str, Outcome] = {}
    if order:
        jobs = (job(run.cell, run.seed) for run in order)
        with closing(pool.results(jobs)) as results:
            for result in results:
                key = order[result.index].key
                if result.error:
                    outcome = Outcome(False, result.error, error=result.error)
                    lost[key] = outcome
                else:
                    outcome = result.value
                    journal.add(key, outcome)
                on_run(outcome)
    found = journal.outcomes | lost
    return [Run(run.cell, run.seed, found[run.key]) for run in runs]
