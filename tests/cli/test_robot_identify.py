"""``aloft robot identify`` finds what was injected in the simulator, within the uncertainty it states."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import aloft
from aloft.cli.app import make_app
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.run_result import RunResult

GRAPHS = Path(aloft.__file__).parent / "graphs"
INJECTED: dict[str, Any] = {
    "robot.seed": 5, "robot.mass_scale": 1.08, "robot.joint_friction": 1.6,
    "robot.latency": "4 ms", "robot.base_com_offset": ["4 mm", "0 mm", "0 mm"],
}  # fmt: skip


def identify(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), ["robot", "identify", *arguments])


def miss(result: RunResult) -> float:
    """How far [m] a jump in place has landed from where it began."""
    return math.hypot(result.metrics["jump_distance_x_m"], result.metrics["jump_distance_y_m"])


def apex_error(result: RunResult) -> float:
    """By how much [m] the apex was not the planned one."""
    found = result.metrics
    return abs(found["apex_above_standing_m"] - found["planned_apex_above_standing_m"])


@pytest.mark.long
def test_what_was_injected_is_found_and_makes_the_jump_better(tmp_path: Path) -> None:
    run = aloft.load(GRAPHS / "jump.yaml", INJECTED).run()
    aloft.write_recording(tmp_path / "heavy.rrd", run)
    result = identify(str(tmp_path / "heavy.rrd"), "--json", "--out", str(tmp_path / "found.yaml"))
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)

    def close(value: dict[str, float], truth: float, largest: float) -> None:
        assert abs(value["value"] - truth) < 3.0 * value["std"], (value, truth)
        assert value["std"] < largest

    body = found["body"]
    close(body["mass"], 1.08 * 5.118, 0.05)
    for offset, truth in zip(body["com_offset"], (0.004, 0.0, 0.0), strict=True):
        close(offset, truth, 0.004)
    assert len(body["coulomb"]) == 6 and "right_hip_yaw" in body["resting"]
    for value in body["coulomb"].values():
        close(value, 1.6 * 0.07, 0.06)
    for value in body["viscous"].values():
        close(value, 1.6 * 0.01, 0.05)
    mean = np.mean([value["value"] for value in body["coulomb"].values()])
    assert mean == pytest.approx(1.6 * 0.07, rel=0.15), "and not what the description says"
    before = aloft.load(GRAPHS / "jump.yaml", {"robot.seed": 5})
    assert float(before.run(duration=1.0).metrics["delay_measured_ms"]) + 2.0 == pytest.approx(
        1e3 * found["delay"]["delay"]["value"], abs=3e3 * found["delay"]["delay"]["std"]
    )

    again = tmp_path / "again.yaml"
    again.write_text(f"include: [{GRAPHS / 'jump.yaml'}, found.yaml]\n")
    landed = Executor(aloft.load(again, INJECTED).checked, log=False).run()
    assert landed.success, landed.reason
    assert miss(landed) < miss(run), "it lands nearer to its place"
    assert apex_error(landed) < 0.5 * apex_error(run), "it jumps as high as planned"
    assert landed.metrics["peak_tilt_deg"] < 0.7 * run.metrics["peak_tilt_deg"], "it tilts less"


def test_a_recording_that_does_not_tell_it_is_refused(tmp_path: Path) -> None:
    short = aloft.load(GRAPHS / "jump.yaml").run(duration=0.1)
    aloft.write_recording(tmp_path / "short.rrd", short)
    result = identify(str(tmp_path / "short.rrd"))
    assert result.exit_code != 0
    assert "ticks with moving joints and steady contacts; 160 are needed" in result.output
    result = identify(str(tmp_path / "short.rrd"), "--base", "pilot.base")
    assert result.exit_code != 0
    assert "no signal 'pilot.base.orientation'; the nearest are" in result.output
    assert "--robot, --base and --command say which blocks to read" in result.output
    result = identify(str(tmp_path / "nothing.rrd"))
    assert result.exit_code != 0 and "there is no such file" in result.output
