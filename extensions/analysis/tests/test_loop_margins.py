"""Margins of loops against closed forms."""

from pathlib import Path
from textwrap import dedent, indent

import numpy as np
import pytest

import aloft
from aloft.extensions.analysis import linearise, margins

T, K = 0.01, 30.0


def loop(delay: int = 0, channels: int = 1, rate: str = "") -> aloft.Graph:
    """u = -K x, x' = u, with x by Euler's method: L = -K T / (z - 1) z^-delay."""
    wire = f"{{from: k.y, delay: {delay}}}" if delay else "k.y"
    return aloft.load(
        "rate: 100 Hz\nblocks:\n"
        + indent(
            dedent(f"""
      k: {{use: blocks.Gain, {rate} with: {{n: {channels}, gain: {-K}, unit: 1/s}}, in: {{u: x.y}}}}
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
        if delay:
            assert each.gain_up == pytest.approx(gain, rel=2e-3)
        assert each.gain_down == 0.0
    assert found.stable
    assert len(found.channels) == channels


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
