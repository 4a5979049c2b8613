"""Making runs: what is kept, what is not, and what is an error of the run itself."""

from collections.abc import Callable
from pathlib import Path

from aloft.studies.execution import Run, make_runs, run_pool
from aloft.studies.expansion import cells, checked_cells
from aloft.studies.journal import Journal, Outcome
from aloft.studies.study import Study

Read = Callable[[str], Study]
DEADLY = '''
import os
from counter import Counter


class Deadly(Counter):
    """Ends its process while a file says so."""

    def setup(self) -> None:
        if os.path.exists("deadly"):
            os._exit(7)
'''


def runs_of(found: Study) -> list[Run]:
    checked = checked_cells(cells(found), found, "code")
    return [Run(cell, seed) for cell in checked for seed in found.seeds]


def test_a_process_that_dies_is_an_error_now_and_tried_again_next_time(
    folder: Path, study: Read
) -> None:
    (folder / "deadly.py").write_text(DEADLY)
    graph = (folder / "count.yaml").read_text().replace("counter:Counter", "deadly:Deadly", 1)
    (folder / "count.yaml").write_text(graph)
    runs = runs_of(study("arms: {a: {}}\n"))[:1]
    (folder / "deadly").touch()
    with Journal(folder / "runs.jsonl") as journal, run_pool(1) as pool:
        (run,) = make_runs(runs, journal, pool)
        assert run.outcome is not None and not run.outcome.success
        assert "its process ended with exit code 7" in run.outcome.error
        assert journal.outcomes == {}
    (folder / "deadly").unlink()
    with Journal(folder / "runs.jsonl") as journal, run_pool(1) as pool:
        (run,) = make_runs(runs, journal, pool)
        assert run.outcome is not None and run.outcome.success
        assert len(journal.outcomes) == 1


def test_a_block_that_fails_is_an_outcome_and_kept(folder: Path, study: Read) -> None:
    runs = runs_of(study("set: {counter.fail_at: 3}\n"))
    heard: list[Outcome] = []
    with Journal(folder / "runs.jsonl") as journal, run_pool(1) as pool:
        done = make_runs([*runs, *runs], journal, pool, on_run=heard.append)
        assert len(journal.outcomes) == 3 == len(heard)  # the same run twice is one run
        again = make_runs(runs, journal, pool, on_run=heard.append)
    assert len(done) == 6 and again == done[:3] and len(heard) == 6
    for run in done:
        assert run.outcome is not None
        assert "the spring broke" in run.outcome.error == run.outcome.reason
        assert len(run.outcome.run_hash) == 32 and run.outcome.wall_time_s > 0
