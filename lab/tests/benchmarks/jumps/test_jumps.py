"""Random jumps in closed loop: what is planned, run, kept, and how it is told."""

import json
import math
from pathlib import Path

import pytest

from aloft.lab.benchmarks.jumps import jumps as module
from aloft.lab.benchmarks.jumps.jumps import jumps, plan_and_run, run_once
from aloft.planner.task.task import JumpTask, make_task
from aloft.studies.journal import Outcome


def in_this_process(function, jobs):  # type: ignore[no-untyped-def]
    from aloft.studies.batch.jobs import JobResult, attempt

    for index, job in enumerate(jobs):
        yield JobResult(index, *attempt(function, job))


@pytest.fixture
def outcomes(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two tasks, one of which has no plan, with a stand-in for the planner and the simulator."""
    asked: list[str] = []

    def stand_in(job: module.JumpJob) -> list[tuple[str, Outcome]]:
        asked.append(job.task.name)
        if job.task.name == "high":
            return [("", Outcome(False, "motor speed", metrics={"cpu_s": 3.0}))]
        return [("", Outcome(True, "", metrics={"cpu_s": 1.0}))] + [
            (module.run_key(job.trial, job.push, seed), Outcome(seed != 9002, "fell"))
            for seed in job.seeds
        ]

    tasks = [make_task({"name": "low", "rise": 0.1}), make_task({"name": "high", "rise": 0.9})]
    monkeypatch.setattr(module, "random_tasks", lambda count, seed, harder: tasks)
    monkeypatch.setattr(module, "plan_and_run", stand_in)
    monkeypatch.setattr(module, "job_results", in_this_process)
    monkeypatch.setattr(module, "compile_functions", lambda tasks, robot: 9.0)
    return asked


def test_the_rows_tell_what_is_refused_and_what_lands(outcomes: list[str], tmp_path: Path) -> None:
    refused, median, most, worst, compiling, landing = jumps(2, 1, range(9000, 9004), tmp_path)
    assert refused.value == 0.5
    assert refused.note == "2 tasks of seed 1; refused: high (motor speed)"
    assert (median.value, worst.value, worst.met) == (2.0, 3.0, True)
    assert most.value == pytest.approx(2.9)
    assert compiling.value == 9.0
    assert landing.value == 0.25
    assert landing.met is False
    assert landing.note.startswith("3 of 4 runs land, 95 % interval 0.301 to 0.954")
    assert landing.note.endswith("failures by task: low: 1")


def test_what_is_kept_is_not_run_again(outcomes: list[str], tmp_path: Path) -> None:
    jumps(2, 1, range(9000, 9002), tmp_path)
    assert outcomes == ["low", "high"]
    again = jumps(2, 1, range(9000, 9003), tmp_path)
    assert outcomes == ["low", "high", "low"]
    assert again[-1].value == pytest.approx(1 / 3)
    lines = (tmp_path / "runs.jsonl").read_text().splitlines()
    assert len({json.loads(line)["key"] for line in lines}) == 2 + 3


def test_another_trial_and_a_push_are_runs_of_their_own(
    outcomes: list[str], tmp_path: Path
) -> None:
    jumps(2, 1, range(9000, 9002), tmp_path)
    uneven = jumps(2, 1, range(9000, 9002), tmp_path, trial="uneven")
    pushed = jumps(2, 1, range(9000, 9002), tmp_path, push=0.5)
    assert outcomes == ["low", "high", "low", "low"]
    assert ", uneven trial" in uneven[-1].note
    assert ", robust trial, pushed by 0.5 N s" in pushed[-1].note


def test_a_push_is_drawn_within_the_flight_and_always_the_same() -> None:
    task = make_task({"name": "low", "rise": 0.1, "landing_height": -0.1, "distance_x": 0.2})
    job = module.JumpJob(task, (), Path(), False, push=0.5)
    drawn = [module.pushed_jumps(job, seed).settings for seed in range(30)]
    delays = [each["push.delay"] for each in drawn]
    flight = math.sqrt(0.2 / 9.81) + math.sqrt(0.4 / 9.81)
    assert 0.0 < min(delays) < 0.1 * flight and 0.7 * flight < max(delays) < 0.9 * flight
    assert len({each["push.angle"] for each in drawn}) == 30
    assert drawn[0]["push.force"] == 50.0
    assert module.pushed_jumps(job, 3).settings == drawn[3]


def test_a_task_without_a_plan_says_what_binds(tmp_path: Path) -> None:
    task = make_task({"name": "odd", "rise": 0.1, "distance_x": 0.03, "landing_height": 0.05})
    (found,) = plan_and_run(module.JumpJob(task, (9000,), tmp_path, False))
    assert (found[1].success, found[1].reason) == (False, "contradicts itself")


@pytest.mark.long
def test_a_random_jump_lands(tmp_path: Path) -> None:
    task: JumpTask = make_task({"name": "hop", "rise": 0.1, "distance_x": 0.05})
    job = module.JumpJob(task, (9000,), tmp_path, False)
    (plan, run) = plan_and_run(job)
    assert plan[1].success and run[1].success, run[1].reason
    assert run_once(job, 9000).run_hash == run[1].run_hash
