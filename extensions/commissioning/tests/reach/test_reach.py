"""Any robot's directions at its size, and its reach with a stand-in for planner and simulator."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.robots.example_robots import needs_robots

from aloft.extensions.commissioning.reach import frontier
from aloft.extensions.commissioning.reach.charts import save_reach_chart
from aloft.extensions.commissioning.reach.directions import (
    JumpSizes,
    leg_length,
    round_length,
    single_directions,
    sizes_of,
)
from aloft.extensions.commissioning.reach.reach import bruce_reach, reach
from aloft.extensions.commissioning.reach.search import JumpGraph, PlanJob, RunJob
from aloft.planner.task.read_task import require_consistent
from aloft.planner.task.task import JumpTask
from aloft.robots.description import find_robot
from aloft.robots.robot_description import RobotDescription
from aloft.studies.batch.jobs import JobResult, attempt
from aloft.studies.journal import Outcome


@pytest.fixture(scope="module")
def bruce() -> RobotDescription:
    return find_robot("bruce")


def test_legs_are_as_long_as_thigh_and_shank(bruce: RobotDescription) -> None:
    assert leg_length(bruce) == pytest.approx(0.3445)
    fixed = bruce.changed(feet=(), contacts=())
    with pytest.raises(ValueError, match="bruce has no feet"):
        leg_length(fixed)


def test_lengths_are_round() -> None:
    assert [round_length(x) for x in (0.0098, 0.0125, 0.0646, 0.95)] == [0.01, 0.015, 0.06, 1.0]


def test_bruce_s_own_sizes_are_the_usual_ones(bruce: RobotDescription) -> None:
    assert sizes_of(bruce, bruce, 0.30) == JumpSizes()
    assert sizes_of(bruce, bruce, 0.10).rise == 0.05, "half of what can be planned"


@needs_robots
@pytest.mark.parametrize("name", ["go2", "g1"])
def test_other_robots_jump_clear_of_a_step(bruce: RobotDescription, name: str) -> None:
    robot = find_robot(name)
    sizes = sizes_of(robot, bruce, 0.30)
    assert sizes.scale == pytest.approx(leg_length(robot) / leg_length(bruce))
    for way in single_directions(sizes, robot.name):
        require_consistent(way.task(way.start), robot)
        assert way.task(1).robot == name
    for length, edge in ((sizes.onto, sizes.onto_edge), (sizes.off, sizes.off_edge)):
        assert edge is not None
        assert 0.0 < edge < length
    if name == "go2":  # its knees reach behind its feet
        assert sizes.off_edge is not None
        assert sizes.off_edge < 0.4 * sizes.off


class StandIn:
    """Plans a rise of up to 20 cm, and 25 cm with all of the motors, and up to 30 cm ahead; nothing else. Up to
    a rise of 15 cm all runs land."""

    def __init__(self) -> None:
        self.near: list[tuple[str, str]] = []

    def __call__(self, job: PlanJob | RunJob) -> Outcome | list[tuple[int, Outcome]]:
        if isinstance(job, RunJob):
            good = (job.task.rise or 0.0) < 0.151
            spent = {"cpu_s": 5.0}
            return [(seed, Outcome(good, "" if good else "fell", "", spent)) for seed in job.seeds]
        self.near.append((job.task.name, job.near.name if job.near else ""))
        if not possible(job.task):
            return Outcome(False, "motor torque", metrics={"cpu_s": 2.0})
        return Outcome(True, "", metrics={"cpu_s": 1.0, "binds": ["knee motor torque"]})


def possible(task: JumpTask) -> bool:
    """What the stand-in plans."""
    most = 0.251 if "effort" in task.model_fields_set else 0.201
    elsewhere = task.distance_y or task.twist or task.landing_height
    return (task.rise or 0.0) < most and 0.0 <= (task.distance_x or 0.0) < 0.301 and not elsewhere


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> StandIn:
    found = StandIn()

    def in_this_process(function, jobs, *, workers):  # type: ignore[no-untyped-def]
        for index, job in enumerate(jobs):
            yield JobResult(index, *attempt(function, job))

    monkeypatch.setattr(frontier, "do", found)
    monkeypatch.setattr(frontier, "job_results", in_this_process)
    return found


def test_a_robot_s_reach(bruce: RobotDescription, stand_in: StandIn, tmp_path: Path) -> None:
    from aloft.planner.library.library import shipped_folder

    lines: list[str] = []
    graph = JumpGraph("bruce", shipped_folder() / "jump.yaml", {})
    found = reach(bruce, graph, tmp_path, seeds=(1, 2), progress=lines.append)
    ends = {each["name"]: (each["reached"], each["planned"], each["theory"])
            for each in found["directions"]}  # fmt: skip
    assert ends["up"] == (15.0, 20.0, 25.0)
    assert ends["ahead"] == (30.0, 30.0, 30.0)
    assert ends["aside"] == (0.0, 0.0, 0.0)
    ahead = next(each for each in found["directions"] if each["name"] == "ahead")
    assert ahead["what"] == "the distance; rise 10 cm", "half of the 20 cm that can be planned"
    assert ahead["in_legs"]["reached"] == pytest.approx(0.30 / 0.3445, abs=1e-4)
    assert "up 15 cm: 2 of 2 land" in lines and "up 21 cm: no plan (motor torque)" in lines
    assert stand_in.near[0] == ("up 11", ""), "half of where BRUCE's search begins"
    assert found["ended"] == []
    drawn, pixels = save_reach_chart(found, bruce_reach(), tmp_path)
    chart = drawn.read_text()
    assert 'id="reached-0"' in chart and 'id="beside-reached-0"' in chart
    assert "15 / 20 / 25 cm" in chart and pixels.read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_when_the_time_runs_out_the_best_so_far_is_told(
    bruce: RobotDescription, stand_in: StandIn, tmp_path: Path
) -> None:
    """Plans take 1 s and runs 5 s each: after some of each along every direction no more are begun."""
    from aloft.planner.library.library import shipped_folder

    graph = JumpGraph("bruce", shipped_folder() / "jump.yaml", {})
    found = reach(bruce, graph, tmp_path, seeds=(1, 2), minutes=0.5)
    up = found["directions"][0]
    assert 0.0 < up["planned"] < 20.0 and not up["planned_ended"]
    assert "up, planned" in found["ended"]
    found = reach(bruce, graph, tmp_path, seeds=(1, 2), minutes=3.0)
    up = found["directions"][0]
    assert (up["planned"], up["planned_ended"]) == (20.0, True), "it goes on from there"
    assert 0.0 < up["reached"] < 15.0 and not up["reached_ended"]
    assert found["cpu_s"] == sum(sum(each["cpu_s"].values()) for each in found["directions"])
    chart = save_reach_chart(found, bruce_reach(), tmp_path)[0].read_text()
    assert f"{up['reached']:g}+ / {up['planned']:g} /" in chart
    more = reach(bruce, graph, tmp_path, seeds=(1, 2), minutes=10.0)["directions"][0]
    assert (more["reached"], more["planned"], more["planned_ended"]) == (15.0, 20.0, True)


def test_bruce_s_own_reach_has_every_direction() -> None:
    names = [each["name"] for each in bruce_reach()["directions"]]
    assert names == [way.name for way in single_directions()]
