"""Arming step by step, against the twin in virtual time: what is refused, and that nothing is left on."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import aloft
from aloft.blocks.signals import CommandMode, DrivePhase, JointCommand
from aloft.hal.bear.bus import BusError
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.driver import DriveLaw, Driver, check_ready, configure
from aloft.hal.bear.motor_loop import MotorThread
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.twin.twin import Twin, standing_twin
from aloft.hal.twin.twin_robot import VirtualBoardPort, VirtualBusPort
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
KNEE = "left_knee_motor"
PATIENCE = 60.0


def hardware(**motors: object) -> Hardware:
    """The twin's hardware, with a short soft start; ``motors`` changes single motors."""
    data = Hardware.for_twin(ROBOT).model_dump()
    for name, change in motors.items():
        data["motors"][name] |= change
    # an IMU without noise in a robot that hangs still would count as frozen
    data["board"] |= {"frozen_packets": 10_000}
    return Hardware.model_validate({**data, "soft_start": {"duration": 0.3, "current": 6.0}})


def made(settings: Hardware | None = None) -> tuple[Twin, Driver]:
    """A twin, and a driver that has found its drives."""
    twin = standing_twin(ROBOT, SimulatorParameters(), hardware())
    found = settings or hardware()
    stiffness = np.full(10, 3.5)
    law = DriveLaw(ROBOT, stiffness, 0.1 * stiffness, found.bus.lead)
    driver = Driver(ROBOT, found, VirtualBusPort(twin), VirtualBoardPort(twin), law)
    driver.connect()
    return twin, driver


def states(twin: Twin) -> set[float]:
    return {actuator.status["torque_enable"] for actuator in twin.actuators}


def test_the_soft_start_uses_little_current_and_ends_in_the_standing_pose() -> None:
    twin, driver = made()
    before: DrivePhase = driver.loop.phase
    assert states(twin) == {0.0} and before is DrivePhase.OFF
    seen: list[tuple[DrivePhase, float, float]] = []

    def next_cycle() -> bool:
        loop = driver.loop
        seen.append((loop.phase, loop.current_limit, float(np.abs(twin.drives.current).max())))
        return True

    driver.arm(next_cycle)
    assert len(seen) == 300 and {phase for phase, _, _ in seen} == {DrivePhase.STARTING}
    limits = [limit for _, limit, _ in seen]
    assert limits[0] < 0.2 and limits == sorted(limits) and limits[-1] == 6.0
    assert all(current <= limit + 1e-3 for _, limit, current in seen)
    after: DrivePhase = driver.loop.phase
    assert after is DrivePhase.HOLDING and states(twin) == {1.0}
    np.testing.assert_allclose(
        driver.loop.target, ROBOT.joint_to_motor @ ROBOT.standing_position, atol=1e-12
    )
    driver.damp()
    assert states(twin) == {3.0} and driver.loop.phase is DrivePhase.DAMPED


def test_letting_go_during_the_soft_start_damps() -> None:
    twin, driver = made()
    left = iter([True] * 50 + [False])
    with pytest.raises(BusError, match="the dead man's switch was let go during the soft start"):
        driver.arm(lambda: next(left))
    assert states(twin) == {3.0} and driver.loop.phase is DrivePhase.DAMPED


def low_voltage(twin: Twin) -> None:
    twin.actuators[8].status["input_voltage"] = 12.0


def hot(twin: Twin) -> None:
    twin.actuators[8].status["winding_temperature"] = 76.0


def too_hot_for_a_jump(twin: Twin) -> None:
    twin.actuators[8].status["winding_temperature"] = 71.0


def emergency_stop(twin: Twin) -> None:
    twin.actuators[8].stopped = True
    twin.advance()


def stays_off(twin: Twin) -> None:
    def ignore(wanted: int) -> None:
        if wanted == 3:
            twin.actuators[8].status["torque_enable"] = 3

    twin.actuators[8]._enable = ignore  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (low_voltage, r"the drives are not enabled: left_knee_motor has 12\.0 V instead of 13 to"),
        (hot, r"the drives are not enabled: left_knee_motor has 76\.0 deg C"),
        (
            too_hot_for_a_jump,
            r"71\.0 deg C, and a jump .* heats it by 5\.0 to 76\.0: more than 75; wait 1 s",
        ),
        (emergency_stop, r"drive left_knee_motor \(address 9\): "),
        (stays_off, "drives cannot be enabled: left_knee_motor: it does not say why"),
    ],
)
def test_what_keeps_the_drives_from_being_enabled(wrong: Callable[[Twin], None], text: str) -> None:
    twin, driver = made()
    wrong(twin)
    with pytest.raises(BusError, match=text):
        driver.arm(lambda: True)
    assert 1.0 not in states(twin), "nothing is left on"
    assert not twin.released and driver.loop.phase is DrivePhase.DAMPED


def test_a_motor_far_from_the_standing_pose_is_not_enabled() -> None:
    """As with a wrong offset, or a robot that lies on the ground."""
    twin, driver = made(hardware(**{KNEE: {"offset": 1.5}}))
    with pytest.raises(BusError, match=r"left_knee_motor is at .* more than 1 rad away"):
        driver.arm(lambda: True)
    assert 1.0 not in states(twin)


@pytest.mark.parametrize(
    ("lacking", "text"),
    [
        (
            {"offset": None},
            "left_knee_motor: not calibrated, an `offset`: do step 3 of extensions/commissioning/bring",
        ),
        (
            {"high": None},
            "left_knee_motor: not calibrated, `low` and `high`: do step 4 of extensions/commissioning/",
        ),
    ],
)
def test_a_motor_that_was_not_calibrated_is_not_enabled(
    lacking: dict[str, None], text: str
) -> None:
    twin, driver = made(hardware(**{KNEE: lacking}))
    with pytest.raises(BusError, match=text):
        driver.arm(lambda: True)
    assert states(twin) == {0.0} and driver.loop.phase is DrivePhase.OFF, "nothing was written"


def test_the_shipped_file_is_not_armed() -> None:
    shipped = Path(aloft.__file__).parent / "graphs" / "hardware" / "bruce.yaml"
    settings = Hardware.read(shipped, ROBOT)
    _, driver = made(settings.model_copy(update={"bus": hardware().bus}))
    with pytest.raises(BusError) as caught:
        driver.arm(lambda: True)
    assert str(caught.value) == (
        "the drives are not enabled: no motor has an `offset`: do step 3 of extensions/commissioning/bring_up.md; no motor "
        "has `low` and `high`: do step 4 of extensions/commissioning/bring_up.md"
    )


def test_pump_and_fan_go_on_until_the_windings_are_cool(monkeypatch: pytest.MonkeyPatch) -> None:
    twin, driver = made()
    assert twin.board.cooling == 0
    driver.arm(lambda: True)
    assert twin.board.cooling == driver.hardware.board.cooling == 5
    twin.actuators[3].status["winding_temperature"] = 60.0
    driver.damp(2)
    waited: list[float] = []

    def sleep(seconds: float) -> None:
        assert twin.board.cooling == 5 and states(twin) == {3.0}
        waited.append(seconds)
        if len(waited) == 20:
            twin.actuators[3].status["winding_temperature"] = 44.0

    monkeypatch.setattr(time, "sleep", sleep)
    driver.close()
    assert len(waited) == 21 and twin.board.cooling == 0


def test_unarmed_the_board_is_not_told_to_cool() -> None:
    twin, driver = made()
    driver.damp()
    driver.close()
    assert twin.board.cooling == 0


@pytest.fixture
def driving() -> Driver:
    """A driver that follows a command."""
    _, driver = made()
    driver.arm(lambda: True)
    command = JointCommand.allocate(ROBOT.dimensions)
    command.mode[()] = CommandMode.ACTIVE
    command.position[:] = ROBOT.standing_position
    driver.loop.follow(command)
    assert driver.loop.phase is DrivePhase.DRIVING
    return driver


@pytest.mark.parametrize(
    ("age", "stop_reason", "text"),
    [
        (0.02, "", "no new command has come for "),
        (PATIENCE, "the dead man's switch was let go", "the dead man's switch was let go"),
    ],
)
def test_the_motor_thread_damps(driving: Driver, age: float, stop_reason: str, text: str) -> None:
    """When commands grow old, and when there is an objection: the graph says nothing meanwhile."""
    loop = driving.loop
    thread = MotorThread(loop, age, lambda: stop_reason)
    thread.start()
    try:
        end = time.monotonic() + PATIENCE
        while not loop.fault and time.monotonic() < end:
            time.sleep(0.005)
        assert thread.wait_for(thread.done + 2, PATIENCE)
    finally:
        thread.stop()
    assert loop.fault.startswith(text) and loop.phase is DrivePhase.DAMPED


def ready(**changes: object) -> SimpleNamespace:
    """What ``check_ready`` looks at, with everything at its bounds."""
    settings = hardware()
    drives, farthest = settings.drives, settings.soft_start.farthest
    voltage = np.tile([drives.lowest_voltage, drives.highest_voltage], 5)
    measured = SimpleNamespace(
        voltage=voltage,
        temperature=np.full(10, drives.highest_temperature - drives.jump_heating),
        position=np.tile([farthest, -farthest], 5),
    )  # fmt: skip
    return SimpleNamespace(hardware=settings, measured=measured)


@pytest.mark.parametrize(
    ("name", "column", "change", "text"),
    [
        ("voltage", 0, -0.1, "V instead of"), ("voltage", 1, 0.1, "V instead of"),
        ("temperature", 4, 1.0, "deg C"), ("position", 2, 0.01, "rad away"),
        ("position", 3, -0.01, "rad away"), ("position", 3, np.nan, "rad away"),
    ],
)  # fmt: skip
def test_drives_are_ready_up_to_their_bounds(
    name: str, column: int, change: float, text: str
) -> None:
    names = ROBOT.transmission.motors
    loop = ready()
    check_ready(loop, np.zeros(10), names)  # type: ignore[arg-type]
    getattr(loop.measured, name)[column] += change
    with pytest.raises(BusError, match=f"the drives are not enabled: {names[column]} .*{text}"):
        check_ready(loop, np.zeros(10), names)  # type: ignore[arg-type]


def test_drives_get_the_gains_and_limits_of_the_file() -> None:
    written: dict[int, dict[str, float]] = {}
    bus = SimpleNamespace(verify=lambda device, values: written.update({device: dict(values)}))
    settings, names = hardware(), ROBOT.transmission.motors
    settings.motors[names[2]] = settings.motors[names[2]].model_copy(
        update={"torque_constant": 0.5}
    )
    stiffness = {name: 2.0 + k for k, name in enumerate(names)}
    damping = {name: 0.1 * (1 + k) for k, name in enumerate(names)}
    configure(bus, settings, stiffness, damping)  # type: ignore[arg-type]
    drives = settings.drives
    for name in names:
        values = written[settings.motors[name].id]
        # what the drive computes in amperes gives the motor's torque
        constant = 0.5 if name == names[2] else drives.torque_constant
        torque = constant * values["p_gain_direct_force"]
        assert torque == pytest.approx(stiffness[name])
        torque = constant * values["d_gain_direct_force"]
        assert torque == pytest.approx(damping[name])
        assert values["watchdog_timeout"] == pytest.approx(1e6 * drives.watchdog, abs=1.0)
        assert values["limit_i_max"] == drives.current_limit and values["mode"] == 3
        for loop in ("iq", "id"):
            assert [values[f"{letter}_gain_{loop}"] for letter in "pid"] == drives.iq_gains
