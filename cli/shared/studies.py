"""The runs of a study: checked, made with a progress bar, shown as a table or JSON, and made again one by one."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from ...runtime.language.errors import AloftError, ExitCode
from .output import number, print_error, print_json, print_warning, say, stopped_by_signals, table
from .run_graph import code_with_recording
from .viewing import draw, how_to_view, show

if TYPE_CHECKING:
    from rich.console import Console

    from ...studies.batch.jobs import JobPool
    from ...studies.comparison import Comparison
    from ...studies.execution import Run
    from ...studies.expansion import Cell
    from ...studies.journal import Journal, Outcome
    from ...studies.study import CellFilter, Study
    from ...studies.summary import StudyRow
    from ...studies.tuning import Draw


def check_cells(found: Study, expanded: Sequence[Cell], screen: Console) -> list[Cell]:
    """Check the cells as ``aloft check`` checks a graph, and return them."""
    from ...studies.expansion import checked_cells
    from ...studies.journal import code_fingerprint
    from .output import progress_bar

    with progress_bar(screen, f"checking {len(expanded)} cells", len(expanded)) as (bar, task):
        return checked_cells(expanded, found, code_fingerprint(), lambda: bar.advance(task))


class RunMaker:
    """Makes batches of runs, all with the same processes and under one progress bar; see ``run_maker``."""

    def __init__(self, journal: Journal, pool: JobPool, show: Callable[[int], None]) -> None:
        self.asked: list[Run] = []
        self.made: list[Run] = []
        self.stopped: signal.Signals | None = None
        """The signal that stopped the work."""
        self._journal, self._pool, self._show = journal, pool, show
        self._successes = 0

    def __call__(self, runs: Sequence[Run]) -> list[Run]:
        """Make all runs and return them with their outcomes."""
        from ...studies.execution import make_runs

        self.asked += runs
        done = make_runs(runs, self._journal, self._pool, on_run=self._on_run)
        self.made += done
        return done

    def _on_run(self, outcome: Outcome) -> None:
        self._successes += outcome.success
        self._show(self._successes)


@contextmanager
def run_maker(
    journal: Journal, workers: int, cluster: str, screen: Console, text: str, total: int
) -> Iterator[RunMaker]:
    """Make runs within the block, which SIGINT and SIGTERM leave; ``stopped`` then has the signal.

    ``total`` is how many runs there will be, for the progress bar.
    """
    from ...studies.execution import run_pool
    from .output import progress_bar

    with (
        stopped_by_signals() as received,
        progress_bar(screen, text, total) as (bar, task),
        run_pool(workers, cluster) as pool,
    ):

        def show(successes: int) -> None:
            bar.update(task, advance=1, description=f"{text}: {successes} succeeded")

        maker = RunMaker(journal, pool, show)
        try:
            yield maker
        finally:
            maker.stopped = received[0] if received else None


def make_all(
    runs: Sequence[Run],
    journal: Journal,
    workers: int,
    cluster: str,
    screen: Console,
    text: str,
) -> list[Run] | signal.Signals:
    """Make all runs that the journal lacks.

    Returns:
        All runs with their outcomes, or the signal that stopped the work.
    """
    keys = {run.key for run in runs}
    known = len(keys & journal.outcomes.keys())
    if known:
        say(screen, f"{known} of {len(keys)} runs were made before")
    with run_maker(journal, workers, cluster, screen, text, len(keys)) as make:
        return make(runs)
    assert make.stopped is not None
    return make.stopped


def report_stop(
    stopped: signal.Signals, runs: Sequence[Run], journal: Journal, screen: Console, as_json: bool
) -> ExitCode:
    """Print how many runs were made before the signal; the exit code says which signal it was."""
    journal.read_back()
    keys = {run.key for run in runs}
    done, all_runs = len(keys & journal.outcomes.keys()), len(keys)
    reason = f"stopped by {stopped.name} after {done} of {all_runs} runs, which are kept"
    if as_json:
        print_json({"success": False, "reason": reason, "done": done, "runs": all_runs})
    else:
        print_warning(f"{reason}; the same command continues from there")
    return ExitCode(128 + stopped)


MOST_ROWS = 60


def study_json(
    study: Study, rows: Sequence[StudyRow], seeds: Sequence[int], folder: Path
) -> dict[str, Any]:
    """Return the results as one JSON object."""
    from ...studies.journal import code_fingerprint
    from ...studies.study import FIRST_REPORT_SEED

    n, successes = sum(row.n for row in rows), sum(row.successes for row in rows)
    errors = sum(row.errors for row in rows)
    goals = [row.met for row in rows if row.met is not None]
    reason = f"{successes} of {n} runs succeeded"
    if goals:
        reason += f"; {sum(goals)} of {len(goals)} goals met"
    if errors:
        reason += f"; {errors} runs broke"
    return {
        "success": not errors and all(goals),
        "reason": reason,
        "study": study.name,
        "n": n,
        "successes": successes,
        "errors": errors,
        "seeds": list(seeds),
        "tuning_seeds": [seed for seed in seeds if seed < FIRST_REPORT_SEED],
        "code": code_fingerprint(),
        "table": str(folder / "runs.parquet"),
        "rows": [row.to_json() for row in rows],
    }


def print_rows(
    screen: Console, study: Study, rows: Sequence[StudyRow], seeds: Sequence[int]
) -> None:
    """Print one line for each cell. Axes with a single value are left out."""
    from ...studies.study import FIRST_REPORT_SEED

    tuning = sum(seed < FIRST_REPORT_SEED for seed in seeds)
    if tuning:
        print_warning(
            f"{tuning} of {len(seeds)} seeds are tuning seeds (below {FIRST_REPORT_SEED}): "
            "no result to report"
        )
    axes = [name for name in study.axis_names if len(study.labels_of(name)) > 1] or ["task"]
    cells = [
        (
            *(row.cell.labels[axis] for axis in axes),
            f"{row.successes}/{row.n}",
            f"{row.rate:.1%}",
            f"{row.ci_low:.1%} to {row.ci_high:.1%}",
            "" if row.goal is None else f"{row.goal:.0%}",
            "" if row.met is None else number(row.met),
            next(iter(row.reasons), ""),
        )
        for row in rows[:MOST_ROWS]
    ]
    columns = (
        *axes,
        ">succeed",
        ">rate",
        ">95 % interval",
        ">goal",
        "met",
        "most frequent failure",
    )
    screen.print(table(study.title, columns, cells))
    if len(rows) > MOST_ROWS:
        screen.print(f"... and {len(rows) - MOST_ROWS} more cells, in the summary")


MOST_COMPARISONS = 40


def print_comparisons(screen: Console, comparisons: Sequence[Comparison]) -> None:
    """Print success and, of the metrics, those whose difference is clear of chance.

    A metric is shown if its p times the number of all metrics that are compared (Bonferroni) is below 0.05.
    """
    from ...studies.comparison import SUCCESS

    metrics = sum(each.metric != SUCCESS for each in comparisons)
    shown = [each for each in comparisons if each.metric == SUCCESS or each.p * metrics < 0.05]
    if not shown:
        return
    rows = [
        (
            each.other,
            each.metric,
            str(each.n),
            str(each.pairs),
            *(
                f"{100.0 * v:+.1f} %" if each.metric == SUCCESS else number(v)
                for v in (each.difference, each.ci_low, each.ci_high)
            ),
            f"{each.p:.2g}",
            "" if each.p_wilcoxon is None else f"{each.p_wilcoxon:.2g}",
            "" if each.only_base is None else f"{each.only_base} : {each.only_other}",
            "" if each.seeds_needed is None else str(each.seeds_needed),
        )
        for each in shown[:MOST_COMPARISONS]
    ]
    columns = (shown[0].axis, "metric", ">seeds", ">pairs", ">difference", ">from", ">to", ">p", ">p, ranks",
               ">only base : only this", ">seeds needed")  # fmt: skip
    screen.print(table(f"compared with {shown[0].base}, seed by seed", columns, rows))
    left = len(comparisons) - min(len(shown), MOST_COMPARISONS)
    if left:
        say(screen, f"further comparisons of metrics, in the summary: {left}")


def tuned_json(study: Study, best: Mapping[str, Draw], path: Path, broken: int) -> dict[str, Any]:
    """Return the result of tuning as one JSON object."""
    assert study.tuning is not None
    return {
        "success": True,
        "reason": f"tuned {len(best)} arms",
        "study": study.name,
        "seeds": list(study.tuning.seeds),
        "draws_per_arm": study.tuning.draws,
        "errors": broken,
        "file": str(path),
        "arms": {
            arm: {"draw": d.number, "successes": d.successes, "n": d.n, "set": dict(d.values)}
            for arm, d in best.items()
        },
    }


def print_tuned(screen: Console, study: Study, best: Mapping[str, Draw]) -> None:
    """Print the best draw of every arm."""
    from ...files.nodes import text_of

    assert study.tuning is not None
    cells = [
        (
            arm,
            str(found.number),
            f"{found.successes}/{found.n}",
            ", ".join(f"{key} {text_of(value)}" for key, value in found.values.items())
            or "as written",
        )
        for arm, found in best.items()
    ]
    title = f"best of {study.tuning.draws} draws for every arm"
    screen.print(table(title, ("arm", ">draw", ">succeed", "parameters"), cells))


def open_run(
    found: Study,
    part: CellFilter,
    seeds: Sequence[int],
    folder: Path,
    number: int,
    screen: Console,
    as_json: bool,
    *,
    show: bool,
) -> ExitCode:
    """Record the run and, if that is wanted, show it.

    Raises:
        AloftError: the study has no finished runs, or none with that number.
    """
    from ...logs.recording.recorder import Recorder
    from ...studies.execution import Run
    from ...studies.expansion import cells as expand
    from ...studies.journal import Journal
    from ...studies.tuning import read_tuned
    from ...studies.worst import chosen_run, file_name, labels_of, run_again, with_outcomes

    chosen = [cell for cell in expand(found, read_tuned(found)) if part.takes(cell.labels)]
    cells = check_cells(found, chosen, screen)
    with Journal(folder / "runs.jsonl") as journal:
        runs = with_outcomes([Run(c, seed) for c in cells for seed in seeds], journal.outcomes)
    if not runs:
        raise AloftError(
            f"no run of {found.path} as it is now is in {folder}; run the study first: "
            f"aloft study {found.path}"
        )
    run = chosen_run(runs, number)
    assert run.outcome is not None
    say(screen, f"run {number} of {len(runs)}: {labels_of(run)}")
    path = folder / "worst" / file_name(run)
    recorder = Recorder(path, on_warning=print_warning)
    result = run_again(run, [recorder])
    if result.run_hash != run.outcome.run_hash:
        print_warning("the run gave other bytes than in the study; something has changed since")
    kept = recorder.recording
    if kept is None:
        raise AloftError(recorder.problem)
    if recorder.problem:
        print_error(recorder.problem)
    say(screen, f"{result.reason}; recording: {kept}; to see it: {how_to_view(kept)}")
    if as_json:
        print_json(
            {"success": True, "reason": result.reason, "run": labels_of(run),
             "run_succeeded": result.success, "run_hash": result.run_hash,
             "same_bytes": result.run_hash == run.outcome.run_hash, "recording": str(kept),
             "recording_problem": recorder.problem or None}
        )  # fmt: skip
    if show:
        show_recording(kept)
    return code_with_recording(ExitCode.SUCCESS, recorder.problem)


def show_recording(path: Path) -> None:
    """Show the recording in a window until that is closed."""
    with TemporaryDirectory() as folder:
        drawn = Path(folder) / path.name
        draw(path, None, drawn)
        show(drawn, web=False)
