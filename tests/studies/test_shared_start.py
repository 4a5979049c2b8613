"""Runs that share their beginning: the same bytes as whole runs, what cannot share, what is refused."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import aloft
from aloft.extensions.analysis.studies.falsification import searched_cells
from aloft.runtime.running.run_result import RunResult
from aloft.studies import shared_start
from aloft.studies.execution import outcome_of, run_job
from aloft.studies.expansion import Job, job, seeded_graph
from aloft.studies.reading import read_study
from aloft.studies.shared_start import SharedStart, shared_result
from aloft.studies.study import Study
from aloft.studies.tuning import draw_runs

GRAPHS = Path(aloft.__file__).parent / "graphs"
GRAPH = """
rate: 100 Hz
duration: 1 s
blocks:
  step: {use: blocks.Step, with: {at: 0.5 s}}
  noise: {use: blocks.WhiteNoise, with: {std: 0.1, seed: 3}}
  gain: {use: blocks.Gain, with: {gain: 2}, in: {u: step.y}}
  sum: {use: blocks.Sum, in: {a: gain.y, b: noise.y}}
  double: {use: blocks.Gain, with: {gain: 2}, in: {u: sum.y}}
"""


@pytest.fixture(autouse=True)
def none_kept() -> Iterator[None]:
    shared_start._kept.clear()
    yield
    for each in shared_start._kept.values():
        if each is not None:
            each.close()
    shared_start._kept.clear()


def a_job(folder: Path, drawn: Mapping[str, Any], text: str = GRAPH) -> Job:
    path = folder / "graph.yaml"
    path.write_text(text)
    return Job(str(path), (), str(folder / "study.yaml"), {}, 5, (), drawn)


def told(result: RunResult | None) -> Any:
    assert result is not None
    return replace(outcome_of(result), wall_time_s=0.0)


def test_a_run_begins_where_it_first_differs_and_has_the_bytes_of_a_whole_one(
    tmp_path: Path,
) -> None:
    shared_result(a_job(tmp_path, {"gain.gain": 3}))  # made both ways
    (shared,) = shared_start._kept.values()
    assert shared is not None
    hashes = []
    for gain in (0.5, 7, 2):
        work = a_job(tmp_path, {"gain.gain": gain})
        result = shared_result(work)
        assert told(result) == told(seeded_graph(work).run(log=False))
        assert shared.skipped == (50 if gain != 2 else 90)  # the gain of the file differs nowhere
        hashes.append(result.run_hash if result is not None else "")
    assert len({*hashes}) == 3
    # what has an effect from the first tick on shares only what was loaded
    work = a_job(tmp_path, {"double.gain": 3})
    assert told(shared_result(work)) == told(seeded_graph(work).run(log=False))
    assert [each.skipped for each in shared_start._kept.values() if each] == [90, 0]


def test_only_draws_of_live_parameters_share(tmp_path: Path) -> None:
    for drawn in ({}, {"step.at": 0.4}, {"duration": 2}, {"nobody.gain": 1}, {"gain.gian": 1}):
        assert shared_result(a_job(tmp_path, drawn)) is None
    work = a_job(tmp_path, {"gain.gain": 2})
    assert shared_result(work) is not None
    wrong = replace(work, drawn={"gain.gain": "three"})
    assert shared_result(wrong) is None
    assert "gain" in run_job(wrong).error  # the whole run says what is wrong
    # one is there already
    many = [replace(work, seed=seed) for seed in range(6, shared_start.MOST + 7)]
    assert [shared_result(each) is None for each in many][-4:] == [False, False, True, True]


def test_a_run_that_breaks_is_made_whole(tmp_path: Path) -> None:
    work = a_job(tmp_path, {"gain.gain": 2})
    assert shared_result(work) is not None
    text = GRAPH.replace("{gain: 2}, in: {u: sum.y}", "{gain: 1.0e+10}, in: {u: sum.y}")
    broken = a_job(tmp_path, {"gain.gain": 1e308}, text)
    assert shared_result(broken) is None
    outcome = run_job(broken)
    assert "not finite at tick 50" in outcome.error


def test_a_graph_that_does_not_repeat_itself_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = a_job(tmp_path, {"gain.gain": 3})
    real = SharedStart.run

    def other(self: SharedStart, changes: Mapping[str, Any]) -> RunResult:
        return replace(real(self, changes), run_hash="something else")

    monkeypatch.setattr(SharedStart, "run", other)
    whole = seeded_graph(work).run(log=False)
    assert told(shared_result(work)) == told(whole)
    assert shared_result(work) is None and list(shared_start._kept.values()) == [None]


@pytest.mark.long
@pytest.mark.parametrize(
    ("drawn", "begins"),
    [
        ({"push.force": "31 N", "push.angle": "200 deg", "push.delay": "0.1 s"}, 500),
        ({"landing.w_k": [0.1, 0.1], "step.margin": "5 mm"}, 0),
        ({"wbc.landing.torso_weight": [3.0, 3.0, 4.0]}, 500),
    ],
)
def test_jumps_share_all_before_the_push(drawn: Mapping[str, Any], begins: int) -> None:
    study: Study = read_study(GRAPHS / "studies" / "worst_push_12cm.yaml")
    (cell,) = searched_cells(study)
    (run,) = draw_runs(drawn, "here", [cell], [9500])
    shared_result(job(run.cell, 9500))
    shared = next(iter(shared_start._kept.values()))
    assert shared is not None, "the whole run had other bytes"
    again = shared_result(job(run.cell, 9500))
    assert told(again) == told(seeded_graph(job(run.cell, 9500)).run(log=False))
    assert shared.skipped >= begins, shared.skipped
