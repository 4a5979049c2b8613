"""The runs of a study: checked, made with a progress bar, and reported when they are stopped."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

from ...runtime.language.errors import ExitCode
from ..shared.output import print_json, print_warning, say
from ..shared.stopping import stopped_by_signals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from ...studies.execution import Run
    from ...studies.expansion import Cell
    from ...studies.journal import Journal, Outcome
    from ...studies.study import Study


def check_cells(found: Study, expanded: Sequence[Cell], screen: Console) -> list[Cell]:
    """The cells, after each was checked as ``aloft check`` checks a graph."""
    from ...studies.expansion import checked_cells
    from ...studies.fingerprint import code_fingerprint
    from ..shared.progress import progress_bar

    with progress_bar(screen, f"checking {len(expanded)} cells", len(expanded)) as (bar, task):
        return checked_cells(expanded, found, code_fingerprint(), lambda: bar.advance(task))


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
    from ...studies.execution import make_runs
    from ..shared.progress import progress_bar

    successes = 0
    keys = {run.key for run in runs}
    known = len(keys & journal.outcomes.keys())
    if known:
        say(screen, f"{known} of {len(keys)} runs were made before")
    with (
        stopped_by_signals() as received,
        progress_bar(screen, text, len(keys)) as (bar, task),
    ):

        def on_run(outcome: Outcome) -> None:
            nonlocal successes
            successes += outcome.success
            bar.update(task, advance=1, description=f"{text}: {successes} succeeded")

        return make_runs(runs, journal, workers=workers, cluster=cluster, on_run=on_run)
    return received[0]


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
