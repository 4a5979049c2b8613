"""The rows of robots as a bench finds them are complete, and a robot that learns has its lessons."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from aloft.benchmarks.jumps import real_robot
from aloft.benchmarks.jumps.real_robot import SERIES, RobotJob, graph_of, jumps_of
from aloft.studies.batch.jobs import JobResult


def alone(function: Callable[[Any], Any], jobs: Iterable[Any]) -> Iterator[JobResult]:
    """All jobs in this process, where what is replaced here is seen."""
    for index, job in enumerate(jobs):
        yield JobResult(index, function(job))


def test_what_is_told_changes_the_controller_and_not_the_robot() -> None:
    task = SERIES["in place 12 cm"]
    untold, told = (
        graph_of(RobotJob(97000, told, False), task, 1).checked for told in ("nothing", "draws")
    )
    assert untold.block("timing").params != told.block("timing").params
    for field in ("imu", "motors", "encoders", "joints", "links", "seed", "noise_seed"):
        a, b = (getattr(each.block("robot").params, field) for each in (untold, told))
        assert a == b


@pytest.mark.long
def test_the_rows_are_complete(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(real_robot, "TIMES", 2)
    monkeypatch.setattr(real_robot, "LADDER", ({"rise": 0.05},))
    monkeypatch.setattr(real_robot, "SERIES", {"in place 12 cm": {"rise": 0.12}})
    monkeypatch.setattr(real_robot, "job_results", alone)
    monkeypatch.chdir(tmp_path)
    rows = real_robot.real_robot(range(97000, 97001))
    assert len(rows) == 5
    assert all(row.value in (0.0, 1.0) for row in rows)
    assert "jumps 1 to 2: " in rows[-1].note


@pytest.mark.long
def test_the_same_robot_makes_the_same_jumps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_robot, "SERIES", {"in place 12 cm": {"rise": 0.12}})
    job = RobotJob(97000, "draws", True)
    assert jumps_of(job) == jumps_of(job)
