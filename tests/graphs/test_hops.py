"""Jumps in a row in closed loop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.blocks.signals import Phase

GRAPHS = Path(aloft.__file__).parent / "graphs"


@pytest.mark.long
def test_ten_jumps_each_in_its_place() -> None:
    """In the standard trial; how often it succeeds is a study's matter (studies/sequences.yaml)."""
    run = aloft.load(GRAPHS / "hops.yaml", {"robot.seed": 0}).run()
    phases = run.signal("phase.phase.phase")
    begins = np.flatnonzero((phases[1:] == Phase.FLIGHT) & (phases[:-1] != Phase.FLIGHT))
    assert run.success, run.reason
    assert len(begins) == 10
    assert run.metrics["jumps"] == 10
    assert phases[-1] == Phase.RECOVER


@pytest.mark.long
def test_the_speed_changes_while_it_hops_on() -> None:
    """In the standard trial; how often it succeeds is a benchmark's matter (aloft bench hopping_on)."""
    twists = [{"ahead": 0.3}, {"at": 2.0, "ahead": 0.0}, {"at": 3.0, "ahead": 0.4}]
    sets = {"robot.seed": 0, "plan.jumps": 8, "score.jumps": 8, "speed.twists": twists}
    run = aloft.load("aloft:hopping/hop_on", sets).run()
    assert run.success, run.reason
    assert run.metrics["jumps"] == 8
    assert run.metrics["mean_length_error_m"] < 0.01
    places, numbers = run.signal("plan.goal.position")[:, 0], run.signal("plan.goal.number")
    ways = np.diff([0.0] + [places[numbers == n][-1] for n in range(1, 9)]) / 0.512
    assert ways == pytest.approx([0.3, 0.3, 0.3, 0.1, 0.0, 0.2, 0.4, 0.4], abs=1e-3)


def test_onto_a_platform_and_off_it_again(tmp_path: Path) -> None:
    """In the robust trial, without standing still on the platform."""
    path = tmp_path / "robust.yaml"
    path.write_text(
        f"include: [{GRAPHS / 'up_and_down'}.yaml, {GRAPHS / 'trials' / 'robust'}.yaml]\n"
    )
    result = aloft.load(path, {"robot.seed": 3}).run(log=False)
    assert result.success, result.reason
    assert result.metrics["jumps"] == 2
