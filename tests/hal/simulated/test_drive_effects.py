"""Encoders, motors, gears and pack of a simulated robot, against closed forms."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.files.problems import LoadError
from aloft.hal.simulated.battery import Battery
from aloft.hal.simulated.drive_effects import EncoderDelays, MotorLosses
from aloft.hal.simulated.drives import MotorLimits
from aloft.hal.simulated.effects import (
    BatteryParameters,
    EncoderEffects,
    GearParameters,
    MotorEffects,
    longest_gear_step,
)
from aloft.hal.simulated.gears import YieldingGears
from aloft.hal.simulated.state import PhysicsState, TickRecord
from aloft.mathematics.compiling.call_sequence import CallSequence
from aloft.robots.description import RobotDescription, find_robot

from .simulated_bruce import bench, hold

ROBOT = find_robot("bruce")
N = len(ROBOT.joints)
STEP = 0.0005
SIZES = dict.fromkeys(
    ("n_integration", "n_random", "n_imu_filters", "n_imu_slots", "n_imu_axes", "n_encoder_slots",
     "n_sensed_joints", "n_real_motors", "n_rotors", "n_late_switches", "n_battery", "n_gantry", "n_windings"), 0,
)  # fmt: skip


def memory_of(**sizes: int) -> PhysicsState:
    return PhysicsState.allocate({**SIZES, **sizes})


def reader(**encoders: Any) -> Any:
    """What the encoders read of a joint motion and torque."""
    effects = EncoderEffects.model_validate(encoders)
    memory = memory_of(**EncoderDelays.dimensions(ROBOT, effects, STEP))
    true = SimpleNamespace(q=np.zeros(N), v=np.zeros(N), torque=np.zeros(N))
    call = EncoderDelays(ROBOT, effects, 5, STEP, memory).sense_call(true.q, true.v, true.torque)

    def read(q: float, v: float, torque: float = 0.0) -> tuple[float, float]:
        true.q[:], true.v[:], true.torque[:] = q, v, torque
        call.run()
        return float(memory.encoder_position[0]), float(memory.encoder_velocity[0])

    return read


def giver(velocity: float = 0.0, angle: float = 0.0, **motors: Any) -> Any:
    """What the motors give of the torques that are asked of them."""
    losses = MotorLosses(
        ROBOT, MotorEffects.model_validate(motors), 5, STEP, memory_of(n_real_motors=N)
    )
    position, speed = np.full(N, angle), np.full(N, velocity)
    asked, torque = np.zeros(N), np.zeros(N)
    call = losses.produce_call(position, speed, asked, torque)

    def give(requested: np.ndarray | float) -> np.ndarray:
        asked[:] = requested
        torque[:] = ROBOT.joint_to_motor.T @ asked
        call.run()
        given: np.ndarray = np.linalg.solve(ROBOT.joint_to_motor.T, torque)
        return given

    return give


def test_encoders_are_late() -> None:
    read = reader(delay=3 * STEP)
    seen = [read(0.1 * k, 1.0 * k) for k in range(10)]
    np.testing.assert_allclose(seen[8], (0.5, 5.0))


def test_the_velocity_is_filtered_and_the_angle_is_not() -> None:
    read = reader(velocity_filter=0.002)
    read(0.0, 0.0)
    for k in range(1, 20):
        angle, velocity = read(0.7, 1.0)
        assert angle == 0.7
        assert velocity == pytest.approx(1.0 - math.exp(-k * STEP / 0.002))


def test_a_gear_before_the_encoder_yields_and_has_play() -> None:
    assert ROBOT.motors.gear_play.tolist() == [0.01] * N
    read = reader(compliance=0.002, backlash=1.0)
    assert read(0.3, 0.0, 0.0)[0] == 0.3
    for torque in (5.0, -5.0):
        seen = [read(0.3, 0.0, torque)[0] for _ in range(100)]
        end = 0.3 + math.copysign(0.01 + 0.005, torque)
        assert seen[-1] == pytest.approx(end, abs=1e-6)
        assert abs(seen[4] - end) > 0.002, "a rotor takes time to cross its play"


def test_an_eccentric_encoder_errs_once_a_turn() -> None:
    read = reader(eccentricity=0.01)
    angles = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)
    errors = np.array([read(angle, 0.0)[0] - angle for angle in angles])
    assert abs(errors.mean()) < 1e-9
    assert errors.std() == pytest.approx(0.01 / math.sqrt(2.0))


def test_torque_constants_differ_and_the_drive_does_not_know() -> None:
    give = giver(torque_constant_spread=0.05)
    factors = give(2.0) / 2.0
    assert len(set(factors.round(9))) == N and (abs(factors - 1.0) <= 0.05).all()
    np.testing.assert_allclose(give(-4.0) / -4.0, factors)


def test_iron_saturates_with_the_square_of_the_torque() -> None:
    give, peak = giver(saturation=0.2), np.array(ROBOT.motors.peak_torque)
    np.testing.assert_allclose(give(peak), 0.8 * peak)
    np.testing.assert_allclose(give(-0.5 * peak), -0.5 * 0.95 * peak)


def test_the_current_follows_its_loop() -> None:
    give = giver(current_bandwidth=100.0)
    for k in range(1, 10):
        expected = 3.0 * (1.0 - math.exp(-2.0 * math.pi * 100.0 * k * STEP))
        np.testing.assert_allclose(give(3.0), expected)


def test_the_current_is_limited() -> None:
    np.testing.assert_allclose(giver(torque_limit=7.0)(9.0), 7.0)
    np.testing.assert_allclose(giver(torque_limit=7.0)(-9.0), -7.0)


def test_ripple_has_its_amplitude_and_no_mean() -> None:
    turn, peak = 2.0 * math.pi / 12, float(ROBOT.motors.peak_torque[4])
    given = np.array([
        giver(angle=float(angle), ripple=0.1 / peak, ripple_periods=12)(1.0)[4] - 1.0
        for angle in np.linspace(0.0, turn, 32, endpoint=False)
    ])  # fmt: skip
    assert abs(given.mean()) < 1e-9 and abs(given).max() == pytest.approx(0.1, rel=0.02)


def test_cogging_pulls_at_rest_and_without_current() -> None:
    turn, peak = 2.0 * math.pi / 12, np.array(ROBOT.motors.peak_torque)
    angles = np.linspace(0.0, turn, 32, endpoint=False)
    given = np.array([giver(angle=float(a), cogging=0.02, cogging_periods=12)(0.0) for a in angles])
    turned = np.array(ROBOT.joint_to_motor @ np.ones(N))
    turns = abs(turned) > 0.5
    amplitude = abs(given).max(axis=0)[turns]
    np.testing.assert_allclose(amplitude, 0.02 * peak[turns], rtol=0.05)
    assert abs(given.mean(axis=0)[turns]).max() < 1e-9
    phases = given[:, turns].argmax(axis=0)
    assert len(set(phases.tolist())) > 1, "each motor has a phase of its own"


@pytest.mark.long
@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"motors": {"cogging": 0.01, "cogging_periods": 500}}, "cogging of 500 periods a turn changes"),
        ({"motors": {"ripple": 0.01, "ripple_periods": 500}}, "torque ripple of 500 periods a turn"),
        (
            {"joints": {"static_friction": 3.0, "stribeck_velocity": 0.01}},
            "static friction of 3 times that in motion falls faster than physics steps of 0.0005 s",
        ),
    ],
)  # fmt: skip
def test_what_changes_within_a_step_is_refused(effects: Any, message: str) -> None:
    with pytest.raises(Exception, match=message):
        bench(**effects)
    bench(**effects, timestep=1e-5)


@pytest.mark.parametrize("velocity", [-5.0, 5.0])
def test_load_friction_opposes_the_motion_and_takes_its_share(velocity: float) -> None:
    give = giver(velocity=velocity, load_friction=0.05)
    turning = np.sign(ROBOT.joint_to_motor @ np.full(N, velocity))
    moving = abs(ROBOT.joint_to_motor @ np.full(N, velocity)) > 1.0
    np.testing.assert_allclose(give(4.0)[moving], (4.0 - 0.2 * turning)[moving], rtol=1e-6)


def gears(inertia: float, step: float, **params: Any) -> tuple[YieldingGears, PhysicsState]:
    chosen = GearParameters.model_validate(params)
    memory = PhysicsState.allocate({**SIZES, "n_rotors": N})
    return YieldingGears(chosen, ROBOT, np.full(N, inertia), step, memory), memory


def test_two_bodies_swing_with_the_period_of_the_closed_form() -> None:
    """A rotor and a link of inertia J, without torque, swing with w^2 = k (1 / I + 1 / J)."""
    stiffness, rotor, link, step = 500.0, 1.6e-3, 4e-3, 2e-5
    model, memory = gears(rotor / 0.9, step, stiffness=stiffness)
    q, v, torque = np.zeros(N), np.zeros(N), np.zeros(N)
    model.begin(q)
    memory.rotor_angle[:] = 0.01
    call = model.turn_call(q, v, torque)
    matrix = ROBOT.joint_to_motor
    twists = []
    for _ in range(3000):
        torque[:] = 0.0
        call.run()
        # links of equal inertia in the motors' coordinates
        gear = np.linalg.solve(matrix.T, torque)
        v += np.linalg.solve(matrix, gear / link) * step
        q += v * step
        twists.append(memory.rotor_angle[0] - (matrix @ q)[0])
    crossings = [k for k in range(1, 3000) if twists[k - 1] < 0.0 <= twists[k]]
    period = np.diff(crossings).mean() * step
    assert period == pytest.approx(
        2 * math.pi / math.sqrt(stiffness * (1 / rotor + 1 / link)), rel=1e-3
    )
    momentum = rotor * memory.rotor_speed + link * (matrix @ v)
    np.testing.assert_allclose(momentum, 0.0, atol=1e-9)


def test_within_its_play_a_gear_passes_nothing() -> None:
    model, memory = gears(1e-3, STEP, stiffness=500.0, damping=1.0, backlash=0.02)
    q, v, torque = np.zeros(N), np.zeros(N), np.zeros(N)
    model.begin(q)
    call = model.turn_call(q, v, torque)
    for twist, passed in ((0.009, 0.0), (-0.009, 0.0), (0.012, 1.0), (-0.012, -1.0)):
        memory.rotor_angle[:], memory.rotor_speed[:], torque[:] = twist, 0.0, 0.0
        call.run()
        np.testing.assert_allclose(
            np.linalg.solve(ROBOT.joint_to_motor.T, torque), passed, atol=1e-9
        )


def test_stiff_gears_stand_like_rigid_ones() -> None:
    poses = []
    for gears_ in (None, {"stiffness": 5000.0, "damping": 0.5}):
        robot = bench(timestep=0.00005, **({"gears": gears_} if gears_ else {}))
        hold(robot)
        robot.step(50)
        robot.block.emit()
        poses.append(robot.get("truth").joint_position.copy())
    np.testing.assert_allclose(poses[1], poses[0], atol=2e-3)


def test_gears_that_are_too_stiff_for_the_steps_are_refused() -> None:
    with pytest.raises(Exception, match=r"move faster than physics steps of 0\.0005 s"):
        bench(gears={"stiffness": 20000.0})
    params = GearParameters.model_validate({"stiffness": 2000.0})
    assert longest_gear_step(params, np.full(3, 1e-3)) == pytest.approx(
        0.1 * 2 * math.pi * math.sqrt(1e-3 * 0.09 / 2000.0)
    )


def pack(
    robot: RobotDescription = ROBOT, **params: Any
) -> tuple[Battery, PhysicsState, MotorLimits, Any]:
    chosen = BatteryParameters.model_validate(params)
    memory = PhysicsState.allocate({**SIZES, "n_battery": 4})
    battery = Battery(chosen, robot, STEP, memory)
    battery.begin(np.zeros(N))
    limits = MotorLimits(ROBOT, TickRecord.allocate({**ROBOT.dimensions}))
    calls = CallSequence([battery.feed_call(limits), battery.limit_call(limits)])
    return battery, memory, limits, calls


def test_a_pack_sags_as_its_resistance_says() -> None:
    assert ROBOT.supply is not None
    cold = ROBOT.changed(supply=ROBOT.supply.model_copy(update={"winding_resistance": 0.0}))
    battery, memory, limits, call = pack(cold, open_voltage=16.0, resistance=0.04, board_power=0.0)
    limits.scratch.torque[:], limits.scratch.speed[:] = 4.0, 20.0
    call.run()
    power, voltage = 4.0 * 20.0 * N, float(battery.voltage[0])
    assert voltage * memory.battery[3] == pytest.approx(power)
    assert voltage == pytest.approx(16.0 - 0.04 * memory.battery[3])
    ratio = voltage / 14.8
    np.testing.assert_allclose(limits.motors.no_load, ratio * ROBOT.motors.no_load_speed)
    corner = limits.motors.no_load - limits.motors.peak / limits.motors.slope
    np.testing.assert_allclose(corner, ratio * ROBOT.motors.corner_speed)
    limits.scratch.torque[:] = -4.0  # braking charges it
    call.run()
    assert battery.voltage[0] > 15.9 and memory.battery[3] < 0.0


def test_copper_heat_follows_from_speeds_where_no_winding_is_known() -> None:
    """Behind its torque constant k = U / w0 a winding of resistance R = U (1 - wc / w0) k / T lets the torque T flow up
    to the corner speed wc, and heats by R / k^2 for the torque squared."""
    motors = ROBOT.motors
    assert ROBOT.supply is not None
    voltage, free, corner = ROBOT.supply.rated_voltage, motors.no_load_speed, motors.corner_speed
    constant = voltage / free
    winding = voltage * (1.0 - corner / free) * constant / motors.peak_torque
    unknown = ROBOT.supply.model_copy(update={"winding_resistance": None})
    np.testing.assert_allclose(unknown.heating(motors), winding / constant**2)
    np.testing.assert_allclose(ROBOT.supply.heating(motors), 0.2 / 0.35**2)


def test_a_robot_whose_supply_nobody_described_has_no_pack() -> None:
    graph = Path(aloft.__file__).parent / "graphs" / "robots" / "a1_stand.yaml"
    with pytest.raises(LoadError) as caught:
        aloft.load(graph, overrides={"robot.actuators.battery": {}})
    text = str(caught.value)
    assert "the description of a1 does not say what feeds it" in text
    assert "supply: {rated_voltage: ..., open_voltage:" in text


def test_beyond_what_a_pack_can_give_its_voltage_is_half() -> None:
    battery, _, limits, call = pack(open_voltage=16.0, resistance=1.0)
    limits.scratch.torque[:], limits.scratch.speed[:] = 10.0, 30.0
    call.run()
    assert battery.voltage[0] == pytest.approx(8.0, rel=1e-3)


def test_a_pack_empties_and_recovers() -> None:
    battery, memory, _, call = pack(
        open_voltage=16.0, resistance=0.0, recovery_resistance=0.1, recovery_time=0.1,
        board_power=160.0, capacity=100.0, fall=2.0,
    )  # fmt: skip
    for _ in range(2000):
        call.run()
    charge, recover = memory.battery[1], memory.battery[2]
    assert charge == pytest.approx(10.5, rel=0.05)
    assert recover == pytest.approx(0.1 * memory.battery[3], rel=0.02)
    assert battery.voltage[0] == pytest.approx(16.0 - 2.0 * charge / 100.0 - recover, rel=1e-3)


def test_the_voltage_of_the_pack_is_reported() -> None:
    robot = bench(battery={"open_voltage": 15.0})
    hold(robot)
    robot.step(5)
    robot.block.emit()
    voltage = robot.get("health").voltage
    assert (voltage == voltage[0]).all() and 13.0 < voltage[0] < 15.0


def test_a_play_that_multiplies_zero_is_told() -> None:
    from aloft.hal.simulated.mujoco_robot import MujocoRobot
    from aloft.runtime.testing.bench import BlockBench

    backlash = {"sensors": {"encoders": {"backlash": 0.1}}}
    told = BlockBench(MujocoRobot, backlash, robot="solo12").block.warnings()
    assert "sensors.encoders.backlash: 0.1 does nothing" in told[0] and "gear_play" in told[0]
    assert not BlockBench(MujocoRobot, backlash, robot="bruce").block.warnings()
    assert not BlockBench(MujocoRobot, robot="solo12").block.warnings()
