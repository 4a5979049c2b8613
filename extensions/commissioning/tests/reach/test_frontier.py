"""The frontier with a stand-in for planner and simulator: what is tried, kept and told."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from aloft.extensions.commissioning.reach import frontier as module
from aloft.extensions.commissioning.reach.directions import DIRECTIONS, Direction
from aloft.extensions.commissioning.reach.search import PlanJob, RunJob, enough
from aloft.lab.benchmarks import frontier as bench
from aloft.lab.benchmarks.frontier import frontier
from aloft.lab.benchmarks.jumps.jumps import bruce_jumps
from aloft.studies.batch.jobs import JobResult, attempt
from aloft.studies.journal import Outcome

UP, BACK = DIRECTIONS[0], DIRECTIONS[2]


class StandIn:
    """Plans a rise of up to 26 cm with the recipe and 31 cm without margins; up to 23 cm every run
    lands, then all but that of seed 9001, and none from 25 cm on. Nothing goes back."""

    def __init__(self) -> None:
        self.plans: list[tuple[str, str]] = []
        self.runs: list[tuple[int, int]] = []

    def __call__(self, job: PlanJob | RunJob) -> Outcome | list[tuple[int, Outcome]]:
        cm = round(100.0 * (job.task.rise or 0.0))
        if isinstance(job, PlanJob):
            self.plans.append((job.task.name, job.near.name if job.near else ""))
            most = 31 if job.task.effort == 1.0 and "effort" in job.task.model_fields_set else 26
            if cm > most or job.task.distance_x:
                return Outcome(False, "motor speed", metrics={"cpu_s": 2.0})
            return Outcome(True, "", metrics={"cpu_s": 1.0, "binds": ["knee motor speed"]})
        done, failed, found = job.done, job.failed, []
        for seed in job.seeds:
            if enough(done, failed, job.of):
                break
            good = cm <= 23 or (cm == 24 and seed != 9001)
            self.runs.append((cm, seed))
            found.append((seed, Outcome(good, "" if good else f"fell at 1.{seed % 7} s")))
            done, failed = done + 1, failed + (not good)
        return found


def in_this_process(function, jobs, *, workers) -> Iterator[JobResult]:  # type: ignore[no-untyped-def]
    for index, job in enumerate(jobs):
        yield JobResult(index, *attempt(function, job))


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> StandIn:
    found = StandIn()
    monkeypatch.setattr(module, "do", found)
    monkeypatch.setattr(module, "job_results", in_this_process)
    return found


def told(folder: Path, way: Direction) -> dict[str, object]:
    found = json.loads((folder / "frontier.json").read_text())
    return next(each for each in found["directions"] if each["name"] == way.name)


def test_the_ends_and_why(stand_in: StandIn, tmp_path: Path) -> None:
    up, back = frontier(range(9000, 9004), tmp_path, [UP, BACK])
    assert (up.value, up.unit, up.ratio) == (23.0, "cm", pytest.approx(23 / 31))
    assert up.note == (
        "4 of 4 land, 95 % interval 0.51 to 1.00; planned 26, theory 31 (knee motor speed); "
        "24 fails: fell at 1.6 s"
    )
    found = told(tmp_path, UP)
    assert (found["planned"], found["refused"]) == (26.0, "motor speed")
    assert (found["theory"], found["theory_ended"]) == (31.0, True)
    assert found["fails_landed"] == [1, 2], "a first look stops at the first run that fails"
    assert [each["value"] for each in found["rungs"]] == [22.0, 23.0, 24.0, 25.0]
    assert (back.value, back.ratio) == (0.0, None)
    assert back.note.endswith("2.5 fails: no plan: motor speed")
    assert "<svg" in (tmp_path / "frontier.svg").read_text()


def test_the_theory_starts_from_the_plan_below(stand_in: StandIn, tmp_path: Path) -> None:
    frontier([9000], tmp_path, [UP])
    loosest = [plan for plan in stand_in.plans if plan[0].endswith("at most")]
    assert loosest[:2] == [("up 27 at most", "up 26"), ("up 28 at most", "up 27 at most")]
    assert all(near for _, near in loosest)


def test_a_rung_that_cannot_succeed_any_more_ends_early(stand_in: StandIn, tmp_path: Path) -> None:
    (up,) = frontier(range(9000, 9020), tmp_path, [UP])
    assert up.value == 24.0, "19 of 20 are 95 %"
    assert told(tmp_path, UP)["fails_landed"] == [0, 4]
    counts = {cm: [each for each, _ in stand_in.runs].count(cm) for cm in (22, 23, 24, 25, 26)}
    assert counts == {22: 20, 23: 20, 24: 20, 25: 4, 26: 4}


def test_what_is_kept_is_not_done_again(stand_in: StandIn, tmp_path: Path) -> None:
    first = frontier(range(9000, 9004), tmp_path, [UP])
    plans, runs = list(stand_in.plans), list(stand_in.runs)
    assert frontier(range(9000, 9004), tmp_path, [UP]) == first
    assert (stand_in.plans, stand_in.runs) == (plans, runs)
    frontier(range(9000, 9020), tmp_path, [UP])
    assert stand_in.plans == plans
    assert len(set(stand_in.runs)) == len(stand_in.runs), "more seeds go on from those"


def test_a_search_ends_when_its_time_is_spent(
    stand_in: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "FIRST_LOOK_CPU", 2.0)
    frontier([9000], tmp_path, [UP])
    found = told(tmp_path, UP)
    assert (found["planned"], found["planned_ended"]) == (23.0, False)
    assert (found["theory"], found["theory_ended"]) == (25.0, False)


def test_more_seeds_search_longer(
    stand_in: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "FIRST_LOOK_CPU", 2.0)
    frontier(range(9000, 9004), tmp_path, [UP])
    assert told(tmp_path, UP)["planned_ended"] is False
    frontier(range(9000, 9020), tmp_path, [UP])
    found = told(tmp_path, UP)
    assert (found["planned"], found["planned_ended"]) == (26.0, True)


def test_what_breaks_is_a_failure_with_its_error(
    stand_in: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(job: PlanJob | RunJob) -> object:
        if isinstance(job, PlanJob):
            return stand_in(job)
        raise LookupError("no such scene")

    monkeypatch.setattr(module, "do", broken)
    (up,) = frontier([9000, 9001], tmp_path, [UP])
    assert up.value == 0.0
    assert "broke: " in up.note and "no such scene" in up.note


def test_code_and_graph_are_part_of_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    one = module._Keys(bruce_jumps()).code
    monkeypatch.setattr(module, "code_fingerprint", lambda: "other")
    assert module._Keys(bruce_jumps()).code != one
