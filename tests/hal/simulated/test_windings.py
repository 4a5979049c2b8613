"""Windings that warm: against closed forms, in the simulator, on the twin, and where nobody knows them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.files.problems import LoadError
from aloft.hal.simulated.battery import Battery
from aloft.hal.simulated.drives import MotorLimits
from aloft.hal.simulated.effects import BatteryParameters, WindingParameters
from aloft.hal.simulated.state import PhysicsState, TickRecord
from aloft.hal.simulated.windings import Windings
from aloft.robots.description import find_robot

from .simulated_bruce import bench, hold
from .test_drive_effects import SIZES

ROBOT = find_robot("bruce")
N = len(ROBOT.joints)
STEP = 0.0005
GRAPHS = Path(aloft.__file__).parent / "graphs"


def windings(**params: Any) -> tuple[Windings, PhysicsState, MotorLimits]:
    memory = PhysicsState.allocate({**SIZES, "n_windings": N, "n_battery": 4})
    chosen = WindingParameters.model_validate(params)
    found = Windings(chosen, ROBOT, np.full(N, 1.02), STEP, memory)
    found.begin(np.zeros(len(ROBOT.joints)))
    return found, memory, MotorLimits(ROBOT, TickRecord.allocate({**ROBOT.dimensions}))


def test_a_winding_warms_as_its_closed_form_says() -> None:
    """With a resistance that stays, T = T_a + R_th P (1 - exp(-t / tau)), P = R (torque / k)^2."""
    found, memory, limits = windings(copper=0.0, ambient=20.0, temperature=20.0)
    limiting, heating = found.limit_call(limits), found.heat_call(limits)
    limits.scratch.torque[:] = 4.0
    for _ in range(20_000):
        limiting.run()
        heating.run()
    power = 0.2 * (4.0 / 0.35) ** 2
    expected = 20.0 + 2.0 * power * -math.expm1(-10.0 / (2.0 * 15.0))
    np.testing.assert_allclose(memory.winding_temperature, expected, rtol=1e-4)


def test_copper_and_magnets_weaken_a_warm_motor() -> None:
    found, _, limits = windings(temperature=75.0)
    found.limit_call(limits).run()
    np.testing.assert_allclose(found.warm.constant, 1.02 * (1.0 - 0.0012 * 50.0))
    supply = ROBOT.supply
    assert supply is not None
    resistance = 1.0 + 0.0039 * 50.0
    np.testing.assert_allclose(found.warm.heating, supply.heating(ROBOT.motors) * resistance)
    # A voltage U drives the current (U - k v) / R, here as a nominal torque.
    free, corner, peak = (
        ROBOT.motors.no_load_speed, ROBOT.motors.corner_speed, ROBOT.motors.peak_torque,
    )  # fmt: skip
    speed, constant = 0.5 * (free + corner), 0.94
    nominal = peak * (free - speed) / (free - corner)
    expected = nominal * (free - constant * speed) / (free - speed) / resistance
    warm = (limits.motors.no_load - speed) * limits.motors.slope
    np.testing.assert_allclose(warm, expected)


def test_a_pack_sees_the_warm_motors() -> None:
    found, memory, limits = windings(temperature=75.0)
    params = BatteryParameters.model_validate({"open_voltage": 14.8, "resistance": 0.04})
    pack = Battery(params, ROBOT, STEP, memory, found.warm)
    pack.begin(np.zeros(len(ROBOT.joints)))
    found.limit_call(limits).run()
    pack.limit_call(limits).run()
    np.testing.assert_allclose(limits.motors.no_load, ROBOT.motors.no_load_speed / 0.94)
    limits.scratch.torque[:], limits.scratch.speed[:] = 5.0, 0.0
    pack.feed_call(limits).run()
    heat = N * 0.2 * (1.0 + 0.0039 * 50.0) * (5.0 / 0.35) ** 2 + 15.0
    assert float(pack.voltage[0]) * memory.battery[3] == pytest.approx(heat)


def test_a_hot_robot_reports_it_and_goes_on_from_a_snapshot() -> None:
    robot = bench(windings={"temperature": 60.0}, battery={})
    hold(robot)
    robot.step(5)
    saved = robot.snapshot()
    robot.step(20)
    later = robot.get("health").temperature.copy(), robot.get("joints").position.copy()
    assert 59.0 < later[0].min() <= later[0].max() < 62.0 and np.ptp(later[0]) > 1e-4
    assert robot.block.metrics()["robot_hottest_winding_degc"] == pytest.approx(
        later[0].max(), abs=0.1
    )
    robot.restore(saved)
    robot.step(20)
    np.testing.assert_array_equal(robot.get("health").temperature, later[0])
    np.testing.assert_array_equal(robot.get("joints").position, later[1])


def test_the_drives_of_the_twin_report_their_windings() -> None:
    graph = aloft.load(
        GRAPHS / "jump_twin.yaml",
        overrides={"robot.actuators.windings": {"temperature": 60.0}, "duration": "0.2 s"},
    )
    found = graph.run(log=True)
    temperature = found.signal("robot.health.temperature")
    assert temperature.min() > 59.0 and temperature.max() < 62.0
    assert np.ptp(temperature[-1]) > 1e-3


@pytest.mark.parametrize(
    ("graph", "windings", "text"),
    [
        ("a1_stand", {}, "a `supply` with winding_heat_capacity [J/K] in the description"),
        ("go2_stand", {"heat_capacity": 40.0}, "windings: {thermal_resistance: ... K/W}"),
    ],
)
def test_windings_that_nobody_described_are_refused(
    graph: str, windings: dict[str, float], text: str
) -> None:
    with pytest.raises(LoadError) as caught:
        aloft.load(
            GRAPHS / "robots" / f"{graph}.yaml", overrides={"robot.actuators.windings": windings}
        )
    assert text.replace("a `supply`", "`supply`") in str(caught.value)
