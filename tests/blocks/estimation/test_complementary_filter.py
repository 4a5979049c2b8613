"""The paper's filter: what the accelerometer says at the start, and the gyroscope's bias at rest."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.estimation.complementary_filter import ComplementaryFilter
from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
PERIOD = 0.002
STANDING = ROBOT.standing_position


def flexed(flexion):
    """Joint angles with the soles parallel to a level base."""
    joints = STANDING.copy()
    joints[[1, 6]] += 0.5 * flexion
    joints[[3, 8]] -= flexion
    joints[[4, 9]] += 0.5 * flexion
    return joints


def base_over_the_soles(joints):
    """Where the level base is while the soles stand on the ground about the origin."""
    seen = ContactKinematics(ROBOT)
    seen.evaluate(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), joints, np.zeros(10))
    place = -seen.soles.mean(axis=0)
    place[2] = -seen.points[:, 2].mean()
    return place


def stand(bench, ticks, gyro=(0.0, 0.0, 0.0), force=(0.0, 0.0, 9.81)):
    bench.set("joints", position=STANDING)
    bench.set("imu", angular_velocity=list(gyro), specific_force=list(force))
    bench.set("contacts", active=True)
    bench.step(ticks)
    return bench.get("base")


def test_its_first_tilt_is_the_accelerometers():
    base = stand(BlockBench(ComplementaryFilter, robot="bruce"), 1, force=(0.1, -0.1, 9.81))
    tilt = 2.0 * np.linalg.norm(base.orientation[:2])
    assert tilt == pytest.approx(np.hypot(0.1, 0.1) / 9.81, rel=0.05)


def test_it_stands_where_the_soles_are():
    base = stand(BlockBench(ComplementaryFilter, robot="bruce"), 500)
    assert base.position == pytest.approx(base_over_the_soles(STANDING), abs=1e-3)
    assert np.abs(base.linear_velocity).max() < 1e-6


def test_it_learns_the_bias_of_the_gyroscope_while_still_and_of_nothing_else():
    bench = BlockBench(ComplementaryFilter, robot="bruce")
    stand(bench, 300, gyro=(0.01, -0.01, 0.005))
    assert bench.get("estimate").gyro_bias == pytest.approx([0.01, -0.01, 0.005], abs=1e-3)
    assert not bench.get("estimate").accelerometer_bias.any()


def test_the_legs_move_the_base():
    """A squat at constant speed, with an IMU that reads a fall too slow to be a flight."""
    bench = BlockBench(
        ComplementaryFilter, {"velocity_gain": 112.0, "position_gain": 112.0}, robot="bruce"
    )
    stand(bench, 100)
    for tick in range(250):
        joints, after = flexed(0.001 * tick), flexed(0.001 * (tick + 1))
        bench.set("joints", position=joints, velocity=(after - joints) / PERIOD)
        bench.step()
    moved = base_over_the_soles(flexed(0.249))
    speed = (base_over_the_soles(flexed(0.25)) - moved) / PERIOD
    assert bench.get("base").position == pytest.approx(moved, abs=3e-3)
    assert bench.get("base").linear_velocity == pytest.approx(speed, abs=0.02)


def test_it_falls_freely_in_a_ballistic_flight():
    bench = BlockBench(ComplementaryFilter, {"flight": "ballistic"}, robot="bruce")
    stand(bench, 100)
    bench.set("contacts", active=False)
    bench.set("imu", specific_force=[0.0, 0.0, 0.0])
    bench.step(100)
    assert bench.get("base").linear_velocity[2] == pytest.approx(-9.81 * 0.2, abs=0.02)
