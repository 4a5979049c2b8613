"""Margins of loops against closed forms."""

from pathlib import Path
from textwrap import dedent, indent

import numpy as np
import pytest
import scipy.linalg

import aloft
from aloft.extensions.analysis import linearise, margins

T, K = 0.01, 30.0


def loop(delay: int = 0, channels: int = 1, rate: str = "", gain: float = K) -> aloft.Graph:
    """u = -K x, x' = u, with x by Euler's method: L = -K T / (z - 1) z^-delay."""
    wire = f"{{from: k.y, delay: {delay}}}" if delay else "k.y"
    return aloft.load(
        "rate: 100 Hz\nblocks:\n"
        + indent(
            dedent(f"""
      k: {{use: blocks.Gain, {rate} with: {{n: {channels}, gain: {-gain}, unit: 1/s}}, in: {{u: x.y}}}}
      x: {{use: blocks.Integrator, with: {{n: {channels}, initial: {[1.0] * channels}}}, in: {{u: {wire}}}}}
    """),
            "  ",
        )
    )


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("channels", [1, 3])
def test_an_integrator_with_delay_has_the_margins_of_its_formula(delay: int, channels: int) -> None:
    found = margins(
        linearise(loop(delay, channels), inputs="k.y", outputs="k.y", at=0.1, opened=True)
    )
    # |K T / (exp(i w T) - 1)| = 1 where 2 sin(w T / 2) = K T; its phase there is -90 deg - w T / 2
    crossover = 2.0 / T * np.arcsin(K * T / 2.0)
    phase = np.pi / 2.0 - crossover * T * (0.5 + delay)
    # -180 deg where w T (1/2 + delay) = 90 deg
    critical = np.pi / (1.0 + 2.0 * delay)
    gain = 2.0 * np.sin(critical / 2.0) / (K * T)
    for each in (*found.channels.values(), found.together):
        assert each.crossover == pytest.approx(crossover, rel=1e-3)
        assert each.phase == pytest.approx(np.degrees(phase), abs=0.1)
        assert each.delay == pytest.approx(phase / crossover, rel=2e-3)
        assert each.gain_up == pytest.approx(gain, rel=2e-3)
        assert each.gain_down == 0.0
    assert found.stable
    assert len(found.channels) == channels


@pytest.mark.parametrize("gain", [30.0, 100.0, 190.0, 199.0, 201.0, 220.0])
def test_a_limit_at_half_the_rate_is_found(gain: float) -> None:
    """z = 1 - K T leaves the circle at -1, where K T = 2."""
    found = margins(linearise(loop(gain=gain), inputs="k.y", outputs="k.y", at=0.1, opened=True))
    limit = 2.0 / (gain * T)
    for each in (*found.channels.values(), found.together):
        assert (each.gain_up, each.gain_down) == (
            (pytest.approx(limit, rel=1e-5), 0.0)
            if limit > 1.0
            else (np.inf, pytest.approx(limit, rel=1e-5))
        )
        # there S = 1 / (1 - K T / 2)
        assert each.disk <= 2.0 / abs(2.0 / (1.0 - gain * T / 2.0) - 1.0) * (1.0 + 1e-4)
    assert found.stable == (limit > 1.0)


def pendulum(gain: float, channels: int = 1) -> aloft.Graph:
    """x'' = x + u, u = -k (3 x + x'), sampled exactly: stable from k = 1/3 to 200."""
    exact = scipy.linalg.expm(T * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
    a, b = exact[:2, :2].tolist(), exact[:2, 2:].tolist()
    return aloft.load(f"""
rate: 100 Hz
blocks:
  k: {{use: blocks.Gain, with: {{n: 1, gain: {-gain}}}, in: {{u: x.y}}}}
  x: {{use: blocks.StateSpace, with: {{a: {a}, b: {b}, c: [[3.0, 1.0]], initial: [0.0, 0.0]}}, in: {{u: k.y}}}}
""")


@pytest.mark.parametrize("gain", [0.34, 1.0, 100.0, 190.0])
def test_a_loop_that_needs_its_gain_has_a_limit_at_frequency_zero(gain: float) -> None:
    found = margins(linearise(pendulum(gain), inputs="k.y", outputs="k.y", at=0.1, opened=True))
    for each in (*found.channels.values(), found.together):
        assert each.gain_down == pytest.approx(1.0 / 3.0 / gain, rel=1e-5)
        assert each.gain_up == pytest.approx(200.0016669 / gain, rel=1e-5)


def test_limits_of_a_channel_beside_others_are_its_own() -> None:
    """Two integrators, of which one has twice the gain: each channel by itself, and both at once."""
    graph = aloft.load("""
rate: 100 Hz
blocks:
  k: {use: blocks.Gain, with: {n: 2, gain: [-50.0, -100.0], unit: 1/s}, in: {u: x.y}}
  x: {use: blocks.Integrator, with: {n: 2, initial: [1.0, 1.0]}, in: {u: k.y}}
""")
    found = margins(linearise(graph, inputs="k.y", outputs="k.y", at=0.1, opened=True))
    assert [each.gain_up for each in found.channels.values()] == pytest.approx([4.0, 2.0])
    assert found.together.gain_up == pytest.approx(2.0)


@pytest.mark.parametrize(("extra", "stable"), [(4, True), (5, False)])
def test_the_delay_margin_is_where_the_loop_becomes_unstable(extra: int, stable: bool) -> None:
    base = margins(linearise(loop(0), inputs="k.y", outputs="k.y", at=0.1, opened=True))
    assert (extra * T < base.together.delay) == stable
    later = margins(linearise(loop(extra), inputs="k.y", outputs="k.y", at=0.1, opened=True))
    assert later.stable == stable
    assert (later.growth < 0.0) == stable


def test_the_disk_margin_and_the_peak_of_the_sensitivity() -> None:
    found = margins(linearise(loop(1), inputs="k.y", outputs="k.y", at=0.1, opened=True))
    w = np.linspace(1.0, np.pi / T, 100_000)
    z = np.exp(1j * w * T)
    s = 1.0 / (1.0 + K * T / (z - 1.0) / z)
    assert found.together.sensitivity_peak == pytest.approx(np.abs(s).max(), rel=1e-3)
    assert found.together.disk == pytest.approx(2.0 / np.abs(2.0 * s - 1.0).max(), rel=1e-3)


def test_a_slow_controller_counts_with_its_hold() -> None:
    # At half the rate the loop is that of a period 2 T: gain margin 2 / (2 K T).
    found = margins(
        linearise(loop(rate="rate: 50 Hz,"), inputs="k.y", outputs="k.y", at=0.1, opened=True)
    )
    model = linearise(loop(rate="rate: 50 Hz,"), inputs="k.y", outputs="k.y", at=0.1, opened=True)
    assert model.ticks == 2
    assert np.allclose(model.a, [[1.0]])
    crossover = 2.0 / (2.0 * T) * np.arcsin(K * 2.0 * T / 2.0)
    assert found.together.crossover == pytest.approx(crossover, rel=1e-2)


def test_margins_need_a_loop() -> None:
    model = linearise(loop(), inputs="k.y", outputs="x.y", at=0.1)
    with pytest.raises(
        aloft.AloftError, match="margins are those of a loop that is opened at a wire"
    ):
        margins(model)


STANDING = {
    "plan.stand_time": 10.0, "push.force": 0.0, "delay.nominal": "2 ms", "delay.follow": "nominal",
    "robot.jitter": 0.0, "robot.sensors.joint_velocity_noise": 0.0, "robot.sensors.switch_bounce": 0.0,
    "robot.sensors.gyro_noise": 0.0, "robot.sensors.gyro_bias": 0.0, "robot.sensors.accelerometer_noise": 0.0,
    "robot.sensors.accelerometer_bias": 0.0,
}  # fmt: skip


@pytest.mark.long
def test_the_standing_robot_sways_beyond_its_delay_margin() -> None:
    graph = aloft.load(Path(__file__).parents[3] / "graphs" / "push.yaml", STANDING)
    torque = "joint_pd.command.torque[*]"
    found = margins(linearise(graph, inputs=torque, outputs=torque, at=1.5, opened=True))
    assert found.growth < 0.01  # blocks that learn, but no fall
    limit = 0.002 + found.together.delay

    def late_rate(latency: float) -> float:
        result = graph.changed({**STANDING, "robot.latency": latency}).run(3.0)
        rate = np.asarray(result.signal("robot.truth.base_angular_velocity"))
        return float(np.sqrt((rate[-200:] ** 2).mean()))

    assert late_rate(0.85 * limit) < 1e-3
    assert late_rate(1.15 * limit) > 1e-2
