"""The motor loop's laws: what a phase sends, how goals are clamped, which command a cycle follows."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.signals import CommandMode, DrivePhase, JointCommand, RobotHealth
from aloft.hal.bear.bus import BearBus
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.driver import DriveLaw
from aloft.hal.bear.measurement import FOREIGN, Supervision
from aloft.hal.bear.motor_loop import CommandQueue, MotorLoop
from aloft.hal.bear.protocol import Torque
from aloft.hal.bear.sense_board import SenseBoard
from aloft.hal.twin.devices import EmulatedActuator, EmulatedBus
from aloft.robots.description import find_robot

from .virtual_wire import VirtualWire

ROBOT = find_robot("bruce")
MOTORS = ROBOT.transmission.motors
STIFFNESS = np.full(10, 3.5)


class Silent(VirtualWire):
    """A board's port on which nothing comes."""

    def read(self, size: int = 1) -> bytes:
        return b""


def hardware() -> Hardware:
    """Drives of which every second turns the other way, each with an offset and limits of its own."""
    data = Hardware.for_twin(ROBOT).model_dump()
    for k, name in enumerate(MOTORS):
        data["motors"][name] |= {
            "sign": -1 if k % 2 else 1, "offset": 0.05 * k, "low": -1.0 - 0.1 * k, "high": 2.0 + 0.1 * k,
        }  # fmt: skip
    data["board"] |= {"lost_cycles": 1000}
    return Hardware.model_validate(data)


class Bench:
    """A motor loop whose drives are emulated, without mechanics, in virtual time."""

    def __init__(self) -> None:
        self.hardware = hardware()
        self.bus = EmulatedBus(EmulatedActuator(self.hardware.motors[name].id) for name in MOTORS)
        for actuator in self.bus.actuators.values():
            actuator.config |= {"limit_i_max": 60.0, "mode": 3}
            actuator.config |= {"limit_position_min": -9.0, "limit_position_max": 9.0}
        law = DriveLaw(ROBOT, STIFFNESS, 0.1 * STIFFNESS, self.hardware.bus.lead)
        wire = VirtualWire(self.bus)
        board = SenseBoard(Silent(self.bus))
        self.loop = MotorLoop(
            ROBOT, self.hardware, BearBus(wire, reply_time=1e-3), board, law.goals,
            law.motor_stiffness,
        )  # fmt: skip
        self.stiffness = law.motor_stiffness

    def enable(self, phase: DrivePhase) -> None:
        for actuator in self.bus.actuators.values():
            actuator.status["torque_enable"] = Torque.ON
        self.loop.phase = phase

    def goals(self, name: str) -> np.ndarray:
        """A goal of every drive, as it arrived."""
        found = (self.bus.actuators[self.hardware.motors[m].id].status[name] for m in MOTORS)
        return np.array(list(found))

    def set_position(self, motor: np.ndarray) -> None:
        """Put the motors at these angles, by the drives' own signs and offsets."""
        for k, name in enumerate(MOTORS):
            settings = self.hardware.motors[name]
            status = self.bus.actuators[settings.id].status
            status["present_position"] = settings.sign * (motor[k] + settings.zero)


@pytest.fixture
def bench() -> Bench:
    found = Bench()
    found.set_position(np.zeros(10))
    found.loop.cycle()
    np.testing.assert_allclose(found.loop.measured.position, 0.0, atol=1e-7)
    return found


def motor_goals(bench: Bench) -> np.ndarray:
    """The goal angles that arrived, in the robot's signs and offsets."""
    sign = np.array([bench.hardware.motors[name].sign for name in MOTORS])
    offset = np.array([bench.hardware.motors[name].zero for name in MOTORS])
    return np.asarray(bench.goals("goal_position") * sign - offset)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_starting_goes_no_further_than_its_current_allows(bench: Bench, side: float) -> None:
    bench.enable(DrivePhase.STARTING)
    bench.loop.target[:] = side * np.linspace(0.0, 0.9, 10)
    bench.loop.current_limit = 2.0
    bench.loop.cycle()
    reach = 2.0 * bench.hardware.drives.torque_constant / bench.stiffness
    expected = side * np.minimum(np.linspace(0.0, 0.9, 10), reach)
    np.testing.assert_allclose(motor_goals(bench), expected, atol=1e-6)
    assert np.any(expected != bench.loop.target) and np.any(expected[1:] == bench.loop.target[1:])
    np.testing.assert_array_equal(bench.goals("goal_iq"), 0.0)
    np.testing.assert_array_equal(bench.goals("goal_velocity"), 0.0)


def command(torque: float = 0.0, position: np.ndarray | float = 0.0) -> JointCommand:
    found = JointCommand.allocate(ROBOT.dimensions)
    found.mode[()] = CommandMode.ACTIVE
    found.torque[:] = torque
    found.position[:] = position
    return found


@pytest.mark.parametrize("torque", [0.5, -0.5, 1e4, -1e4])
def test_torques_become_currents_within_their_limit(bench: Bench, torque: float) -> None:
    bench.enable(DrivePhase.HOLDING)
    bench.loop.follow(command(torque))
    assert bench.loop.phase is DrivePhase.DRIVING
    bench.loop.cycle()
    drives = bench.hardware.drives
    most = drives.current_limit - drives.current_margin
    wanted = ROBOT.torque_to_motor @ np.full(10, torque) / drives.torque_constant
    sign = np.array([bench.hardware.motors[name].sign for name in MOTORS])
    np.testing.assert_allclose(
        bench.goals("goal_iq"), sign * np.clip(wanted, -most, most), rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize("far", [20.0, -20.0])
def test_goal_angles_stay_within_what_a_drive_does_not_ignore(bench: Bench, far: float) -> None:
    bench.enable(DrivePhase.HOLDING)
    wanted = command(position=far)
    wanted.stiffness[:] = STIFFNESS
    bench.loop.follow(wanted)
    bench.loop.cycle()
    low, high = np.array([bench.hardware.motors[name].range for name in MOTORS]).T
    found = motor_goals(bench)
    assert np.all(found >= low - 1e-6) and np.all(found <= high + 1e-6)
    asked = ROBOT.joint_to_motor @ np.full(10, far)
    beyond = (asked > high) | (asked < low)
    np.testing.assert_allclose(found[beyond], np.clip(asked, low, high)[beyond], atol=1e-6)
    assert beyond.sum() > 5


@pytest.mark.parametrize("stiffness", [0.0, 150.0])
def test_with_the_first_command_the_current_rises_from_that_of_the_soft_start(
    bench: Bench, stiffness: float
) -> None:
    settings, drives = bench.hardware.soft_start, bench.hardware.drives
    bench.enable(DrivePhase.HOLDING)
    bench.loop.current_limit = settings.current
    wanted = command(1e4, position=0.3)
    wanted.stiffness[:], wanted.damping[:] = stiffness, 0.1 * stiffness
    bench.loop.follow(wanted)
    sign = np.array([bench.hardware.motors[name].sign for name in MOTORS])
    largest = []
    for _ in range(round(settings.ramp / bench.hardware.bus.period)):
        bench.loop.cycle()
        feedback = motor_goals(bench) * bench.stiffness / drives.torque_constant
        current = sign * bench.goals("goal_iq") + feedback
        largest.append(np.abs(current).max())
    most = drives.current_limit - drives.current_margin
    assert settings.current < largest[0] < settings.current + 0.2
    assert np.diff(largest).max() < 1.01 * (most - settings.current) / (1000.0 * settings.ramp)
    assert largest[-1] == pytest.approx(most) == bench.loop.current_limit


def test_a_board_whose_port_fails_ends_in_damping_in_the_next_cycle(bench: Bench) -> None:
    class Pulled(Silent):
        def read(self, size: int = 1) -> bytes:
            raise OSError("no such device")

    bench.enable(DrivePhase.DRIVING)
    bench.loop.board.port = Pulled(bench.bus)
    bench.loop.cycle()
    bench.loop.cycle()
    assert bench.loop.fault == "the port of the sensor board failed (OSError: no such device)"
    assert bench.loop.board_lost and not bench.loop.link_lost
    assert {each.status["torque_enable"] for each in bench.bus.actuators.values()} == {3}
    assert bench.loop.cycle() == 10, "the drives go on answering"


def test_a_command_for_no_torque_and_one_for_damping(bench: Bench) -> None:
    bench.enable(DrivePhase.HOLDING)
    released = command(5.0)
    released.mode[()] = CommandMode.OFF
    bench.loop.follow(released)
    bench.loop.cycle()
    np.testing.assert_array_equal(bench.goals("goal_iq"), 0.0)
    damping = command(5.0)
    damping.mode[()] = CommandMode.DAMPING
    bench.loop.follow(damping)
    bench.loop.cycle()
    phase: DrivePhase = bench.loop.phase
    assert phase is DrivePhase.DAMPED and bench.loop.fault == ""
    assert set(bench.goals("torque_enable")) == {Torque.DAMPING}


def test_a_command_is_followed_only_where_the_drives_are_on(bench: Bench) -> None:
    for phase in (DrivePhase.OFF, DrivePhase.STARTING, DrivePhase.DAMPED):
        bench.loop.phase = phase
        bench.loop.follow(command())
        assert bench.loop.phase is phase


def test_the_first_fault_counts_and_drives_that_are_off_stay_off(bench: Bench) -> None:
    bench.loop.fail("first")
    bench.loop.fail("second")
    assert (bench.loop.fault, bench.loop.phase) == ("first", DrivePhase.OFF)
    bench.loop.phase = DrivePhase.DRIVING
    bench.loop.fail("third")
    assert (bench.loop.fault, bench.loop.phase) == ("first", DrivePhase.DAMPED)


def test_a_restored_loop_keeps_its_fault_only_where_it_is_damped(bench: Bench) -> None:
    for phase, fault in ((DrivePhase.DAMPED, "cable"), (DrivePhase.HOLDING, "")):
        bench.loop.phase, bench.loop.fault = phase, "cable"
        bench.loop.restored()
        assert bench.loop.fault == fault


def test_a_report_says_what_is_fresh(bench: Bench) -> None:
    health = RobotHealth.allocate(ROBOT.dimensions)
    loop, period = bench.loop, bench.hardware.bus.period
    lost = bench.hardware.motors[MOTORS[3]].id
    loop.report(health)
    assert health.joints_valid and not health.imu_valid and not health.contacts_valid
    assert health.stamp == pytest.approx(period) and health.lost_answers == 0
    bench.bus.fault = lambda device, answer: b"" if device == lost else answer
    for _ in range(2):
        assert loop.cycle() == 9
    loop.report(health)
    np.testing.assert_allclose(health.age, 2 * period * (np.arange(10) == 3))
    assert not health.joints_valid
    assert health.lost_answers == 2 and health.late_cycles == 0
    assert health.imu_age == pytest.approx(3 * period)
    assert health.stamp == pytest.approx(3 * period)
    bench.bus.fault = lambda device, answer: b""
    assert loop.cycle() == 0
    assert loop.lost_answers == 12 and loop.stamp == pytest.approx(3 * period)
    bench.bus.fault = lambda device, answer: answer
    loop.cycle()
    loop.link_lost = True
    loop.report(health)
    assert not health.joints_valid and not health.imu_valid and not health.contacts_valid
    assert loop.cycle() == 0, "nothing is sent over a link that is lost"


@pytest.mark.parametrize("latency", [0.0, 0.3, 1.0, 1.5, 2.0, 3.7, 5.0])
@pytest.mark.parametrize("cycles", [1, 2, 3, 4])
def test_a_cycle_follows_the_newest_command_that_is_old_enough(latency: float, cycles: int) -> None:
    """Latencies in periods: a command of tick m is in no exchange earlier than ceil(latency) periods
    after the tick, and in the next one at the soonest."""
    followed: list[float] = []
    period = 1e-3
    loop = SimpleNamespace(
        hardware=SimpleNamespace(bus=SimpleNamespace(period=period)),
        follow=lambda given: followed.append(float(given.torque[0])),
        cycle=lambda: done.append(followed[-1] if followed else math.nan),
    )
    done: list[float] = []
    queue = CommandQueue(loop, ROBOT, latency * period, cycles * period)  # type: ignore[arg-type]
    assert queue.cycles == cycles
    for tick in range(12):
        queue.give(command(float(tick)))
        queue.advance()
    wait = max(1, math.ceil(latency))
    for exchange in range(12 * cycles):
        tick, j = divmod(exchange, cycles)
        old_enough = [m for m in range(tick + 1) if (tick - m) * cycles + j + 1 >= wait]
        expected = max(old_enough) if old_enough else math.nan
        assert done[exchange] == expected or (math.isnan(expected) and math.isnan(done[exchange]))


def supervised(**values: object) -> tuple[Supervision, SimpleNamespace, SimpleNamespace]:
    """A supervision, and measurements and an exchange in which nothing is wrong."""
    measured = SimpleNamespace(
        voltage=np.full(10, 14.8), temperature=np.full(10, 25.0), position=np.zeros(10),
        velocity=np.zeros(10), current=np.zeros(10), sag=lambda: 0.0,
    )  # fmt: skip
    bulk = SimpleNamespace(
        ages=np.zeros(10, dtype=np.int64), error_bytes=np.full(10, 0x80, dtype=np.uint8),
        bus=SimpleNamespace(counts=SimpleNamespace(foreign=0)),
    )  # fmt: skip
    return Supervision(hardware(), MOTORS), measured, bulk


@pytest.mark.parametrize(
    ("name", "limit", "sign", "text"),
    [
        ("voltage", "lowest_voltage", -1.0, "is below the lowest voltage"),
        ("temperature", "highest_temperature", 1.0, "are allowed"),
    ],
)
def test_what_lasts_too_long_beyond_its_limit(
    name: str, limit: str, sign: float, text: str
) -> None:
    judge, measured, bulk = supervised()
    drives = hardware().drives
    array, bound = getattr(measured, name), getattr(drives, limit)
    array[4] = bound
    for _ in range(3 * drives.bad_cycles):
        assert judge.check_drives(measured, bulk, True) == "", "at the limit is no fault"
    array[4], array[7] = bound + 0.1 * sign, bound + 0.1 * sign
    for _ in range(drives.bad_cycles - 1):
        assert judge.check_drives(measured, bulk, True) == ""
    array[4] = bound - 0.1 * sign
    fault = judge.check_drives(measured, bulk, True)
    assert fault.startswith(f"drive {MOTORS[7]} ") and text in fault
    for _ in range(drives.bad_cycles + 1):
        assert judge.check_drives(measured, bulk, False) == "", "drives that are off hurt nobody"


def test_an_encoder_is_stuck_only_under_current_and_while_others_move() -> None:
    drives = hardware().drives
    for current, speed, moves, stuck in (
        (1.1, 2.0, False, True),
        (-1.1, -2.0, False, True),
        (0.9, 2.0, False, False),
        (1.1, 0.0, False, False),
        (1.1, 2.0, True, False),
    ):
        judge, measured, bulk = supervised()
        measured.current[2] = current * drives.stuck_current
        measured.velocity[6] = speed
        faults = []
        for k in range(2 * drives.stuck_cycles + 1):
            measured.position[2] = 1e-4 * k if moves else 0.3
            faults.append(judge.check_drives(measured, bulk, True))
        first = next((k for k, text in enumerate(faults) if text), None)
        # the first exchange has nothing to compare with
        assert first == (drives.stuck_cycles if stuck else None)
        assert not stuck or f"drive {MOTORS[2]} " in faults[-1]


def test_an_answer_that_is_lost_is_no_equal_position() -> None:
    drives = hardware().drives
    judge, measured, bulk = supervised()
    measured.current[2], measured.velocity[6] = 2.0 * drives.stuck_current, 2.0
    for k in range(3 * drives.stuck_cycles):
        bulk.ages[2] = int(k % (drives.stuck_cycles - 1) == 0)
        assert judge.check_drives(measured, bulk, True) == ""


def test_silent_drives_and_another_writer_are_faults_even_with_the_drives_off() -> None:
    judge, measured, bulk = supervised()
    lost = hardware().bus.lost_cycles
    bulk.ages[5] = lost - 1
    assert judge.check_drives(measured, bulk, False) == ""
    bulk.ages[5] = lost
    text = (
        f"drive {MOTORS[5]} (address {hardware().motors[MOTORS[5]].id}) has not answered for {lost}"
    )
    assert judge.check_drives(measured, bulk, False).startswith(text)
    bulk.ages[5] = 0
    bulk.bus.counts.foreign = FOREIGN - 1
    assert judge.check_drives(measured, bulk, False) == ""
    bulk.bus.counts.foreign = FOREIGN
    assert "another program" in judge.check_drives(measured, bulk, False)


def test_an_imu_that_repeats_itself_is_at_its_range_or_silent() -> None:
    settings = Hardware.for_twin(ROBOT).board
    judge = Supervision(Hardware.for_twin(ROBOT), MOTORS)
    board = SimpleNamespace(specific_force=np.zeros(3), angular_velocity=np.zeros(3))

    def check(fresh: int = 1) -> str:
        return judge.check_board(board, fresh)  # type: ignore[arg-type]

    def noisy(k: int) -> None:
        board.specific_force[1] = 1e-3 * k

    noisy(1)
    assert check() == "" and judge.imu_valid
    assert check() == "" and not judge.imu_valid, "the same numbers twice"
    noisy(2)
    assert check() == "" and judge.imu_valid
    for number, array in enumerate((board.specific_force, board.angular_velocity)):
        array[2] += 0.01
        assert check() == "" and judge.imu_valid, f"one of {number} changed"
    for k in range(settings.frozen_packets):
        fault = check()
        assert (fault != "") == (k == settings.frozen_packets - 1)
    assert f"the same numbers {settings.frozen_packets + 1} times in a row" in fault
    noisy(5)
    assert check() == "" and judge.imu_valid
    for k in range(settings.lost_cycles):
        fault = check(0)
        assert not judge.imu_valid and (judge.imu_silent, fault != "") == (
            k + 1, k == settings.lost_cycles - 1,
        )  # fmt: skip
    for sign in (1.0, -1.0):
        noisy(3)
        board.angular_velocity[:] = 0.0
        assert check() == "" and judge.imu_valid and judge.imu_silent == 0
        for share, saturated in ((0.99, False), (0.996, True)):
            board.angular_velocity[1] = sign * share * settings.gyro_range
            for k in range(settings.saturated_packets):
                noisy(4 + k)
                fault = check()
                assert judge.imu_valid != saturated
                last = k == settings.saturated_packets - 1
                assert ("at its range" in fault) == (saturated and last)
