"""Landings on ground that nobody is told of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import aloft

GRAPHS = Path(aloft.__file__).parent / "graphs"
LEFT_FOOT_HIGHER = {"x": [0.1, 1], "y": [0, 0.75], "top": "2 cm"}
HEELS_HIGHER = {"x": [0.1, 0.2], "top": "1 cm"}
EDGE = {"x": [0.2, 1], "top": "1 cm"}
"""Its edge is under the middle of the soles."""


def land(folder: Path, box: dict[str, object], **sets: object) -> aloft.RunResult:
    """The jump 20 cm ahead in the robust trial onto a level floor with a box."""
    files = ["jump.yaml", "trials/robust.yaml"]
    graph = {
        "include": [str(GRAPHS / file) for file in files],
        "set": {
            "plan.task": {"rise": "12 cm", "distance_x": "20 cm"},
            "robot.ground.scene": {"uneven": box["top"], "boxes": [box]},
            "robot.seed": 98001,
            **sets,
        },
    }
    (folder / "jump.yaml").write_text(yaml.safe_dump(graph))
    return aloft.load(folder / "jump.yaml").run()


def test_a_foot_that_has_not_touched_goes_on_down_and_does_not_turn_the_torso(
    tmp_path: Path,
) -> None:
    result = land(tmp_path, LEFT_FOOT_HIGHER)
    assert result.success, result.reason
    assert result.metrics["peak_tilt_deg"] < 14.0


@pytest.mark.long
def test_a_slope_that_the_task_knows_is_the_scenes_and_is_landed_on(tmp_path: Path) -> None:
    task = {"rise": "12 cm", "distance_x": "20 cm", "landing_slope": ["12 deg", 0]}
    files = [str(GRAPHS / file) for file in ("jump.yaml", "trials/robust.yaml")]
    told = {"include": files, "set": {"plan.task": task, "robot.seed": 500}}
    (tmp_path / "told.yaml").write_text(yaml.safe_dump(told))
    result = aloft.load(tmp_path / "told.yaml").run()
    assert result.success, result.reason
    heights = result.signal("robot.truth.ground_height")[-1]
    assert np.ptp(heights) == pytest.approx(0.0833 * np.sin(np.radians(12.0)), abs=2e-3)


@pytest.mark.long
def test_soles_across_an_edge_stand_by_their_load(tmp_path: Path) -> None:
    result = land(tmp_path, HEELS_HIGHER)
    assert result.success, result.reason
    assert result.metrics["robot_sole_contacts"] > 1000
    switches = result.signal("contacts.state.active")[-500:]
    contacts = result.signal("load.contacts.active")[-500:]
    assert contacts.all(), "all points count"
    assert not switches.all(), "though not all have contact"


@pytest.mark.long
def test_soles_that_tip_over_an_edge_stand_where_they_come_to_rest(tmp_path: Path) -> None:
    result = land(tmp_path, EDGE)
    assert result.success, result.reason
    assert result.metrics["steps"] == 0
    without = land(tmp_path, EDGE, **{"load.flat_height": 0.0})
    assert not without.success


@pytest.mark.long
@pytest.mark.parametrize(
    ("box", "sets"),
    [
        (LEFT_FOOT_HIGHER, {"step.seek_speed": 0.0}),
        (
            HEELS_HIGHER,
            {
                "estimator.level_ground": True,
                "load.flat_height": 0.0,
                "wbc.stand.torso_feedforward": 0.0,
            },
        ),
    ],
)
def test_without_that_the_robot_falls(
    tmp_path: Path, box: dict[str, object], sets: dict[str, object]
) -> None:
    assert not land(tmp_path, box, **sets).success
