"""Readings of different ages are brought to the time of the oldest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aloft.blocks.estimation.sensor_alignment import SensorAlignment
from aloft.robots.description import find_robot
from aloft.robots.transmission import PLAY_TIME
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


def test_a_unit_beside_the_base_and_turned_reads_as_one_at_the_bases_origin() -> None:
    place, turn = np.array([0.01, -0.02, 0.03]), np.array([0.02, -0.05, 0.1])
    to_base = Rotation.from_rotvec(turn)
    bench: BlockBench[Any] = BlockBench(
        SensorAlignment, {"imu_position": place.tolist(), "imu_rotation": turn.tolist()},
        robot="bruce", rate=1000.0,
    )  # fmt: skip
    for tick in range(50):
        t = tick / 1000.0
        rate = np.array([3 * math.sin(9 * t), 2 * math.cos(7 * t), 5 * t])
        # the derivative in the middle of the last tick, which is what two readings can tell
        s = t - 0.0005
        swing = np.array([27 * math.cos(9 * s), -14 * math.sin(7 * s), 5.0])
        force = np.array([1.0, 2.0 * t, 9.8])
        there = force + np.cross(swing, place) + np.cross(rate, np.cross(rate, place))
        bench.set(
            "measured_imu", angular_velocity=to_base.inv().apply(rate),
            specific_force=to_base.inv().apply(there),
        )  # fmt: skip
        bench.step()
        imu = bench.get("imu")
        np.testing.assert_allclose(imu.angular_velocity, rate, atol=1e-12)
        if tick:
            np.testing.assert_allclose(imu.specific_force, force, atol=1e-5)


def test_play_is_taken_off_by_the_sign_of_the_torque() -> None:
    bench: BlockBench[Any] = BlockBench(
        SensorAlignment, {"play": {"*": 0.0, "*_knee": 0.01}}, robot="bruce", rate=500.0
    )
    joints = find_robot("bruce").joints
    knees = [k for k, joint in enumerate(joints) if joint.name.endswith("_knee")]
    for torque in (2.0, -2.0):
        bench.set("measured_joints", position=0.3, torque=torque)
        for _ in range(30):
            bench.step()
        expected = np.full(len(joints), 0.3)
        expected[knees] -= math.copysign(0.005, torque)
        np.testing.assert_allclose(bench.get("joints").position, expected, atol=1e-6)


def test_play_is_taken_off_at_the_time_of_its_torque() -> None:
    """Angles that are brought to an older time have the play of that time."""
    bench: BlockBench[Any] = BlockBench(
        SensorAlignment, {"play": {"*": 0.01}, "rate": 0.006}, robot="bruce", rate=500.0
    )
    play, share = 0.0, -math.expm1(-0.002 / PLAY_TIME)
    for tick in range(200):
        torque = 2.0 if tick % 40 < 20 else -2.0
        play += share * (math.copysign(0.005, torque) - play)
        bench.set("measured_joints", position=0.3 + play, torque=torque)
        bench.step()
        np.testing.assert_allclose(bench.get("joints").position, 0.3, atol=1e-6)
