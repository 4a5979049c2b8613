"""The IMU of a simulated robot reads what its place, mount, filter and delay let through."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aloft.hal.simulated.effects import ImuEffects
from aloft.hal.simulated.imu_effects import ImuModel
from aloft.hal.simulated.state import PhysicsState

from .simulated_bruce import bench, hold, lift

STEP = 0.0005


def unit(**effects: Any) -> tuple[ImuModel, Any]:
    """A unit on its own, and a function that gives what it reads of a rate and a force."""
    chosen = ImuEffects.model_validate(effects)
    memory = PhysicsState.allocate({**dict.fromkeys(SIZES, 0), **ImuModel.dimensions(chosen, STEP)})
    model = ImuModel(chosen, 3, STEP, memory)
    rate, force = np.zeros(3), np.zeros(3)
    call = model.read_call(rate, force)

    def read(new_rate: Any, new_force: Any) -> tuple[np.ndarray, np.ndarray]:
        rate[:], force[:] = new_rate, new_force
        call.run()
        return model.rate.copy(), model.force.copy()

    return model, read


SIZES = (
    "n_integration", "n_random", "n_encoder_slots", "n_sensed_joints", "n_real_motors", "n_rotors",
    "n_late_switches", "n_battery", "n_gantry", "n_windings",
)  # fmt: skip


@pytest.mark.parametrize(("gyro", "accelerometer"), [(0, 4), (3, 0), (2, 2)])
def test_each_sensor_is_late_by_its_own_delay(gyro: int, accelerometer: int) -> None:
    _, read = unit(gyro_delay=gyro * STEP, accelerometer_delay=accelerometer * STEP,
                   mount_damping=0.2)  # fmt: skip
    rates, forces = zip(*(read([k, 0, 0], [0, 10 * k, 0]) for k in range(20)), strict=True)
    for k in range(5, 20):
        assert rates[k][0] == k - gyro and forces[k][1] == 10 * (k - accelerometer)


@pytest.mark.parametrize("frequency", [30.0, 100.0, 200.0])
def test_at_its_bandwidth_the_filter_halves_the_power_and_turns_by_a_quarter(
    frequency: float,
) -> None:
    _, read = unit(bandwidth=frequency)
    count = 4000
    time = STEP * np.arange(count)
    turning = 2.0 * math.pi * frequency * time
    seen = np.array([read([math.sin(x), 0, 0], [0, 0, 0])[0][0] for x in turning])[count // 2 :]
    sine, cosine = np.sin(turning[count // 2 :]), np.cos(turning[count // 2 :])
    fit = np.linalg.lstsq(np.stack([sine, cosine], axis=1), seen, rcond=None)[0]
    assert np.linalg.norm(fit) == pytest.approx(math.sqrt(0.5), rel=1e-3)
    assert math.atan2(fit[1], fit[0]) == pytest.approx(-0.5 * math.pi, abs=1e-2)


def test_a_mount_rings_at_its_frequency() -> None:
    _, read = unit(mount_frequency=80.0, mount_damping=0.05)
    read([0, 0, 0], [0, 0, 0])
    seen = np.array([read([0, 0, 0], [0, 0, 1.0])[1][2] for _ in range(400)])
    assert 1.7 < seen.max() < 1.95  # 1 + exp(-pi d / sqrt(1 - d^2)) = 1.85
    peaks = [k for k in range(1, 399) if seen[k - 1] < seen[k] > seen[k + 1]]
    assert np.diff(peaks).mean() * STEP == pytest.approx(1.0 / 80.0, rel=0.02)
    assert seen[-1] == pytest.approx(1.0, abs=0.01)


def test_constant_motion_passes_filters_unchanged_from_the_first_sample() -> None:
    _, read = unit(mount_frequency=200.0, bandwidth=50.0)
    for _ in range(5):
        rate, force = read([0.1, -0.2, 0.3], [0.0, 1.0, 9.81])
        np.testing.assert_allclose(rate, [0.1, -0.2, 0.3], rtol=1e-12)
        np.testing.assert_allclose(force, [0.0, 1.0, 9.81], rtol=1e-12)


def test_scale_and_sensitivity_are_drawn_per_axis_and_within_their_spread() -> None:
    _, read = unit(gyro_scale_spread=0.02, accelerometer_scale_spread=0.01)
    rate, force = read([1.0, 1.0, 1.0], [1.0, 1.0, 1.0])
    assert len({*rate, *force}) == 6
    assert (abs(rate - 1.0) <= 0.02).all() and (abs(force - 1.0) <= 0.01).all()
    _, read = unit(acceleration_sensitivity=1e-3)
    rate, _ = read([0.0, 0.0, 0.0], [10.0, 10.0, 0.0])
    assert (abs(rate[:2]) > 0.0).all() and (abs(rate[:2]) <= 1e-2).all() and rate[2] == 0.0


def test_a_turned_unit_reads_gravity_and_rates_in_its_own_axes() -> None:
    angle = 0.1
    robot = bench(imu={"rotation": [angle, 0.0, 0.0]})
    hold(robot)
    robot.step(200)
    robot.block.emit()
    force = robot.get("imu").specific_force
    expected = [0.0, 9.81 * math.sin(angle), 9.81 * math.cos(angle)]
    np.testing.assert_allclose(force, expected, atol=0.03)


def test_a_unit_off_the_axis_feels_the_turning() -> None:
    """In free fall at a constant rate, force is w x (w x r) where the unit is, as that of a rigid body."""
    place = np.array([0.03, -0.02, 0.05])
    readings = []
    for position in ([0.0, 0.0, 0.0], place.tolist()):
        robot = bench(imu={"position": position, "mount_damping": 0.2})
        lift(robot)
        data: Any = robot.block.plant.data
        data.qvel[3:6] = [0.0, 3.0, 1.0]
        robot.block.save_state()
        robot.block.load_state()
        robot.set("command", mode=0)
        robot.step(1)
        robot.block.emit()
        rate = robot.get("imu").angular_velocity.copy()
        readings.append((robot.get("imu").specific_force.copy(), rate))
    (middle, rate), (off, _) = readings
    turning = np.cross(rate, np.cross(rate, place))
    assert np.linalg.norm(turning) > 0.2
    # what is left is the angular acceleration of a body whose legs swing
    assert np.linalg.norm(off - middle - turning) < 0.5 * np.linalg.norm(turning)


def test_draws_repeat_with_the_seed_only() -> None:
    found = []
    for seed in (1, 1, 2):
        robot = bench(seed=seed, imu={"delay_spread": 0.002, "gyro_delay": 0.003})
        (imu,) = robot.block.plant.effects
        found.append(imu.delays)
    first, again, other = found
    assert first == again != other


def test_a_filter_that_the_steps_are_too_long_for_is_refused() -> None:
    with pytest.raises(
        Exception, match=r"physics steps of 0\.0005 s the IMU has no filter of 950 Hz"
    ):
        bench(imu={"bandwidth": 950.0})
