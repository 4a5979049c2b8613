"""``aloft robot reach``: what is printed and written, with a stand-in for planner and simulator."""

from pathlib import Path
from typing import Any

import pytest
from tests.cli.conftest import run_for_json, run_here
from tests.cli.test_jump import STICKS

from aloft.extensions.commissioning.cli import robot_reach
from aloft.extensions.commissioning.reach import frontier
from aloft.extensions.commissioning.reach.search import PlanJob, RunJob
from aloft.studies.batch.jobs import JobResult, attempt
from aloft.studies.journal import Outcome


def stand_in(job: PlanJob | RunJob) -> Outcome | list[tuple[int, Outcome]]:
    """Plans what rises by up to 20 cm; all of it lands."""
    if isinstance(job, RunJob):
        assert job.graph.robot.endswith("bruce.yaml")
        assert any(key.startswith("robot.sensors.") for key in job.graph.settings), "of its trial"
        return [(seed, Outcome(True, "")) for seed in job.seeds]
    good = (job.task.rise or 0.0) < 0.201
    return Outcome(good, "" if good else "motor torque", metrics={"cpu_s": 1.0, "binds": ["knee"]})


def in_this_process(function: Any, jobs: Any, *, workers: int) -> Any:
    assert workers == 1
    for index, job in enumerate(jobs):
        yield JobResult(index, *attempt(function, job))


@pytest.mark.long
def test_a_table_a_picture_and_figures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(frontier, "do", stand_in)
    monkeypatch.setattr(frontier, "job_results", in_this_process)
    monkeypatch.setattr(robot_reach, "compile_functions", lambda *_: None)
    words = ("robot", "reach", "bruce", "--seeds", "5,6", "--workers", "1")
    found = run_for_json(*words)
    assert (found["success"], found["seeds"]) == (True, [5, 6])
    up = found["directions"][0]
    assert (up["reached"], up["landed"], up["planned"]) == (20.0, 2, 20.0)
    assert Path(found["picture"]).read_text().count("<svg") == 1
    assert Path(found["picture_png"]).read_bytes().startswith(b"\x89PNG")
    assert up["planned_binds"] == "knee" and found["minutes"] == 10.0 and not found["ended"]
    assert (tmp_path / "results" / "reach" / "bruce" / "reach.json").is_file()
    text = run_here(*words).stdout
    row = next(line for line in text.splitlines() if line.startswith(" up "))
    assert row.split()[:7] == ["up", "20", "cm", "20", "cm", "20", "cm"]
    assert "up 21 cm: no plan (motor torque)" in text, "progress is said"
    little = run_here(*words, "--minutes", "0.5", "--out", "little").stdout
    row = next(line for line in little.splitlines() if line.startswith(" up "))
    assert row.split()[3].endswith("+") and "--minutes gives more" in little


def test_what_cannot_jump_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stick.xml").write_text(STICKS.replace("<freejoint/>", ""))
    found = run_for_json("robot", "reach", "stick.xml", code=2)
    assert found["reason"].startswith("sticks cannot jump: its base is fixed")
