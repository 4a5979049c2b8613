"""``aloft check`` names rings of integrators that grow by their method alone."""

import re

import numpy as np
import pytest

from aloft import load
from aloft.runtime.running.euler_rings import growing_rings

SPRING = """
rate: {rate} Hz
duration: 4 s
blocks:
  pull: {{use: blocks.Gain, with: {{gain: -150 1/s^2}}, in: {{u: place.y}}}}
  drag: {{use: blocks.Gain, with: {{gain: {damping} 1/s}}, in: {{u: speed.y}}}}
  acceleration: {{use: blocks.Sum, in: {{a: pull.y, b: drag.y}}}}
  speed: {{use: blocks.Integrator, in: {{u: acceleration.y}}}}
  place: {{use: blocks.Integrator, with: {{initial: 0.1}}, in: {{u: speed.y}}}}
"""


def spring(rate: float = 500.0, damping: float = 0.0) -> str:
    return SPRING.format(rate=rate, damping=damping)


def test_a_mass_on_a_spring_is_named_with_its_growth_and_a_fix() -> None:
    graph = load(spring(damping=-0.0))
    (text,) = growing_rings(graph.checked)
    assert (
        "the ring pull, drag, acceleration, speed, place is stable in continuous time, and grows by"
        in text
    )
    assert "put blocks.DoubleIntegrator in the place of speed and place" in text
    said = float(re.search(r"grows by ([\d.]+) % a second", text)[1])  # type: ignore[index]
    place = abs(graph.run().signal("place.y.value")[:, 0])
    grown = place[-400:].max() / place[:400].max()  # over 3.2 s
    assert said == pytest.approx(100.0 * (np.exp(150.0 * 0.002 / 2.0) - 1.0), rel=2e-3)
    assert np.log(grown) / 3.2 == pytest.approx(np.log(1.0 + said / 100.0), rel=0.05)


@pytest.mark.parametrize(
    ("rate", "damping"),
    [(500.0, -0.4), (5000.0, -0.04), (500.0, 3.0)],
    ids=["damped enough", "a higher rate", "unstable in continuous time, too"],
)
def test_what_the_method_does_not_decide_is_not_named(rate: float, damping: float) -> None:
    assert growing_rings(load(spring(rate, damping)).checked) == []


def test_a_double_integrator_in_its_place_is_silent() -> None:
    graph = load("""
rate: 500 Hz
duration: 1 s
blocks:
  acceleration: {use: blocks.Gain, with: {gain: -150 1/s^2}, in: {u: mass.y}}
  mass: {use: blocks.DoubleIntegrator, with: {initial: 0.1}, in: {u: acceleration.y}}
""")
    assert growing_rings(graph.checked) == []


def test_a_loop_that_a_pid_damps_is_silent() -> None:
    graph = load("""
rate: 500 Hz
duration: 1 s
blocks:
  pid: {use: blocks.PID, with: {kp: 40, kd: 8, unit: N/m}, in: {setpoint: {value: 1}, measured: place.y}}
  mass: {use: blocks.Gain, with: {gain: 0.5 1/kg}, in: {u: pid.u}}
  speed: {use: blocks.Integrator, in: {u: mass.y}}
  place: {use: blocks.Integrator, in: {u: speed.y}}
""")
    assert growing_rings(graph.checked) == []
