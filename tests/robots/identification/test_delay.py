"""The delay is found to a share of a tick, and what does not tell it is refused."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.mathematics.arrays import Array
from aloft.robots.identification.delay import identify_delay
from aloft.robots.identification.rigid_body import IdentificationError

PERIOD = 0.002
FINE = 20


def measured(commanded: Array, delay: float) -> Array:
    """The mean torque over each tick before, if commands act ``delay`` later, on a fine grid."""
    steps = round(delay / PERIOD * FINE)
    acting = np.repeat(commanded, FINE, axis=0)
    acting = np.vstack([np.repeat(commanded[:1], steps, axis=0), acting])[: len(acting)]
    means = acting.reshape(len(commanded), FINE, -1).mean(axis=1)
    return np.vstack([commanded[:1], means[:-1]])


def commands(ticks: int = 600) -> Array:
    rng = np.random.default_rng(1)
    return np.cumsum(rng.normal(0.0, 0.2, (ticks, 10)), axis=0)


@pytest.mark.parametrize("delay", [0.0, 0.0007, 0.002, 0.0043, 0.0189])
def test_it_is_found_to_a_share_of_a_tick(delay: float) -> None:
    asked = commands()
    noise = np.random.default_rng(2).normal(0.0, 0.02, asked.shape)
    none = np.zeros(len(asked), dtype=np.bool_)
    found = identify_delay(PERIOD, asked, measured(asked, delay) + noise, none)
    assert found.delay.value == pytest.approx(delay, abs=1.5e-4)
    assert abs(found.delay.value - delay) < 3.0 * found.delay.std
    assert found.delay.std == pytest.approx(0.05 * PERIOD, rel=0.5)
    assert found.correlation > 0.95 and found.ticks > 500


def test_ticks_with_joint_feedback_are_not_used() -> None:
    asked = commands()
    seen = measured(asked, 0.004)
    feedback = np.zeros(len(asked), dtype=np.bool_)
    feedback[300:] = True
    seen[300:] = np.random.default_rng(3).normal(0.0, 10.0, seen[300:].shape)
    found = identify_delay(PERIOD, asked, seen, feedback)
    assert found.delay.value == pytest.approx(0.004, abs=1e-4)
    assert found.ticks < 300


def test_a_run_with_feedback_throughout_is_refused() -> None:
    asked = commands()
    always = np.ones(len(asked), dtype=np.bool_)
    with pytest.raises(IdentificationError, match="only 0 ticks have commands without joint feed"):
        identify_delay(PERIOD, asked, asked, always)


def test_torques_that_do_not_follow_are_refused() -> None:
    asked = commands()
    none = np.zeros(len(asked), dtype=np.bool_)
    other = np.random.default_rng(4).normal(0.0, 1.0, asked.shape)
    with pytest.raises(IdentificationError, match="do not follow the commanded ones at any delay"):
        identify_delay(PERIOD, asked, other, none)
