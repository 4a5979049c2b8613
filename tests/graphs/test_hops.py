"""Ten jumps in a row in closed loop."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import aloft
from aloft.blocks.signals import Phase

GRAPH = Path(aloft.__file__).parent / "graphs" / "hops.yaml"


def test_ten_jumps_without_a_fall() -> None:
    """The score also asks for the place of every landing, which drifts: see the known gaps."""
    run = aloft.load(GRAPH, {"robot.seed": 0}).run()
    phases = run.signal("phase.phase.phase")
    begins = np.flatnonzero((phases[1:] == Phase.FLIGHT) & (phases[:-1] != Phase.FLIGHT))
    assert len(begins) == 10
    assert run.metrics["jumps"] == 10
    assert phases[-1] == Phase.RECOVER
    assert run.metrics["peak_tilt_deg"] < 30.0
    assert run.signal("robot.truth.com")[-1, 2] > 0.3
