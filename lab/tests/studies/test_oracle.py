"""What the oracle tells is what the simulator drew, and the controller takes it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from aloft.lab.studies.oracle import CALIBRATED, CONSUMER, CalibrationErrors, oracle_values
from aloft.runtime.graph import Graph
from aloft.runtime.loading import checked_text

GRAPHS = Path(__file__).parents[3] / "graphs"


def graph_of(overrides, trial="real"):
    files = ["jump.yaml", f"trials/{trial}.yaml", CONSUMER]
    text = "include: [" + ", ".join(files) + "]\n"
    return Graph(checked_text(text, GRAPHS / "told.yaml", {"robot.seed": 4, **overrides}))


@pytest.fixture(scope="module")
def told():
    return oracle_values(graph_of({}))


def test_ages_are_those_of_filter_packet_and_drive(told):
    filtered = math.sqrt(0.5) / (math.pi * 100.0)
    step = 0.5e-3  # of the physics: rates and velocities are half of one older than angles
    assert 0.0005 <= told["timing.rate"] - filtered - 0.5 * step <= 0.0015 + 1e-5
    assert told["timing.rate"] == told["timing.force"]
    assert told["timing.velocity"] == pytest.approx(0.001, abs=3e-5)
    assert told["timing.position"] == 0.0
    assert told["delay.nominal"] == pytest.approx(0.002 + 1 / (640 * math.pi) + told["timing.rate"])


def test_a_nominal_robot_has_nothing_to_tell():
    told = oracle_values(graph_of({}, trial="robust"))
    assert told["timing.imu_position"] == told["timing.imu_rotation"] == [0.0] * 3
    assert set(told["robot.motor_model.torque_constant"].values()) == {1.0}
    assert set(told["joint_pd.friction"].values()) <= {0.0}
    assert set(told["dynamics.rotor_inertia"].values()) == {1.0}


def test_values_stay_within_what_is_drawn(told):
    assert all(0.95 <= c <= 1.05 for c in told["robot.motor_model.torque_constant"].values())
    assert all(abs(x) <= 0.005 for x in told["timing.imu_position"])
    assert set(told["dynamics.rotor_inertia"].values()) == {1.2}
    friction = [1.0 + added / 0.07 for added in told["joint_pd.friction"].values()]
    assert all(1.6 * 0.7 <= factor <= 1.6 * 1.3 for factor in friction)


def test_errors_are_drawn_by_their_seed(told):
    graph = graph_of({})
    first, again, other = (oracle_values(graph, CALIBRATED, seed=n) for n in (1, 1, 2))
    assert first == again != other
    assert oracle_values(graph, CalibrationErrors()) == told
    graph_of(first)
