"""The score of an estimator on made-up truth, and that the controller cannot be fed from it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.blocks.scoring.estimator_score import EstimatorScore
from aloft.runtime.testing.bench import BlockBench

GRAPHS = Path(aloft.__file__).parent / "graphs"
PERIOD = 0.002
TURN = [0.1 * x for x in (0.6, 0.0, 0.8)]
"""From the true to the estimated orientation: 0.06 rad of tilt and 0.08 rad of yaw."""


def half(vector: Any) -> np.ndarray:
    """The quaternion of a rotation vector."""
    size = float(np.linalg.norm(vector))
    return np.array([*np.sin(size / 2) * np.asarray(vector) / size, math.cos(size / 2)])


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The quaternion product."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*vector, a[3] * b[3] - a[:3] @ b[:3]])


def run(*stretches: tuple[int, bool, float]) -> dict[str, Any]:
    """Metrics after stretches of (ticks, touched, error); the error is of position [m], twice as
    much of velocity."""
    bench = BlockBench(EstimatorScore, {}, robot="bruce", rate=1 / PERIOD)
    truth = half([0.3, -0.2, 0.5])
    bench.set("truth", base_position=[1.0, 2.0, 3.0], base_orientation=truth)
    for ticks, touched, error in stretches:
        bench.set("truth", contact_touched=touched)
        bench.set(
            "base", position=[1.0 + 0.6 * error, 2.0, 3.0 - 0.8 * error],
            linear_velocity=[0.0, 2.0 * error, 0.0], orientation=-times(half(TURN), truth),
        )  # fmt: skip
        for _ in range(ticks):
            bench.step()
    return dict(bench.block.metrics())


def test_errors_of_one_jump() -> None:
    found = run((100, True, 0.01), (1, False, 0.02), (98, False, 0.03), (1, False, 0.04),
                (50, True, 0.06))  # fmt: skip
    assert found["estimator_flights"] == 1
    assert found["estimator_position_lift_off_m"] == pytest.approx(0.02)
    assert found["estimator_position_touchdown_m"] == pytest.approx(0.04)
    assert found["estimator_position_flight_peak_m"] == pytest.approx(0.04)
    assert found["estimator_position_flight_rms_m"] == pytest.approx(
        math.sqrt((0.02**2 + 98 * 0.03**2 + 0.04**2) / 100)
    )
    assert found["estimator_position_end_m"] == pytest.approx(0.06)
    assert found["estimator_position_peak_m"] == pytest.approx(0.06)
    assert found["estimator_velocity_touchdown_m_s"] == pytest.approx(0.08)
    assert found["estimator_velocity_rms_m_s"] == pytest.approx(
        2 * found["estimator_position_rms_m"]
    )
    for name, expected in (("attitude", 0.1), ("tilt", 0.06), ("yaw", 0.08)):
        assert found[f"estimator_{name}_touchdown_rad"] == pytest.approx(expected)


def test_a_bounce_is_no_flight() -> None:
    found = run((10, True, 0.01), (8, False, 0.02), (10, True, 0.01))
    assert found["estimator_flights"] == 0
    assert not [name for name in found if "touchdown" in name or "lift_off" in name]
    assert found["estimator_position_peak_m"] == pytest.approx(0.02)


def test_several_jumps() -> None:
    """The figures at lift-off and touchdown are the last jump's, those in flight of all."""
    found = run(*[(20, True, 0.01), (20, False, 0.09), (20, True, 0.02), (20, False, 0.05)],
                (5, False, 0.06), (5, True, 0.07))  # fmt: skip
    assert found["estimator_flights"] == 2
    assert found["estimator_position_lift_off_m"] == pytest.approx(0.05)
    assert found["estimator_position_touchdown_m"] == pytest.approx(0.06)
    assert found["estimator_position_flight_peak_m"] == pytest.approx(0.09)
    assert found["estimator_position_flight_rms_m"] == pytest.approx(
        math.sqrt((20 * 0.09**2 + 20 * 0.05**2 + 5 * 0.06**2) / 45)
    )


def test_a_flight_that_has_not_ended_has_no_touchdown() -> None:
    found = run((10, True, 0.01), (30, False, 0.02))
    assert found["estimator_flights"] == 1
    assert "estimator_position_lift_off_m" in found
    assert "estimator_position_touchdown_m" not in found


def test_no_ticks_no_errors() -> None:
    assert run() == {"estimator_flights": 0}


def test_only_observers_see_the_truth() -> None:
    graph = aloft.load(GRAPHS / "estimator.yaml").checked
    readers = {
        spec.path
        for spec in graph.blocks
        if any(wire.source == "robot.truth" for wire in spec.wires.values())
    }
    assert readers == {"push", "score", "estimator_score"}
    assert not any(
        wire.source.startswith("estimator_score")
        for spec in graph.blocks
        for wire in spec.wires.values()
    )


@pytest.mark.parametrize("align", ["start", "world"])
def test_motion_capture_in_a_world_of_its_own_is_aligned_by_yaw_and_place_of_the_first_sample(
    align: str,
) -> None:
    bench = BlockBench(EstimatorScore, {"align": align}, robot="bruce", rate=1 / PERIOD)
    yaw, place = 1.2, np.array([3.0, -2.0, 0.5])
    other = half([0.0, 0.0, yaw])
    turn = np.array(
        [[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
    )
    bench.set("truth", contact_touched=True)
    for k in range(50):
        own, velocity = np.array([0.4 * k * PERIOD, 0.0, 0.5]), np.array([0.4, 0.0, 0.0])
        lean = half([0.1, 0.05 + 0.001 * k, 0.02 * k])
        bench.set("base", position=own, linear_velocity=velocity, orientation=lean)
        bench.set(
            "truth", base_position=turn @ own + place, base_orientation=times(other, lean),
            base_linear_velocity=turn @ velocity,
        )  # fmt: skip
        bench.step()
    found = dict(bench.block.metrics())
    names = ("position_end_m", "velocity_rms_m_s", "yaw_rms_rad", "tilt_rms_rad")
    apart = [found[f"estimator_{name}"] for name in names]
    if align == "start":
        assert apart == pytest.approx([0.0] * 4, abs=1e-9)
    else:
        assert apart[0] > 3.0 and apart[1] > 0.4 and apart[2] == pytest.approx(yaw)
        assert apart[3] == pytest.approx(0.0, abs=1e-9), "tilt needs no alignment"
