"""Readings of different ages are brought to the time of the oldest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.blocks.estimation.sensor_alignment import SensorAlignment
from aloft.runtime.testing.bench import BlockBench


def readings(ticks: int = 40, hertz: float = 500.0, **ages: float) -> Any:
    """The outputs in the last tick, of readings that each tell the time they are of [s]."""
    bench: BlockBench[Any] = BlockBench(SensorAlignment, ages, robot="bruce", rate=hertz)
    for tick in range(ticks):
        now = 1.0 + tick / hertz
        age = {**dict.fromkeys(("rate", "force", "position", "velocity"), 0.0), **ages}
        bench.set(
            "measured_imu", angular_velocity=now - age["rate"], specific_force=now - age["force"]
        )
        bench.set(
            "measured_joints", position=now - age["position"], velocity=now - age["velocity"],
            torque=now,
        )  # fmt: skip
        bench.step()
    return now, bench.get("imu"), bench.get("joints")


@pytest.mark.parametrize(
    "ages",
    [
        {},
        {"rate": 0.001},
        {"rate": 0.001, "force": 0.00325},
        {"velocity": 0.002},
        {"rate": 0.0045, "force": 0.0045, "position": 0.001, "velocity": 0.003},
        {"force": 0.02, "position": 0.02},
    ],
)
def test_all_are_of_the_time_of_the_oldest(ages: dict[str, float]) -> None:
    now, imu, joints = readings(**ages)
    time = now - max([0.0, *ages.values()])
    for values in (imu.angular_velocity, imu.specific_force, joints.position, joints.velocity):
        np.testing.assert_allclose(values, time, atol=1e-12)
    np.testing.assert_array_equal(joints.torque, now)


def test_equal_ages_change_no_bit() -> None:
    now, imu, joints = readings()
    assert (imu.angular_velocity == now).all() and (joints.velocity == now).all()


def test_the_first_reading_stands_for_those_before_it() -> None:
    now, imu, joints = readings(ticks=1, rate=0.003)
    assert now == 1.0
    np.testing.assert_allclose(joints.position, 1.0)
    np.testing.assert_allclose(imu.angular_velocity, 1.0 - 0.003)


def test_what_is_older_than_what_is_remembered_is_the_oldest_there_is() -> None:
    now, imu, _ = readings(hertz=5000.0, velocity=0.02)
    np.testing.assert_allclose(imu.specific_force, now - 15 / 5000.0)
