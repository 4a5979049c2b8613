"""Two robots are drawn, and found: every error is within its interval.

Where the feet do not stand nothing is found, and the values become a fragment of a graph.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import aloft
from aloft.blocks.jumping.guided_motion import GuidedBody, GuidedMotion
from aloft.extensions.commissioning.identification.calibration import (
    Calibration,
    calibration_of,
    fragment,
)
from aloft.extensions.commissioning.identification.identification import (
    Estimate,
    IdentificationError,
    MeasuredRun,
)
from aloft.extensions.commissioning.identification.motor_identification import (
    EVERY,
    PERIODS,
    IdentifiedMotors,
    most_alike,
    waves_of,
)
from aloft.extensions.commissioning.identification.robot_calibration import calibration_from, swayed
from aloft.extensions.commissioning.identification.sensor_identification import (
    EDGE,
    IdentifiedSensors,
    base_motion,
    contact_jacobians,
    fit,
    identify_sensors,
    shifted,
    smooth,
    standing_span,
    vertical,
)
from aloft.hal.simulated.variation import draw_variation
from aloft.lab.studies.oracle import oracle_values, reading_ages
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.runtime.loading.reading.files import graph_path

GRAPH = graph_path("aloft:commissioning/calibrate")
ROBOT = find_robot("bruce")


def found_and_true(seed: int) -> tuple[Calibration, dict[str, object]]:
    graph = aloft.load(GRAPH).with_seed(seed)
    found = calibration_from(swayed(graph))
    params = next(block.params for block in graph.checked.blocks if block.path == "robot")
    drawn, pack = draw_variation(params, ROBOT), params.actuators.battery.of(ROBOT)
    factors = [drawn.joint_friction * each for each in drawn.friction_of_joint]
    return found, {
        "place": drawn.imu.position, "angle": drawn.imu.to_axes,
        "ages": reading_ages(params),
        "friction": np.array(factors) * ROBOT.motors.friction,
        "constants": list(oracle_values(graph)["robot.motor_model.torque_constant"].values()),
        "resistance": pack.resistance, "voltage": pack.open_voltage,
    }  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("seed", [97001, 97002])
def test_a_drawn_robot_is_found(seed: int) -> None:
    found, true = found_and_true(seed)
    for value, place in zip(found.imu_position, true["place"], strict=True):
        assert value.value == pytest.approx(place, abs=max(0.003, 3.0 * value.std))
    for value, angle in zip(found.imu_rotation, true["angle"], strict=True):
        assert value.value == pytest.approx(angle, abs=max(0.006, 3.0 * value.std))
    ages = true["ages"]
    assert found.gyro_age.value == pytest.approx(ages.rate, abs=4e-4)
    assert found.velocity_age.value == pytest.approx(ages.velocity, abs=3e-4)
    assert found.open_voltage is not None and found.resistance is not None
    assert found.open_voltage.value == pytest.approx(true["voltage"], rel=0.01)
    assert found.resistance.value == pytest.approx(true["resistance"], rel=0.1)
    for (name, value), friction in zip(found.friction.items(), true["friction"], strict=True):
        assert value.value == pytest.approx(friction, abs=3.0 * value.std), name
    for periods in (60.0, 72.0):
        assert min(abs(each - periods) for each in found.ripple_periods) <= 2.0
    for value, constant in zip(found.torque_constant.values(), true["constants"], strict=True):
        assert value.value == pytest.approx(constant, abs=3.0 * value.std)
    values = yaml.safe_load(fragment(ROBOT, found, "a run"))["set"]
    assert set(values["timing.play"]) == {joint.name for joint in ROBOT.joints}
    assert set(values["robot.motor_model.torque_constant"]) == set(ROBOT.transmission.motors)


@pytest.mark.long
def test_gears_that_yield_are_told() -> None:
    """Rotor and joint are two bodies, and the encoder is on the rotor, behind play."""
    graph = aloft.load(GRAPH, [
        "robot.seed=97822", "duration=12 s", "plan.sway_time=10 s", "robot.timestep=0.25 ms",
        "robot.actuators.gears={stiffness: 1000 N m/rad, damping: 0.3 N m s/rad}",
    ])  # fmt: skip
    compliance = identify_sensors(ROBOT, swayed(graph).motion).gear_compliance
    assert compliance.value == pytest.approx(1e-3, abs=2.0 * compliance.std)
    assert compliance.value > 3.0 * compliance.std


def standing(ticks: int) -> MeasuredRun:
    still = np.zeros((ticks, 10))
    return MeasuredRun(
        0.002, np.tile(ROBOT.standing_position, (ticks, 1)), still, still, np.zeros((ticks, 3)),
        np.tile([0.0, 0.0, 9.81], (ticks, 1)), np.zeros((ticks, 3)),
        np.ones((ticks, len(ROBOT.contacts)), dtype=np.bool_),
    )  # fmt: skip


def test_a_robot_in_the_air_or_that_stands_too_short_is_refused() -> None:
    motion = standing(2000)
    assert standing_span(ROBOT, motion) == slice(0, 2000)
    with pytest.raises(IdentificationError, match="never stands"):
        standing_span(ROBOT, replace(motion, closed=np.zeros_like(motion.closed)))
    with pytest.raises(IdentificationError, match="less than 3 s"):
        standing_span(ROBOT, standing(1000))


def test_one_bouncing_switch_ends_no_stance() -> None:
    motion = standing(2000)
    motion.closed[::2, 0] = False
    assert standing_span(ROBOT, motion) == slice(0, 2000)


def test_switches_too_heavy_for_their_loads_end_no_stance() -> None:
    motion = standing(4000)
    of_foot = np.array([contact.foot for contact in ROBOT.contacts]) == ROBOT.feet[0].name
    motion.closed[:, of_foot] = np.arange(4000)[:, None] % 1000 < 500  # the load sways to and fro
    motion.closed[:, ~of_foot] = np.arange(4000)[:, None] % 1000 > 400
    assert standing_span(ROBOT, motion) == slice(0, 4000)
    motion.closed[2400:] = False
    assert standing_span(ROBOT, motion).stop < 2500


def test_the_filter_is_not_late_and_a_shift_is() -> None:
    time = 0.002 * np.arange(2000)
    wave = np.sin(2.0 * math.pi * time)[:, None]
    inner = slice(200, -200)
    np.testing.assert_allclose(smooth(wave, 0.002)[inner], wave[inner], atol=1e-3)
    later = np.sin(2.0 * math.pi * (time + 0.003))[:, None]
    np.testing.assert_allclose(shifted(wave, 1.5)[inner], later[inner], atol=1e-3)


def test_the_filter_is_that_of_scipy() -> None:
    """``sosfiltfilt`` of a Butterworth filter of the third order, to the last digits."""
    from scipy.signal import butter, sosfiltfilt

    values = np.cumsum(np.random.default_rng(1).normal(size=(3000, 4)), axis=0)
    sections = butter(3, 2.0 * 6.0 * 0.002, output="sos")
    np.testing.assert_allclose(
        smooth(values, 0.002, 6.0), sosfiltfilt(sections, values, axis=0), rtol=0.0, atol=1e-10
    )


def test_the_base_moves_as_least_squares_says() -> None:
    """Tick by tick, of joints that contradict each other, too."""
    random = np.random.default_rng(2)
    angles = ROBOT.standing_position + 0.1 * random.normal(size=(3, 10))
    speeds = random.normal(size=(3, 10))
    moves, places = base_motion(ROBOT, angles, speeds)
    jacobians, points = contact_jacobians(ROBOT, angles)
    for k in range(3):
        own = np.linalg.lstsq(jacobians[k, :, :6], -jacobians[k, :, 6:] @ speeds[k])[0]
        np.testing.assert_allclose(moves[k], own, rtol=1e-10)
    np.testing.assert_allclose(places, points.mean(axis=1), rtol=1e-14)


@pytest.mark.parametrize("name", ["bruce", "go2", "g1"])
def test_the_base_moves_as_it_was_guided(name: str) -> None:
    """Feet that are balls roll: another model of the feet, by which sways are planned, says the same."""
    robot = find_robot(name)
    body = GuidedBody(build_pinocchio_model(robot), robot)
    q = body.standing(robot.standing_position)
    zero, still = np.zeros(3), np.zeros((len(robot.feet), 3))
    motion = GuidedMotion(
        zero, np.array([0.05, 0.03, -0.08]), zero, np.array([0.3, 0.4, 0.2]), zero, (False,) * 3, still
    )  # fmt: skip
    for _ in range(20):
        v = body.velocity(q, motion)
        moves, _ = base_motion(robot, q[None, 7:], v[None, 6:])
        np.testing.assert_allclose(moves[0], v[:6], atol=1e-4)
        q = body.integrate(q, 0.01 * v)


def test_joints_that_are_held_tell_nothing() -> None:
    robot = find_robot("g1")
    names = [joint.name for joint in robot.joints]
    one, three = Estimate(0.5, 0.1), (Estimate(0.0, 0.1),) * 3
    every = dict.fromkeys(names, one)
    sensors = IdentifiedSensors(three, three, one, one, one, every, one, {})
    motors = IdentifiedMotors(
        dict.fromkeys(robot.transmission.motors, one), one, one, one, every, every, one, {}, ()
    )
    found = calibration_of(robot, sensors, motors, None, None)
    for name, friction, play in zip(
        names, robot.motors.friction, robot.motors.gear_play, strict=True
    ):
        held = name in robot.held
        assert found.friction[name].value == (friction if held else 0.5)
        assert found.play[name].value == (play if held else 0.5)


def test_the_vertical_turns_against_the_base() -> None:
    turning = np.random.default_rng(4).normal(size=(200, 3))
    up, tilts, drifts = vertical(turning, 0.002)
    turned, drift = Rotation.identity(), np.zeros((3, 3))
    for k, (here, after) in enumerate(pairwise(turning)):
        matrix = turned.as_matrix()
        np.testing.assert_allclose(up[k], matrix[2], atol=1e-12)
        across = np.cross(np.eye(3), [0.0, 0.0, 1.0]).T  # of z with each axis, negated
        np.testing.assert_allclose(tilts[k], -(matrix.T @ across)[:, :2], atol=1e-12)
        np.testing.assert_allclose(drifts[k], -(matrix.T @ across @ drift), atol=1e-12)
        drift = drift + 0.002 * matrix
        turned = turned * Rotation.from_rotvec(0.5 * (here + after) * 0.002)


def test_a_foot_that_rocks_spoils_no_fit() -> None:
    """Errors that are large now and then count less; those that are always there, as least squares says."""
    random = np.random.default_rng(7)
    rows, truth = random.normal(size=(4000, 3, 2)), np.array([0.7, -0.3])
    noise = 0.01 * random.normal(size=(4000, 3))
    prior = np.ones(2)
    clean, covariance, left = fit(rows, rows @ truth + noise, prior, 0.002, 0.002)
    np.testing.assert_allclose(clean, truth, atol=4.0 * math.sqrt(covariance.max()))
    assert left == pytest.approx(0.01, rel=0.05)
    rocking = noise + np.where(np.arange(4000)[:, None] % 40 < 4, 0.5, 0.0)
    found, _, _ = fit(rows, rows @ truth + rocking, prior, 0.002, 0.002)
    np.testing.assert_allclose(found, truth, atol=2e-3)


@pytest.mark.long
def test_ripple_is_found_by_how_often_it_comes_again() -> None:
    """In two of ten motors, below noise of the same size."""
    random, time = np.random.default_rng(3), 0.002 * np.arange(10_000)
    turned = 0.2 * np.sin(np.outer(time, np.linspace(1.0, 4.0, 10)))
    edge = round(EDGE / 0.002)
    at = slice(edge, len(time) - edge, EVERY)
    error = 0.05 * random.normal(size=turned[at].shape)
    error[:, :2] += 0.07 * np.sin(84.0 * turned[at, :2] + 1.0)
    waves = {float(often): waves_of(turned, float(often), 0.002) for often in PERIODS}
    assert most_alike(error, waves) == pytest.approx(84.0, abs=2.0)


def test_readings_of_slow_motions_are_as_old_as_the_simulator_makes_them() -> None:
    params = next(b.params for b in aloft.load(GRAPH).checked.blocks if b.path == "robot")
    step = params.timestep
    sensors = params.sensors.model_copy(update={
        "imu": params.sensors.imu.model_copy(update={"bandwidth": None, "gyro_delay": 0.0, "accelerometer_delay": 0.0}),
        "encoders": params.sensors.encoders.model_copy(update={"delay": 0.0, "velocity_filter": 0.0}),
    })  # fmt: skip
    exact = params.model_copy(update={"sensors": sensors})
    rate, _, position, velocity = reading_ages(exact)
    assert (rate, position, velocity) == (0.5 * step, 0.0, 0.5 * step)
    late = sensors.encoders.model_copy(update={"velocity_filter": 2e-3})
    filtered = params.model_copy(update={"sensors": sensors.model_copy(update={"encoders": late})})
    # a filter of the first order, sampled, is late by its time constant less about half a step
    assert reading_ages(filtered).velocity == pytest.approx(2e-3, abs=0.05 * step)
