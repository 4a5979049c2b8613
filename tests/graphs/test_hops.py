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


def test_onto_a_platform_and_off_it_again(tmp_path: Path) -> None:
    """In the robust trial, without standing still on the platform."""
    path = tmp_path / "robust.yaml"
    path.write_text(
        f"include: [{GRAPHS / 'up_and_down'}.yaml, {GRAPHS / 'trials' / 'robust'}.yaml]\n"
    )
    result = aloft.load(path, {"robot.seed": 3}).run(log=False)
    assert result.success, result.reason
    assert result.metrics["jumps"] == 2
