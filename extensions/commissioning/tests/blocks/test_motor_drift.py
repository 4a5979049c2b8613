"""Motors and pack as they drift are followed, and a warm robot is told from a heavy one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.extensions.commissioning.blocks.motor_drift import MotorDrift
from aloft.robots.description import find_robot
from aloft.runtime.loading.reading.files import graph_path
from aloft.runtime.testing.bench import BlockBench
from aloft.studies.expansion import load_cell

ROBOT = find_robot("bruce")
N = len(ROBOT.joints)
WARM = {
    "robot.actuators.windings": {"temperature": 65.0},
    "robot.actuators.battery": {"open_voltage": 14.4},
}


def drift(**params: float) -> BlockBench[Any]:
    return BlockBench(MotorDrift, params, robot="bruce", rate=500.0)


def test_a_warm_motor_gives_less_torque_and_reaches_other_speeds() -> None:
    bench = drift()
    temperature = np.full(N, 25.0)
    temperature[3] = 75.0
    torque = ROBOT.joint_to_motor.T @ np.linspace(1.0, 2.0, N)
    bench.set("health", temperature=temperature, voltage=13.32)
    bench.set("measured_joints", torque=torque, position=0.3, velocity=0.0)
    bench.step()
    motors, joints = bench.get("motors"), bench.get("joints")
    share = np.ones(N)
    share[3] = 1.0 - 0.0012 * 50.0
    np.testing.assert_allclose(motors.torque_constant, share)
    np.testing.assert_allclose(
        np.linalg.solve(ROBOT.joint_to_motor.T, joints.torque), share * np.linspace(1.0, 2.0, N)
    )
    assert (joints.position == 0.3).all()
    np.testing.assert_allclose(motors.no_load_speed, 0.9 / share)
    # At the corner the voltage drives the peak current, U = k w + R I, where U = 1, k = 1 / free when nominal; with a
    # lower voltage the peak current is taken to fall as much, as the simulator has it.
    free, corner = ROBOT.motors.no_load_speed[3], ROBOT.motors.corner_speed[3]
    resistance = (1.0 - corner / free) * (1.0 + 0.0039 * 50.0)
    reached = share[3] / free * motors.corner_speed[3] * corner / 0.9
    assert reached + resistance == pytest.approx(1.0)
    np.testing.assert_allclose(motors.corner_speed[:3], 0.9)


def test_drives_that_report_nothing_are_nominal() -> None:
    bench = drift()
    bench.set("measured_joints", torque=1.5, velocity=2.0)
    bench.step(10)
    motors = bench.get("motors")
    for shares in (motors.torque_constant, motors.corner_speed, motors.no_load_speed):
        np.testing.assert_allclose(shares, 1.0)
    assert motors.open_voltage == 0.0 and "open_voltage_v" not in bench.block.metrics()


def test_open_voltage_and_resistance_of_the_pack_are_found_and_followed() -> None:
    """The true pack has 60 mOhm, not 40, and empties by 1 V in 20 s; its voltages are noisy."""
    bench, random = drift(), np.random.default_rng(5)
    heating = 0.2 / 0.35**2
    for tick in range(10_000):
        torque = 3.0 + 3.0 * np.sin(0.02 * tick)
        open_voltage = 16.0 - 5e-5 * 2.0 * tick
        power = N * heating * torque**2
        voltage = 0.5 * (open_voltage + np.sqrt(open_voltage**2 - 4.0 * 0.06 * power))
        bench.set("measured_joints", torque=ROBOT.joint_to_motor.T @ np.full(N, torque))
        bench.set("health", temperature=25.0, voltage=voltage + 0.05 * random.standard_normal())
        bench.step()
    motors = bench.get("motors")
    assert float(motors.pack_resistance) == pytest.approx(0.06, abs=0.003)
    assert float(motors.open_voltage) == pytest.approx(open_voltage, abs=0.1)


@pytest.mark.long
def test_a_warm_robot_is_not_taken_for_a_heavy_one() -> None:
    """And the jump is that of a cold robot, since the motors are asked for what they lack."""
    graphs = Path(aloft.__file__).parent / "graphs"
    runs = {}
    for name, more, sets in (
        ("cold", "", {}), ("warm", "", WARM), ("followed", "aloft:commissioning/controllers/warm_motors", WARM),
    ):  # fmt: skip
        behind = [graph_path(more)] if more else []
        graph = load_cell(graphs / "jump.yaml", [], sets, graphs / "warm.yaml", behind)
        runs[name] = graph.run(log=False)
        assert runs[name].success, name
    mass = {name: float(run.metrics["felt_mass_kg"]) for name, run in runs.items()}
    assert mass["warm"] > mass["cold"] + 0.15
    assert mass["followed"] == pytest.approx(mass["cold"], abs=0.01)
    rise = {name: float(run.metrics["apex_above_standing_m"]) for name, run in runs.items()}
    assert rise["followed"] == pytest.approx(rise["cold"], abs=0.001)
