"""The paper's push test: pushed in the air, the robot lands with the heuristic and falls without."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import aloft
from aloft.runtime.loading import check

PUSH = Path(aloft.__file__).parent / "graphs" / "push.yaml"


def test_the_graph_has_no_problems():
    assert check(PUSH).ok
    assert check(PUSH.with_name("push_12cm.yaml")).ok


@pytest.mark.parametrize(
    "angle",
    [0.0, *(pytest.param(angle, marks=pytest.mark.long) for angle in (np.pi, np.pi / 2.0))],
)
def test_a_push_in_the_air_is_landed(angle):
    """Straight back nine of ten land (studies/tasks.yaml), so one of three may fail."""
    failures = []
    for seed in (70, 71, 72):
        result = aloft.load(PUSH, {"robot.seed": seed, "push.angle": angle}).run(log=False)
        if not result.success:
            failures.append(result.reason)
    assert len(failures) <= (angle == np.pi), failures


STRONG = {"robot.seed": 70, "push.force": 100.0}
OFF = {"landing.law": "paper", "landing.w_l": [0.0, 0.0], "landing.w_c": 0.0}


def test_without_the_landing_heuristic_the_push_from_behind_ends_in_a_fall():
    assert aloft.load(PUSH, STRONG).run(log=False).success
    result = aloft.load(PUSH, STRONG | OFF | {"step.steps": 0}).run(log=False)
    assert not result.success
    assert result.metrics["peak_tilt_deg"] > 60.0


@pytest.mark.long
def test_steps_after_touchdown_keep_the_robot_from_that_fall():
    """Without steps it falls on all of these seeds; on seed 70 it falls with them, too."""
    stays = 0
    for seed in range(70, 75):
        metrics = aloft.load(PUSH, STRONG | OFF | {"robot.seed": seed}).run(log=False).metrics
        assert metrics["steps"] >= 1
        stays += metrics["peak_tilt_deg"] < 45.0 and metrics.get("final_tilt_deg", 90.0) < 5.0
    assert stays >= 4


@pytest.mark.long
def test_a_strong_push_aside_is_landed_as_feet_seek_the_ground_softly(tmp_path: Path):
    graph = tmp_path / "aside.yaml"
    files = [str(PUSH), str(PUSH.parent / "trials" / "robust.yaml")]
    graph.write_text(yaml.safe_dump({"include": files}))
    # with little cost of rolling, as a law that minds it more lands all of these
    push = {"push.force": 128.0, "push.angle": np.pi / 2.0, "landing.tilt_cost": [0.1, 0.3]}
    landed = {20.0: 0, 120.0: 0}
    for damping in landed:
        for seed in (9133, 9134, 9135, 9137):
            settings = push | {"robot.seed": seed, "step.seek_damping": damping}
            landed[damping] += aloft.load(graph, settings).run(log=False).success
    assert landed[20.0] >= 3 > landed[120.0]


@pytest.mark.long
def test_the_parametric_jump_goes_higher():
    """As the block's defaults touch down; for a push it lands leaning back, with straighter legs."""
    settings = {"robot.seed": 5, "push.force": 0.0, "plan.rise": 0.1, "score.peak_tilt": 0.26}
    settings |= {"plan.touchdown_drop": 0.009, "plan.touchdown_pitch": -0.06}
    result = aloft.load(PUSH, settings).run(log=False)
    assert result.success, result.reason
    assert result.metrics["apex_above_standing_m"] == pytest.approx(0.1, abs=0.008)
