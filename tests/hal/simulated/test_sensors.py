"""The simulated sensors have the noise, bias, range and bounce that their parameters state."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from .simulated_bruce import bench, hold, lift


def test_standing_sensors_have_the_stated_noise_and_bias() -> None:
    robot = bench(
        gyro_noise=0.02, gyro_bias=0.01, accelerometer_noise=0.1, joint_velocity_noise=0.05
    )
    hold(robot)
    gyro, accelerometer, velocity = [], [], []
    for _ in range(1000):
        robot.step()
        gyro.append(robot.get("imu").angular_velocity.copy())
        accelerometer.append(robot.get("imu").specific_force.copy())
        velocity.append(robot.get("joints").velocity.copy())
    np.testing.assert_allclose(np.std(gyro, axis=0), 0.02, rtol=0.08)
    np.testing.assert_allclose(np.std(accelerometer, axis=0), 0.1, rtol=0.08)
    np.testing.assert_allclose(np.std(velocity, axis=0), 0.05, rtol=0.1)
    bias = np.mean(gyro, axis=0)
    assert (np.abs(bias) < 0.01 + 3 * 0.02 / np.sqrt(1000)).all()
    assert np.abs(bias).max() > 3 * 0.02 / np.sqrt(1000)
    white = np.array(gyro)[:, 0] - bias[0]
    assert abs(np.mean(white[1:] * white[:-1])) < 4 * 0.02**2 / np.sqrt(1000)


@pytest.mark.long
def test_biases_of_many_seeds_fill_their_range() -> None:
    offsets = []
    for seed in range(30):
        robot = bench(seed=seed, encoder_offset=0.003)
        robot.block.emit()
        offsets.append(robot.get("joints").position - robot.get("truth").joint_position)
    spread = np.abs(offsets)
    assert spread.max() <= 0.003 and spread.max() > 0.0028
    assert np.mean(spread) == pytest.approx(0.0015, abs=0.0002)


def test_another_noise_seed_is_another_run_of_the_same_robot() -> None:
    errors = {"encoder_offset": 0.003, "gyro_noise": 0.02, "gyro_bias": 0.01, "mass_spread": 0.05}
    attitude = {"initial_attitude_error": 0.01, "random_start_phase": True}
    first, second, same = (
        bench(seed=4, noise_seed=noise, **errors, **attitude) for noise in (1, 2, 4)
    )
    plain = bench(seed=4, **errors, **attitude)
    robots = [first, second, same, plain]
    assert len({robot.block.plant.variation for robot in robots}) == 1  # type: ignore[attr-defined]
    offsets = [robot.block.plant.sensors.encoder_offset for robot in robots]  # type: ignore[attr-defined]
    np.testing.assert_array_equal(offsets, [offsets[0]] * 4)
    for robot in robots:
        hold(robot)
        robot.step(20)
    rates = [robot.get("imu").angular_velocity for robot in robots]
    np.testing.assert_array_equal(rates[2], rates[3])
    assert not np.array_equal(rates[0], rates[1])
    assert not np.array_equal(
        first.get("truth").base_orientation, second.get("truth").base_orientation
    )


def test_switching_one_noise_off_leaves_the_others_as_they_were() -> None:
    noise = {"gyro_noise": 0.02, "joint_velocity_noise": 0.05, "encoder_offset": 0.003,
             "jitter": 0.0005, "gyro_bias": 0.01}  # fmt: skip
    with_noise, without = bench(**noise, accelerometer_noise=0.1), bench(**noise)
    for robot in (with_noise, without):
        hold(robot)
        robot.step(20)
    for port, name in (("imu", "angular_velocity"), ("joints", "velocity"), ("joints", "position")):
        np.testing.assert_array_equal(
            getattr(with_noise.get(port), name), getattr(without.get(port), name)
        )
    assert not np.array_equal(
        with_noise.get("imu").specific_force, without.get("imu").specific_force
    )


def test_saturating_and_rounding_sensors() -> None:
    robot = bench(gyro_range=0.01, gyro_noise=0.1, accelerometer_range=5.0, encoder_resolution=0.01)
    hold(robot)
    robot.step(5)
    assert np.abs(robot.get("imu").angular_velocity).max() == 0.01
    assert robot.get("imu").specific_force[2] == 5.0
    ticks = robot.get("joints").position / 0.01
    np.testing.assert_allclose(ticks, np.rint(ticks), atol=1e-9)


def test_switches_open_in_the_air_and_chatter_when_they_bounce() -> None:
    quiet, bouncy = bench(), bench(switch_bounce=0.006)
    for robot in (quiet, bouncy):
        robot.block.emit()
        assert robot.get("contacts").closed.all()
        lift(robot)
        robot.step()
        readings = []
        for _ in range(4):
            robot.step()
            readings.append(robot.get("contacts").closed.tolist())
        assert readings[-1] == [False] * 4
        chattered = any(any(reading) for reading in readings)
        assert chattered == (robot is bouncy)


def test_threshold_is_between_its_limits_and_per_switch() -> None:
    robot = bench(switch_threshold=[0.5, 3.0], seed=1)
    thresholds: Any = robot.block.plant.sensors.switch_threshold
    assert len(set(thresholds.tolist())) == 4
    assert (thresholds >= 0.5).all() and (thresholds <= 3.0).all()


def test_thresholds_may_be_shares_of_the_weight_on_each_point() -> None:
    share = 5.118 * 9.81 / 4.0
    given = bench(switch_threshold=[0.1 * share, 0.5 * share], seed=1).block.plant
    shares = bench(switches={"threshold": [0.1, 0.5]}, seed=1).block.plant
    assert given is not None and shares is not None
    np.testing.assert_allclose(
        shares.sensors.switch_threshold, given.sensors.switch_threshold, rtol=1e-3
    )
    with pytest.raises(
        Exception, match=r"switches\.threshold must be two positive numbers in rising"
    ):
        bench(switches={"threshold": [0.5, 0.1]})
