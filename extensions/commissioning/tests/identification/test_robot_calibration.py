"""Robots sway, and what was planted in them is found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.extensions.commissioning.identification.calibration import fragment
from aloft.extensions.commissioning.identification.robot_calibration import calibration_from, swayed
from aloft.robots.description import find_robot

GRAPHS = Path(aloft.__file__).parent / "graphs"
SHORT = ["duration=11.5 s", "plan.sway_time=10 s"]


@pytest.mark.long
def test_a_late_gyroscope_and_friction_of_a_quadruped_are_found() -> None:
    """Each within twice the error that is stated; of a robot without them neither is."""
    robot, found = find_robot("go2"), []
    for effects in ([], ["robot.sensors.imu.gyro_delay=2 ms", "robot.actuators.joint_friction=2"]):
        graph = aloft.load(GRAPHS / "robots/sway.yaml", ["robot=go2", *SHORT, *effects])
        found.append(calibration_from(swayed(graph)))
    for calibration, delay, factor in zip(found, (0.0, 0.002), (1.0, 2.0), strict=True):
        late = calibration.gyro_age
        assert late.std < 5e-4
        assert late.value == pytest.approx(delay, abs=2.0 * late.std)
        shares = []
        for (name, value), known in zip(
            calibration.friction.items(), robot.motors.friction, strict=True
        ):
            assert value.value == pytest.approx(factor * known, abs=2.5 * value.std), name
            shares.append(value.value / known)
        assert np.mean(shares) == pytest.approx(factor, rel=0.15)
    assert "timing.rate: 2." in fragment(robot, found[1], "a run")
