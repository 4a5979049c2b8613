"""Every task's graph: planned jumps in closed loop in the robust trial, one seed each.

How often they succeed is a study's matter (graphs/studies/tasks.yaml); here each shall not break.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import aloft
from aloft.runtime.loading import check

GRAPHS = Path(aloft.__file__).parent / "graphs"
TASKS = {
    "in_situ_15cm": ("apex_above_standing_m", 0.15, 0.015),
    "in_situ_18cm": ("apex_above_standing_m", 0.18, 0.018),
    "forward_15cm": ("jump_distance_x_m", 0.15, 0.02),
    "forward_25cm": ("jump_distance_x_m", 0.25, 0.02),
    "forward_38cm": ("jump_distance_x_m", 0.38, 0.02),
    "backward_12cm": ("jump_distance_x_m", -0.12, 0.02),
    "sideways_10cm": ("jump_distance_y_m", 0.10, 0.02),
    "sideways_15cm": ("jump_distance_y_m", 0.15, 0.02),
    "sideways_20cm": ("jump_distance_y_m", 0.20, 0.02),
    "turn_30deg": ("jump_yaw_deg", 30.0, 5.0),
    "turn_60deg": ("jump_yaw_deg", 60.0, 5.0),
    "up_5cm": ("jump_distance_x_m", 0.15, 0.02),
    "down_5cm": ("jump_distance_x_m", 0.15, 0.02),
    "up_8cm": ("jump_distance_x_m", 0.14, 0.02),
    "down_15cm": ("jump_distance_x_m", 0.20, 0.02),
}


@pytest.mark.long
@pytest.mark.parametrize("name", TASKS)
def test_it_succeeds_in_the_robust_trial(name: str, tmp_path: Path) -> None:
    path = tmp_path / "robust.yaml"
    path.write_text(f"include: [{GRAPHS / name}.yaml, {GRAPHS / 'trials' / 'robust'}.yaml]\n")
    result = aloft.load(path, {"robot.seed": 32}).run(log=False)
    assert result.success, result.reason
    metric, asked, tolerance = TASKS[name]
    assert result.metrics[metric] == pytest.approx(asked, abs=tolerance)


@pytest.mark.parametrize("name", [*TASKS, "forward_20cm"])
def test_the_graph_has_no_problems(name: str) -> None:
    assert check(GRAPHS / f"{name}.yaml").ok


SHORT = (
    "in_situ",
    "forward_10cm",
    "back_10cm",
    "side_10cm",
    "twist_30deg",
    "step_up_5cm",
    "step_down_5cm",
)


@pytest.mark.long
@pytest.mark.parametrize("name", SHORT)
def test_a_task_of_few_lines_lands_in_the_standard_trial(name: str) -> None:
    sets = {"plan.task": f"tasks/{name}.yaml", "robot.seed": 9032}
    result = aloft.load(GRAPHS / "jump.yaml", sets).run(log=False)
    assert result.success, result.reason


def test_no_number_serves_one_jump() -> None:
    """Graphs of single jumps say their task and nothing else: no gain and no correction."""
    for name in TASKS:
        lines = [x for x in (GRAPHS / f"{name}.yaml").read_text().splitlines() if x[0] != "#"]
        assert lines[0] == "include: [jump.yaml]"
        assert len(lines) == 2
        assert lines[1].startswith("set: {plan.task: tasks/")


@pytest.mark.parametrize("robot", ["bruce", "go2", "g1", "solo12"])
def test_each_robot_that_jumps_loads_in_the_trial_real(robot: str, tmp_path: Path) -> None:
    graph = GRAPHS / ("jump.yaml" if robot == "bruce" else f"robots/{robot}_jump.yaml")
    path = tmp_path / "real.yaml"
    path.write_text(f"include: [{graph}, {GRAPHS / 'trials' / 'real'}.yaml]\n")
    assert not check(path).problems
