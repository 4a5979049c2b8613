"""The delay is found to a tenth of a period, is nominal until then, and is complained about if wrong."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.tasks.contact_points import ContactGains
from aloft.blocks.estimation.delay_estimator import LAGS, DelayEstimator
from aloft.runtime.testing import BlockBench

PERIOD = 0.002
USUAL = 0.00075


def drive(delay, ticks=320, noise=0.0, echo=1.0, seed=1, **params):
    """Random torques, and drives that give them so much later, as means over the tick."""
    random = np.random.default_rng(seed)
    bench = BlockBench(DelayEstimator, params, robot="bruce")
    sent = np.zeros((LAGS + 8, 10))
    whole, share = divmod(delay / PERIOD, 1.0)
    for _ in range(ticks):
        newer, older = sent[int(whole)], sent[int(whole) + 1]
        torque = echo * ((1.0 - share) * newer + share * older)
        bench.set("joints", torque=torque + noise * random.normal(size=10))
        command = random.normal(size=10)
        bench.set("command", torque=command)
        bench.step()
        sent = np.vstack([command, sent[:-1]])
    return bench


@pytest.mark.parametrize("delay", [0.0, 0.0007, 0.002, 0.0031, 0.005, 0.0084, 0.016])
def test_finds_the_delay(delay):
    bench = drive(delay)
    out = bench.get("estimate")
    assert bool(out.known)
    assert float(out.measured) == pytest.approx(delay, abs=1e-5)
    assert float(out.delay) == pytest.approx(max(delay - USUAL, 0.0), abs=1e-5)


def test_noise_of_the_measured_torques_hardly_matters():
    assert float(drive(0.0043, noise=0.2).get("estimate").measured) == pytest.approx(
        0.0043, abs=1e-4
    )


def test_until_it_counts_it_is_what_the_graph_says():
    out = drive(0.006, ticks=40, nominal=0.003).get("estimate")
    assert not bool(out.known)
    assert float(out.delay) == 0.003


def test_torques_that_do_not_follow_the_commands_tell_nothing():
    bench = drive(0.004, noise=2.0, nominal=0.001)
    assert not bool(bench.get("estimate").known)
    assert float(bench.get("estimate").delay) == 0.001
    assert bench.block.warnings() == ()


def test_the_nominal_one_is_followed_if_the_graph_says_so():
    out = drive(0.006, nominal=0.003, follow="nominal").get("estimate")
    assert float(out.delay) == 0.003
    assert float(out.measured) == pytest.approx(0.006, abs=1e-5)


@pytest.mark.parametrize("follow", ["measured", "nominal"])
def test_a_wrong_delay_is_reported(follow):
    (text,) = drive(0.005, nominal=0.002, follow=follow).block.warnings()
    done = "is compensated" if follow == "measured" else "is not compensated"
    assert text == (
        f"the delay from sensing to torque is 5.0 ms as measured, which {done}, and 2 ms nominally; "
        "correct `nominal` or the robot's delay"
    )
    assert drive(0.0032, nominal=0.002).block.warnings() == ()


def test_the_measurement_ends_in_time():
    """Later, when joint feedback acts, nothing is measured."""
    bench = drive(0.003, duration=0.3)
    before = float(bench.get("estimate").measured)
    bench.set("joints", torque=5.0)
    bench.step(200)
    assert float(bench.get("estimate").measured) == before


def test_metrics():
    metrics = drive(0.004, nominal=0.002).block.metrics()
    assert metrics["delay_nominal_ms"] == 2.0
    assert metrics["delay_measured_ms"] == pytest.approx(4.0, abs=0.01)


@pytest.mark.parametrize(("delay", "ahead"), [(0.0015, 0.0), (0.00475, 0.002), (0.00875, 0.006)])
def test_what_is_not_tolerated_is_worked_ahead(delay, ahead):
    out = drive(delay, nominal=delay, tolerated=0.002).get("estimate")
    assert float(out.ahead) == pytest.approx(ahead, abs=1e-5)


def test_the_phase_margin_is_what_the_description_says():
    """Of the loop (Kd s + Kp) exp(-s d) / s^2 with the gains of points without load."""
    stiffness, damping, delay = 3000.0, 110.0, 0.002
    w = np.sqrt((damping**2 + np.sqrt(damping**4 + 4.0 * stiffness**2)) / 2.0)
    loop = (damping * 1j * w + stiffness) * np.exp(-1j * w * delay) / (1j * w) ** 2
    assert abs(loop) == pytest.approx(1.0)
    margin = np.degrees(np.angle(-loop))
    assert margin == pytest.approx(76.4 - 6.5 * 2.0, abs=0.1)
    assert ContactGains().swing_stiffness == stiffness
    assert ContactGains().swing_damping == damping
