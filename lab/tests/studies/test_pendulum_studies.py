"""Drawn robots lie within the intervals of their fits; a real pendubot's swing-up and the simulator's show the same chatter."""

from __future__ import annotations

import numpy as np
import pytest
from tests.shared_data import needs_pendulum

from aloft.lab.studies import swing_up
from aloft.lab.studies.identified_robots import NINETY, coverage


@pytest.mark.long
def test_intervals_hold_for_robots_that_were_drawn():
    errors = np.concatenate([np.array(each) for each in coverage(4, seed=1).values()])
    assert np.mean(np.abs(errors) < NINETY) > 0.8


@needs_pendulum
def test_the_log_is_of_the_lqr_at_the_top():
    found = swing_up.figures(*swing_up.measured())
    assert found["changes"] == pytest.approx(27.7, abs=0.1)
    assert found["sway"] == pytest.approx([0.134, 0.179], abs=1e-3)
    assert found["apart"] == pytest.approx([0.0, 0.0], abs=1e-9)


@needs_pendulum
@pytest.mark.long
def test_the_controller_is_the_logs():
    assert swing_up.weights_of("lqr")[1] == pytest.approx(0.024)
    _, pushed = swing_up.linear(swing_up.TOPMOST, 0.0)
    gains = pushed.T @ swing_up.value_at_the_top() / swing_up.weights_of("lqr")[1]
    assert gains[0] == pytest.approx(np.loadtxt(swing_up.FOLDER / "lqr_controller_Kmatrix.txt")[0])
    left = {stiff: swing_up.torque_unexplained(stiff) for stiff in (False, True)}
    assert left[False] < 0.06 and left[True] > 0.9, "the log has a standard deviation of 1.1 N m"


@needs_pendulum
@pytest.mark.long
def test_the_simulator_follows_the_swing_up_and_chatters_at_the_top():
    found = swing_up.simulated(swing_up.EFFECTS["latency 8 ms"], 12.0)
    assert not found["fell"]
    assert (found["apart"] < [0.15, 0.18]).all(), "what the simulator was to reach"
    assert (found["rise"] < [0.06, 0.09]).all()
    assert found["changes"] == pytest.approx(27.7, abs=2.5)
    quiet = swing_up.simulated(swing_up.EFFECTS["stiff: friction and rotors"], 10.0)
    assert not quiet["fell"] and quiet["changes"] < 3.0
