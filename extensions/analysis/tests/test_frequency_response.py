"""Frequency responses from runs with a chirp: against closed forms, and the jump's stance against its linear model."""

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.extensions.analysis import frequency_responses, linearise
from aloft.extensions.analysis.loop_margins import loop_responses

GRAPHS = Path(__file__).parents[3] / "graphs"
T = 0.01
LOOP = """
rate: 100 Hz
blocks:
  noise: {use: blocks.WhiteNoise, with: {std: 0.05, seed: 1}}
  m: {use: blocks.Sum, in: {a: x.y, b: noise.y}}
  slow: {use: blocks.Gain, rate: 50 Hz, with: {gain: -10.0, unit: 1/s}, in: {u: m.y}}
  x: {use: blocks.Integrator, with: {initial: [1.0]}, in: {u: {from: slow.y, delay: 1}}}
"""
ASKED = {"inputs": "slow.y", "at": 1.0, "size": 1.0, "low": 0.25, "high": 20.0, "period": 4.0}


def opened(hertz: np.ndarray) -> np.ndarray:
    """x+ = x + 2 T u-, u = -10 x in the steps of the slow block: L = 20 T / (z (z - 1))."""
    z = np.exp(2j * np.pi * hertz * 2.0 * T)
    return 20.0 * T / (z * (z - 1.0))


def test_a_loop_of_two_rates_with_a_delay_has_the_response_of_its_equations() -> None:
    graph = aloft.load(LOOP)
    (found,) = frequency_responses(graph, seeds=range(5), **ASKED)
    assert (found.source, found.target, found.opened) == (
        "slow.y.value[0]",
        "slow.y.value[0]",
        True,
    )
    assert found.frequency[0] == 0.25 and found.frequency[-1] == 20.0 and found.samples == 20
    exact = opened(found.frequency)
    assert 0.85 <= found.holds(exact).mean() <= 1.0  # 95 % of 28 is 26.6, standard deviation 1.2
    strong = np.abs(exact) > 1.0
    assert np.abs(found.value / exact - 1.0)[strong].max() < 0.15
    assert found.coherence[0] > 0.98 and found.coherence[-1] < 0.5  # noise covers what is weak
    assert not found.holds(1.5 * exact)[:5].any()
    model = linearise(graph, inputs="slow.y", outputs="slow.y", opened=True, at=1.0)
    assert np.allclose(loop_responses(model, 2.0 * np.pi * found.frequency)[:, 0], exact)


def test_the_closed_loop_to_another_signal() -> None:
    (found,) = frequency_responses(aloft.load(LOOP), seeds=range(5), outputs="m.y", **ASKED)
    # r is added to u at 50 Hz; m is seen at 100 Hz
    model = linearise(aloft.load(LOOP), inputs="slow.y", outputs="m.y", at=1.0)
    predicted = model.response(2.0 * np.pi * found.frequency)[:, 0, 0]
    assert (found.target, found.opened) == ("m.y.value[0]", False)
    assert found.holds(predicted).mean() >= 0.85
    assert not found.holds(1.5 * predicted)[:5].any()


def test_several_outputs_are_read_in_the_same_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    graph, seeds = aloft.load(LOOP), range(5)
    alone = [
        each
        for target in ("m.y", "x.y")
        for each in frequency_responses(graph, seeds=seeds, outputs=target, **ASKED)
    ]
    run, ran = aloft.Graph.run, []

    def counted(self: aloft.Graph, *args: object, **named: object) -> object:
        ran.append(named["seed"])
        return run(self, *args, **named)

    monkeypatch.setattr(aloft.Graph, "run", counted)
    both = frequency_responses(graph, seeds=seeds, outputs=["m.y", "x.y", "m.y"], **ASKED)
    assert ran == list(seeds)
    assert [each.as_data() for each in both] == [each.as_data() for each in alone]


def test_without_noise_it_is_exact_and_with_more_seeds_narrower() -> None:
    (exact,) = frequency_responses(aloft.load(LOOP, {"noise.std": 0.0}), seeds=range(1), **ASKED)
    assert np.abs(exact.value / opened(exact.frequency) - 1.0).max() < 1e-4
    graph = aloft.load(LOOP)
    (few,), (many,) = (frequency_responses(graph, seeds=range(n), **ASKED) for n in (2, 16))
    assert 2.0 < np.median(few.radius / many.radius) < 4.5  # sqrt(8), and less of Fisher's F


@pytest.mark.long
def test_the_intervals_hold_as_often_as_they_say() -> None:
    graph, held = aloft.load(LOOP), []
    for first in range(100, 160, 3):
        (found,) = frequency_responses(graph, seeds=range(first, first + 3), periods=2, **ASKED)
        held.append(found.holds(opened(found.frequency)).mean())
    assert 0.90 < np.mean(held) < 0.98


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"inputs": "slow.z"}, "there is no signal 'slow.z'"),
        ({"period": 0.25, "low": 4.0}, r"multiple of 0.02 s, the period of all rates of the graph"),
        ({"seeds": range(1), "periods": 2}, "at least 3 samples: periods times seeds"),
        ({"high": 25.0}, "faults.chirp.high cannot be 25 Hz"),
        ({"size": "1 m"}, "unit"),
    ],
)  # fmt: skip
def test_what_cannot_be_measured_is_said(change: dict, text: str) -> None:
    with pytest.raises(aloft.AloftError, match=text):
        frequency_responses(aloft.load(LOOP), **{"seeds": range(3), **ASKED, **change})


def test_a_run_that_ends_too_soon_is_named() -> None:
    short = aloft.load(
        LOOP.rstrip()
        + """
  clock: {use: blocks.Ramp}
  stop: {use: blocks.Assertion, with: {upper: 4.985, action: stop}, in: {u: clock.y}}
"""
    )
    with pytest.raises(
        aloft.AloftError,
        match=r"seed 7 ended at 5 s, before the last period of the chirp, .* at 21 s",
    ):
        frequency_responses(short, seeds=[7, 8, 9], **ASKED)


STANCE = {"plan.stand_time": 10.0, "push.force": 0.0, "robot.jitter": 0.0}
KNEE = "joint_pd.command.torque[left_knee]"
MEASURED = {"inputs": KNEE, "at": 1.5, "seeds": range(1000, 1005), "low": 1.0, "high": 50.0}


@pytest.mark.long
def test_the_stance_of_the_jump_answers_as_its_linear_model_says() -> None:
    """With the sensors' noise; without friction of the joints, which no linear model has."""
    graph = aloft.load(GRAPHS / "push.yaml", {**STANCE, "robot.actuators.joint_friction": 0.0})
    wire = "joint_pd.command.torque[*]"
    model = linearise(graph, inputs=wire, outputs=wire, opened=True, at=1.5)
    (found,) = frequency_responses(graph, size="0.1 N m", **MEASURED)
    predicted = loop_responses(model, 2.0 * np.pi * found.frequency)[:, model.inputs.index(KNEE)]
    assert found.holds(predicted).mean() >= 0.75
    assert 0.85 < np.median(np.abs(found.value / predicted)) < 1.15
