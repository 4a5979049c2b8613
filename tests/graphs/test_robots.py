"""Robots that nobody here made: they stand, squat, take pushes and jump, with the controller of all.

How often they succeed is a study's matter (graphs/studies/robots.yaml); here none shall break.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import aloft
from aloft.robots.description import find_robot
from aloft.runtime.loading import check

GRAPHS = Path(aloft.__file__).parent / "graphs"
ROBOTS = ("go2", "g1", "solo12", "a1", "anymal_c", "hyq", "talos")
OF_EACH_KIND = ("go2", "g1", "solo12")
"""Those that `make test` has: a large and a small quadruped, and a humanoid. A stand takes a second."""
SQUATS = {"go2": 0.06, "g1": 0.12, "solo12": 0.05}
JUMPS = {
    "go2_jump": (0.10, 0.0),
    "go2_forward": (0.10, 0.20),
    "g1_jump": (0.05, 0.0),
    "g1_forward": (0.05, 0.08),
    "solo12_jump": (0.10, 0.0),
}
"""Every graph of a jump, with its apex above standing and how far ahead it lands [m]."""


@pytest.mark.parametrize(
    "robot",
    [pytest.param(one, marks=() if one in OF_EACH_KIND else pytest.mark.long) for one in ROBOTS],
)
def test_it_stands(robot: str) -> None:
    """The beginning of its graph: on its feet and still, in the robust trial."""
    short = {"score.judge_time": 0.34, "score.settle_time": 0.2, "push.speed_change": 0.0}
    result = aloft.load(GRAPHS / "robots" / f"{robot}_stand.yaml", short).run(0.36, log=False)
    assert result.success, result.reason
    assert result.metrics["qp_failures"] == 0
    assert result.metrics["safety_fault"] == "none"


@pytest.mark.parametrize("graph", JUMPS)
def test_a_jumps_graph_has_no_problems(graph: str) -> None:
    assert check(GRAPHS / "robots" / f"{graph}.yaml").ok


@pytest.mark.long
@pytest.mark.parametrize("robot", ROBOTS)
def test_it_takes_a_push(robot: str) -> None:
    graph = GRAPHS / "robots" / f"{robot}_stand.yaml"
    result = aloft.load(graph, {"robot.seed": 32}).run()
    assert result.success, result.reason
    impulse = result.signal("push.push.force")[:, 0].sum() / 500.0
    assert impulse == pytest.approx(0.1 * find_robot(robot).total_mass, rel=0.03)
    # The feet stay where they are, so the centre of mass gets only a part of the 0.1 m/s.
    assert result.signal("robot.truth.com_velocity")[:, 0].max() > 0.02


@pytest.mark.long
@pytest.mark.parametrize("robot", SQUATS)
def test_it_squats(robot: str) -> None:
    graph = GRAPHS / "robots" / f"{robot}_stand.yaml"
    changes = {"robot.seed": 32, "plan.squat_depth": SQUATS[robot], "push.speed_change": 0.0}
    result = aloft.load(graph, changes).run(log=False)
    assert result.success, result.reason


@pytest.mark.long
@pytest.mark.parametrize("graph", JUMPS)
def test_it_jumps(graph: str) -> None:
    apex, ahead = JUMPS[graph]
    result = aloft.load(GRAPHS / "robots" / f"{graph}.yaml", {"robot.seed": 32}).run(log=False)
    assert result.success, result.reason
    assert result.metrics["apex_above_standing_m"] == pytest.approx(apex, rel=0.1)
    assert result.metrics["jump_distance_x_m"] == pytest.approx(ahead, abs=0.02)
