"""Nothing wrong: the command unchanged. Anything wrong: damping, for good, with the reason."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.safety_monitor import SafetyFault, SafetyMonitor, first_bad_switch
from aloft.blocks.signals import CommandMode, DrivePhase, SwitchFault, SwitchHealth
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")
COMMAND = {
    "mode": int(CommandMode.ACTIVE),
    "torque": np.arange(10.0),
    "position": np.linspace(-1.0, 1.0, 10),
    "velocity": np.linspace(-2.0, 2.0, 10),
    "stiffness": np.full(10, 40.0),
    "damping": np.full(10, 1.0),
}


def leaning(angle):
    return [0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)]


@pytest.fixture
def bench():
    return make()


def make(**params):
    bench = BlockBench(
        SafetyMonitor,
        {"damping": 0.5, "speed_limit": 60.0, "stuck_time": 0.0, **params},
        robot="bruce",
    )
    bench.set("desired", **COMMAND)
    bench.set("base", orientation=leaning(0.1), position=[0.0, 0.0, 0.38])
    bench.set("joints", position=ROBOT.standing_position)
    bench.set("wbc", solved=True)
    return bench


def fault(bench):
    return SafetyFault(int(bench.get("state").fault))


def assert_damps(bench, reason):
    assert fault(bench) == reason
    command = bench.get("command")
    assert command.mode == CommandMode.DAMPING
    assert not command.torque.any() and not command.stiffness.any() and not command.velocity.any()
    assert (command.damping == 0.5).all()
    assert all(np.isfinite(values).all() for _, values in command)
    assert bench.block.metrics()["safety_fault"] == reason.name.lower()


def test_passes_the_command_unchanged(bench):
    bench.step(100)
    for name, value in COMMAND.items():
        assert np.array_equal(getattr(bench.get("command"), name), value)
    assert bench.block.metrics() == {"safety_fault": "none"}


def test_tilt_must_last(bench):
    bench.set("base", orientation=leaning(1.3))
    bench.step(10)
    assert fault(bench) == SafetyFault.NONE
    bench.set("base", orientation=leaning(1.1))
    bench.step()
    bench.set("base", orientation=leaning(1.3))
    bench.step(10)
    assert fault(bench) == SafetyFault.NONE
    bench.step()
    assert_damps(bench, SafetyFault.TILT)


def test_damping_is_for_good_and_the_first_reason_stays(bench):
    bench.set("base", orientation=leaning(2.0))
    bench.step(11)
    bench.set("base", orientation=leaning(0.0))
    bench.set("desired", torque=np.nan)
    bench.step(50)
    assert_damps(bench, SafetyFault.TILT)
    assert bench.block.metrics()["safety_fault_time_s"] == pytest.approx(10 / 500)


def test_a_joint_beyond_its_limit(bench):
    position = ROBOT.standing_position.copy()
    position[3] = ROBOT.joint_limits[3, 0] - 0.06
    bench.set("joints", position=position)
    bench.step(10)
    assert fault(bench) == SafetyFault.NONE
    bench.step()
    assert_damps(bench, SafetyFault.JOINT_LIMIT)


def test_different_joints_in_turn_are_not_one_that_stays_beyond(bench):
    for tick in range(40):
        position = ROBOT.standing_position.copy()
        position[3 if tick % 2 else 8] = ROBOT.joint_limits[3, 0] - 0.06
        bench.set("joints", position=position)
        bench.step()
    assert fault(bench) == SafetyFault.NONE


def test_limits_and_damping_follow_from_the_motors_or_are_given_by_joint():
    bench = BlockBench(SafetyMonitor, robot="bruce")
    peak = np.abs(ROBOT.joint_to_motor).T @ ROBOT.motors.peak_torque
    bench.set("wbc", solved=True)
    bench.set("base", orientation=leaning(0.0))
    for torque, reason in (
        (9.9 * peak, SafetyFault.NONE),
        (10.1 * peak, SafetyFault.ABSURD_COMMAND),
    ):
        bench.set("desired", **{**COMMAND, "torque": torque})
        bench.step()
        assert fault(bench) == reason
    assert bench.get("command").damping == pytest.approx(peak / 20.0)
    patterns = {"*": 60.0, "*_knee": 5.0}
    for joint, reason in ((2, SafetyFault.NONE), (3, SafetyFault.JOINT_SPEED)):
        bench = make(speed_limit=patterns)
        velocity = np.zeros(10)
        velocity[joint] = 6.0
        bench.set("joints", velocity=velocity)
        bench.step(11)
        assert fault(bench) == reason


def test_a_joint_without_limits_is_never_beyond_them():
    free = ROBOT.changed(joints=tuple(j.model_copy(update={"limits": None}) for j in ROBOT.joints))
    bench = BlockBench(SafetyMonitor, {"stuck_time": 0.0}, robot=free)
    bench.set("desired", **COMMAND)
    bench.set("base", orientation=leaning(0.0))
    bench.set("wbc", solved=True)
    bench.set("joints", position=np.full(10, 50.0))
    bench.step(100)
    assert fault(bench) == SafetyFault.NONE


def test_a_joint_too_fast(bench):
    bench.set("joints", velocity=np.r_[np.zeros(9), -61.0])
    bench.step(11)
    assert_damps(bench, SafetyFault.JOINT_SPEED)


def noisy(bench, ticks, rng, **stuck):
    """Readings with noise in the last bits, but for some."""
    for _ in range(ticks):
        joints = {"velocity": 1e-9 * rng.normal(size=10)}
        imu = {
            "angular_velocity": 1e-9 * rng.normal(size=3),
            "specific_force": 9.81 + 1e-9 * rng.normal(size=3),
        }
        for name, place in stuck.items():
            values = {**joints, **imu}[name]
            values[place] = 0.0
        bench.set("joints", **joints)
        bench.set("imu", **imu)
        bench.step()


@pytest.mark.parametrize(
    ("stuck", "reason", "text"),
    [
        ({"velocity": 3}, SafetyFault.STUCK_JOINT, "joint right_knee has read the very same for 50 ms"),
        ({"angular_velocity": 1}, SafetyFault.STUCK_IMU, "gyroscope, axis y, has read the very same for 50 ms"),
        ({"specific_force": 2}, SafetyFault.STUCK_IMU, "accelerometer, axis z, has read the very same for 50 ms"),
    ],
)  # fmt: skip
def test_a_reading_that_stops_changing(stuck, reason, text):
    bench, rng = make(stuck_time=0.05), np.random.default_rng(0)
    noisy(bench, 60, rng)
    assert fault(bench) == SafetyFault.NONE
    noisy(bench, 25, rng, **stuck)  # the first of them is another value
    assert fault(bench) == SafetyFault.NONE
    noisy(bench, 1, rng, **stuck)
    assert_damps(bench, reason)
    metrics = bench.block.metrics()
    assert metrics["safety_reason"] == text and metrics["reason"].endswith(text)
    assert bench.block.context.clock.stop_reason == text
    off = make(stuck_time=0.05)
    off.set("health", state=int(DrivePhase.OFF))
    noisy(off, 60, rng, **stuck)
    assert fault(off) == SafetyFault.NONE


@pytest.mark.parametrize(
    ("share", "reason"), [(0.7, SafetyFault.NONE), (1.3, SafetyFault.NONE), (0.05, SafetyFault.TORQUE)]
)  # fmt: skip
def test_a_torque_that_does_not_follow_its_command(share, reason):
    bench = make()
    position = ROBOT.standing_position
    bench.set("desired", position=position, stiffness=np.full(10, 40.0), velocity=np.zeros(10))
    bench.set("joints", position=position - 0.01, torque=COMMAND["torque"] + 0.4)
    bench.step(50)
    assert fault(bench) == SafetyFault.NONE
    torque = COMMAND["torque"] + 0.4
    torque[8] = share * torque[8]
    bench.set("joints", torque=torque)
    bench.step(150)
    if reason == SafetyFault.NONE:
        assert fault(bench) == reason
        return
    assert_damps(bench, reason)
    metrics = bench.block.metrics()
    assert 0.2 < metrics["safety_fault_time_s"] < 0.4
    assert "joint left_knee: its torque is -" in metrics["safety_reason"]
    assert metrics["safety_reason"].endswith("N m off its command; torque_error is 80 %")


def test_a_robot_that_measures_no_torques_is_not_judged_by_them(bench):
    bench.step(200)
    assert fault(bench) == SafetyFault.NONE


@pytest.mark.parametrize(
    ("port", "field", "value"),
    [
        ("joints", "position", np.nan),
        ("joints", "velocity", np.inf),
        ("base", "orientation", np.nan),
        ("base", "linear_velocity", 11.0),
        ("base", "angular_velocity", -101.0),
        ("base", "position", np.inf),
    ],
)
def test_an_absurd_state_stops_at_once(bench, port, field, value):
    bench.set(port, **{field: value})
    bench.step()
    assert_damps(bench, SafetyFault.ABSURD_STATE)


@pytest.mark.parametrize(
    ("field", "value"),
    [("torque", np.nan), ("torque", 201.0), ("position", np.inf), ("stiffness", -np.inf)],
)
def test_an_absurd_command_never_reaches_the_drives(bench, field, value):
    bench.set("desired", **{field: value})
    bench.step()
    assert_damps(bench, SafetyFault.ABSURD_COMMAND)


def test_a_solver_that_keeps_failing(bench):
    bench.set("wbc", solved=False)
    bench.step(24)
    bench.set("wbc", solved=True)
    bench.step()
    bench.set("wbc", solved=False)
    bench.step(24)
    assert fault(bench) == SafetyFault.NONE
    bench.step()
    assert_damps(bench, SafetyFault.SOLVER)


def test_fault_survives_a_restore(bench):
    healthy = bench.snapshot()
    bench.set("desired", torque=np.nan)
    bench.step()
    broken = bench.snapshot()
    bench.restore(healthy)
    bench.step()
    assert fault(bench) == SafetyFault.NONE
    bench.restore(broken)
    bench.set("desired", torque=0.0)
    bench.step()
    assert_damps(bench, SafetyFault.ABSURD_COMMAND)


HEALTHY = {
    "state": int(DrivePhase.DRIVING), "condition": np.full(10, 0x80), "age": np.zeros(10),
    "voltage": np.full(10, 14.8), "temperature": np.full(10, 40.0), "current": np.zeros(10),
    "imu_age": 0.0, "stamp": -1.0,
    "joints_valid": True, "imu_valid": True, "contacts_valid": True,
}  # fmt: skip
LIMITS = {"lowest_voltage": 13.2, "largest_current": 29.0}
KNEE = 8


def with_health(**health):
    bench = make(**LIMITS)
    bench.set("health", **{**HEALTHY, **health})
    return bench


def of_knee(values, value):
    values = np.array(values)
    values[KNEE] = value
    return values


@pytest.mark.parametrize(
    ("field", "bad", "ticks", "reason", "text"),
    [
        ("condition", 0x88, 1, SafetyFault.DRIVE,
         "drive left_knee_motor: its watchdog ran out, or the emergency stop is pressed"),
        ("condition", 0x00, 1, SafetyFault.DRIVE, "drive left_knee_motor: its error byte is 0x00, whose"),
        ("age", 0.021, 1, SafetyFault.SILENT_DRIVE,
         "drive left_knee_motor has not answered for 21 ms; answer_age is 20 ms"),
        ("age", np.nan, 1, SafetyFault.SILENT_DRIVE, "drive left_knee_motor has not answered for nan ms"),
        ("voltage", 13.1, 11, SafetyFault.VOLTAGE,
         "drive left_knee_motor: 13.1 V is below lowest_voltage, 13.2 V"),
        ("temperature", 81.0, 11, SafetyFault.TEMPERATURE,
         "drive left_knee_motor: its winding has 81 deg C; highest_temperature is 80"),
        ("current", -29.5, 11, SafetyFault.CURRENT,
         "drive left_knee_motor: -29.5 A; largest_current is 29 A"),
    ],
)  # fmt: skip
def test_a_drive_that_is_not_well(field, bad, ticks, reason, text):
    bench = with_health(**{field: of_knee(HEALTHY[field], bad)})
    bench.step(ticks - 1)
    assert fault(bench) == SafetyFault.NONE
    bench.set("health", **{field: HEALTHY[field]})
    bench.step()
    assert fault(bench) == SafetyFault.NONE, "it must be so in a row"
    bench.set("health", **{field: of_knee(HEALTHY[field], bad)})
    bench.step(ticks)
    assert_damps(bench, reason)
    metrics = bench.block.metrics()
    assert metrics["success"] is False
    assert text in metrics["reason"] and text in metrics["safety_reason"]
    assert text in bench.clock.stop_reason


@pytest.mark.parametrize(
    ("bad", "ticks", "reason", "text"),
    [
        ({"imu_age": 0.03}, 1, SafetyFault.SILENT_IMU,
         "the sensor board has sent nothing for 30 ms; imu_age is 20 ms"),
        ({"joints_valid": False}, 51, SafetyFault.INVALID_JOINTS,
         "the joint readings were marked as not valid for more than 100 ms"),
        ({"imu_valid": False}, 51, SafetyFault.INVALID_IMU,
         "the IMU's readings were marked as not valid for more than 100 ms"),
        ({"contacts_valid": False}, 51, SafetyFault.INVALID_CONTACTS,
         "the foot switches' readings were marked as not valid for more than 100 ms"),
        ({"stamp": 1.0}, 27, SafetyFault.STALE_HEALTH,
         "the robot has measured nothing new for 50 ms"),
    ],
)  # fmt: skip
def test_sensors_that_are_not_to_be_trusted(bad, ticks, reason, text):
    bench = with_health(**bad)
    bench.step(ticks - 1)
    assert fault(bench) == SafetyFault.NONE
    bench.step()
    assert_damps(bench, reason)
    assert bench.block.metrics()["safety_reason"] == text
    assert bench.clock.stop_reason == text


def test_it_says_what_a_run_heats():
    bench = make(winding_resistance=0.2, torque_constant=0.35)
    torque = np.zeros(10)
    torque[KNEE] = 3.5
    bench.set("joints", torque=torque)
    bench.step(500)
    motors = ROBOT.torque_to_motor @ torque
    metrics = bench.block.metrics()
    hottest = int(np.argmax(np.abs(motors)))
    assert metrics["most_heated_winding"] == ROBOT.transmission.motors[hottest]
    expected = 0.2 * np.abs(motors).max() ** 2 / 0.35**2 * 500 * bench.block.period
    assert metrics["winding_heat_j"] == pytest.approx(expected)


PACK = {
    "lowest_voltage": 13.2, "brown_out_voltage": 10.0, "pack_resistance": 0.05,
    "winding_resistance": 0.2, "torque_constant": 0.35,
}  # fmt: skip


@pytest.mark.parametrize(
    ("voltage", "power", "text"),
    [
        (13.1, 0.0, "13.1 V is below lowest_voltage, 13.2 V without load"),
        (11.5, 400.0, ""),  # 400 W at 11.5 V: 1.74 V over 50 mOhm
        (11.3, 400.0, "11.3 V is below lowest_voltage, 13.2 V without load"),
        (13.1, -300.0, "13.1 V is below lowest_voltage, 13.2 V without load"),  # it charges
        (9.9, 500.0, "9.9 V is below brown_out_voltage, 10 V"),
    ],
)
def test_a_pack_that_sags_under_load_is_not_empty(voltage, power, text):
    bench = make(**PACK)
    torque, velocity = np.zeros(10), np.zeros(10)
    if power:
        torque[KNEE] = 8.0
        motors = ROBOT.torque_to_motor @ torque
        heat = PACK["winding_resistance"] * np.square(motors / PACK["torque_constant"]).sum()
        velocity[KNEE] = (power - heat) / 8.0
    bench.set("joints", torque=torque, velocity=velocity)
    bench.set("health", **{**HEALTHY, "voltage": np.full(10, voltage)})
    bench.step(10)
    assert fault(bench) == SafetyFault.NONE
    bench.step()
    assert fault(bench) == (SafetyFault.VOLTAGE if text else SafetyFault.NONE)
    assert text in bench.block.metrics().get("safety_reason", "")


@pytest.mark.parametrize("state", [DrivePhase.OFF, DrivePhase.DAMPED])
def test_drives_that_do_not_drive_are_not_judged(state):
    bench = with_health(condition=np.full(10, 0x88), voltage=np.full(10, 5.0), state=int(state))
    bench.step(100)
    assert fault(bench) == SafetyFault.NONE


def test_what_is_not_measured_is_not_judged():
    bench = with_health(voltage=np.zeros(10))
    bench.step(100)
    assert fault(bench) == SafetyFault.NONE
    bench = make(lowest_voltage=13.2)  # nothing is wired to `health`
    bench.step(100)
    assert fault(bench) == SafetyFault.NONE


def test_a_fall_does_not_end_the_run_but_says_why(bench):
    bench.set("base", orientation=leaning(2.0))
    bench.step(11)
    metrics = bench.block.metrics()
    assert metrics["safety_reason"] == "the base leant more than `tilt_limit`"
    assert "success" not in metrics and bench.clock.stop_reason is None
    assert metrics["veto"] == (
        "block: the base leant more than `tilt_limit`; the robot was damped from 0.02 s on"
    )


def test_a_foot_switch_at_fault_ends_the_run_when_the_robot_may_stop(bench):
    bench.set("switches", fault=[0, 0, 0, int(SwitchFault.STUCK_CLOSED)], stop=False)
    bench.step(100)
    assert fault(bench) == SafetyFault.NONE
    bench.set("switches", stop=True)
    bench.step()
    assert_damps(bench, SafetyFault.SWITCH)
    text = f"foot switch {ROBOT.contacts[3].name} is stuck: it was closed in the air"
    assert bench.block.metrics()["safety_reason"] == text == bench.clock.stop_reason


def test_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(SafetyMonitor, dimensions=dict(ROBOT.dimensions))


def test_a_heavy_switch_is_not_the_one_at_fault() -> None:
    health = SwitchHealth.allocate({"n_contacts": 4})
    health.fault[:] = [SwitchFault.HEAVY, SwitchFault.NONE, SwitchFault.BOUNCING, SwitchFault.NONE]
    assert first_bad_switch(health) == 2
    health.fault[2] = SwitchFault.NONE
    assert first_bad_switch(health) == 3
