"""A study makes the same table on one or two processes of this machine and on a Dask cluster."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from pyarrow import parquet

from aloft.studies.execution import Run, make_runs, run_pool
from aloft.studies.expansion import cells, checked_cells
from aloft.studies.journal import Journal
from aloft.studies.reading import read_study
from aloft.studies.summary import make_table, write_table

from ..local_cluster import local_cluster
from ..needed import needs

needs("distributed")


@pytest.fixture
def cluster(folder: Path) -> Iterator[str]:
    """The address of a scheduler with two worker processes."""
    with local_cluster(folder) as address:
        yield address


@pytest.mark.long
def test_the_table_is_the_same_however_many_work(folder: Path, cluster: str) -> None:
    (folder / "study.yaml").write_text(
        "graph: count.yaml\nseeds: 0:6\narms: {a: {counter.goal: 104}, b: {counter.fail_at: 9}}\n"
    )
    found = read_study(Path("study.yaml"))
    checked = checked_cells(cells(found), found, "code")
    runs = [Run(cell, seed) for cell in checked for seed in found.seeds]
    files = []
    for name, workers, address in (("one", 1, ""), ("two", 2, ""), ("cluster", 1, cluster)):
        with (
            Journal(folder / name / "runs.jsonl") as journal,
            run_pool(workers, address) as pool,
        ):
            half = make_runs(runs[:5], journal, pool)
            done = [*half, *make_runs(runs[5:], journal, pool)]
            assert len(journal.outcomes) == 12
        assert [run.outcome.success for run in done if run.outcome] == 5 * [True] + 7 * [False]
        files.append(folder / name / "runs.parquet")
        write_table(files[-1], make_table(done).drop_columns(["wall_time_s"]))
    assert len({file.read_bytes() for file in files}) == 1
    hashes = parquet.read_table(files[0])["run_hash"].to_pylist()
    assert len(set(hashes)) == 12 and all(len(text) == 32 for text in hashes)
