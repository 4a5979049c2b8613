"""Every fault of the twin ends in the drives' damping mode, within the cycles that the page states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.blocks.signals import CommandMode, DrivePhase
from aloft.hal.bear.protocol import FrameReader, frame_bytes
from aloft.hal.twin.injected_faults import InjectedFault, InjectedFaults, corrupt_byte, read_fault
from aloft.hal.twin.twin_robot import TwinRobot
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import AloftError
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped

ROBOT = find_robot("bruce")
START = 0.1
NOISE = {"gyro_noise": 0.02, "accelerometer_noise": 0.1, "joint_velocity_noise": 0.05}
STOPS: list[tuple[dict[str, Any], int, str]] = [
    ({"kind": "lost"}, 5, "drive right_yaw_motor (address 1) has not answered for 5 exchanges"),
    ({"kind": "lost", "target": "left_knee_motor"}, 5,
     "drive left_knee_motor (address 9) has not answered for 5 exchanges"),
    ({"kind": "truncated"}, 5, "has not answered for 5 exchanges"),
    ({"kind": "corrupted"}, 5, "has not answered for 5 exchanges"),
    ({"kind": "late"}, 5, "has not answered for 5 exchanges"),
    ({"kind": "corrupted_request"}, 5, "has not answered for 5 exchanges"),
    ({"kind": "dead", "target": "right_ankle_motor"}, 5,
     "drive right_ankle_motor (address 5) has not answered for 5 exchanges"),
    ({"kind": "low_voltage", "value": 11.0}, 20,
     "drive right_yaw_motor (address 1): 11.0 V is below the lowest voltage of 13 V"),
    ({"kind": "low_voltage", "value": 5.0, "target": "left_yaw_motor"}, 1,
     "drive left_yaw_motor (address 6): its supply voltage is out of range"),
    ({"kind": "hot", "value": 78.0, "target": "left_ankle_motor"}, 20,
     "drive left_ankle_motor (address 10): its winding has 78 deg C, and 75 are allowed"),
    ({"kind": "hot", "value": 120.0, "target": "left_ankle_motor"}, 1,
     "its winding is hotter than temp_limit_low; its supply voltage"),
    ({"kind": "second_writer"}, 4, "another program or adapter sends instructions on the bus"),
    ({"kind": "pulled_cable"}, 1, "a port failed (PulledCableError: the cable"),
    ({"kind": "pulled_board"}, 1, "the port of the sensor board failed (PulledCableError: the"),
    ({"kind": "silent_board"}, 10, "the sensor board has sent nothing for 10 exchanges"),
    ({"kind": "frozen_imu"}, 25, "the IMU has sent the same numbers 26 times in a row"),
    ({"kind": "saturated_gyro"}, 100, "the gyroscope has been at its range of 35 rad/s"),
]  # fmt: skip
"""The fault, the exchanges within which the driver must notice it, and what it says."""
FAST = (("dead", 5), ("hot", 20), ("frozen_imu", 25))
"""The kinds that `make test` has, with their exchanges: each takes a second."""


def bench(*faults: dict[str, Any], **params: Any) -> BlockBench[TwinRobot]:
    given = [{"start": START, **fault} for fault in faults]
    robot = BlockBench(TwinRobot, grouped({**NOISE, **params, "faults": given}), robot="bruce")
    robot.set(
        "command", mode=CommandMode.ACTIVE, torque=0.01, position=ROBOT.standing_position,
        velocity=0.0, stiffness=150.0, damping=2.0,
    )  # fmt: skip
    return robot


def exchanges_to_damping(robot: BlockBench[TwinRobot], most: int) -> int:
    """The exchanges from the fault's start until the driver commands damping."""
    twin, loop = robot.block.twin, robot.block.driver.loop  # type: ignore[union-attr]
    for _ in range(round(START / 0.002) + most // 2 + 5):
        robot.step(1)
        if loop.phase is DrivePhase.DAMPED:
            break
    assert loop.phase is DrivePhase.DAMPED, "it still drives"
    return twin.exchanges - twin.zero - round(START / 0.001)


@pytest.mark.parametrize(
    ("fault", "cycles", "text"),
    [
        pytest.param(*stop, marks=() if (stop[0]["kind"], stop[1]) in FAST else pytest.mark.long)
        for stop in STOPS
    ],
    ids=lambda value: str(value)[:40],
)
def test_it_ends_in_damping_in_time(fault: dict[str, Any], cycles: int, text: str) -> None:
    robot = bench(fault)
    passed = exchanges_to_damping(robot, cycles)
    assert passed <= cycles + 3, "a tick has two exchanges, of which one may be the fault's first"
    loop = robot.block.driver.loop  # type: ignore[union-attr]
    assert text in loop.fault
    robot.step(1)
    assert text in (robot.clock.stop_reason or "")
    metrics = robot.block.metrics()
    assert metrics["success"] is False and text in str(metrics["reason"])
    for _ in range(5):
        robot.block.stop_cycle()
    twin = robot.block.twin
    for name, actuator in zip(ROBOT.transmission.motors, twin.actuators, strict=True):
        reached = fault["kind"] not in ("pulled_cable", "corrupted_request")
        if reached and fault.get("target") != name:
            assert actuator.status["torque_enable"] == 3, name
        assert reached or not fault.get("target")


def test_with_a_pulled_cable_the_drives_stop_by_themselves() -> None:
    robot = bench({"kind": "pulled_cable"})
    robot.step(60)
    twin = robot.block.twin
    assert any(actuator.driving for actuator in twin.actuators), "nothing can reach them"
    robot.step(50)  # the watchdog's 100 ms
    assert not any(actuator.driving for actuator in twin.actuators)
    assert not twin.drives.enabled.any()


def test_a_stuck_encoder_is_noticed_while_the_others_move() -> None:
    robot = bench({"kind": "stuck_encoder", "target": "left_knee_motor"})
    rng = np.random.default_rng(0)
    twin, loop = robot.block.twin, robot.block.driver.loop  # type: ignore[union-attr]
    for _ in range(200):
        swing = 0.2 * np.sin(40.0 * 0.002 * robot.clock.tick) + 0.0 * rng.random()
        robot.set("command", position=ROBOT.standing_position + swing)
        robot.step(1)
        if loop.fault:
            break
    assert "drive left_knee_motor (address 9): its encoder has not changed in 25 exch" in loop.fault
    assert twin.exchanges - twin.zero - round(START / 0.001) < 120


@pytest.mark.long
@pytest.mark.parametrize("kind", ["lost", "truncated", "corrupted", "late", "corrupted_request"])
def test_some_spoilt_answers_do_no_harm(kind: str) -> None:
    robot = bench({"kind": kind, "share": 0.05})
    robot.step(300)
    assert not robot.block.driver.loop.fault  # type: ignore[union-attr]
    assert robot.get("health").state == DrivePhase.DRIVING
    assert robot.get("health").lost_answers > 10
    np.testing.assert_allclose(robot.get("joints").position, ROBOT.standing_position, atol=0.06)


@pytest.mark.parametrize("kind", ["stuck_switch", "bouncing_switch"])
def test_switches(kind: str) -> None:
    robot = bench({"kind": kind, "target": "left_heel"})
    robot.step(45)
    robot.block.twin.plant.data.qpos[2] += 3.0
    seen = []
    for _ in range(60):
        robot.step(1)
        seen.append(robot.get("contacts").closed.tolist())
    last = np.array(seen[-40:])
    assert not last[:, :3].any(), "the others are open in the air"
    assert last[:, 3].all() if kind == "stuck_switch" else 0.2 < last[:, 3].mean() < 0.8


def test_before_the_robot_was_let_go_there_are_none() -> None:
    faults = InjectedFaults([InjectedFault(kind="lost", start=0.0)], 0)
    assert not faults.active("lost")
    faults.now = 0.0
    assert faults.active("lost") and not faults.active("late")


def test_a_share_is_drawn_from_seed_exchange_and_place_only() -> None:
    def drawn(seed: int, target: str) -> list[bool]:
        faults = InjectedFaults([InjectedFault(kind="lost", share=0.3)], seed)
        faults.now = 1.0
        found = []
        for exchange in range(300):
            faults.exchange = exchange
            found.append(bool(faults.of(target, "lost")))
        return found

    assert drawn(1, "a") == drawn(1, "a")
    assert drawn(1, "a") != drawn(2, "a") and drawn(1, "a") != drawn(1, "b")
    assert 0.2 < np.mean(drawn(1, "a")) < 0.4


def test_one_changed_byte_is_no_good_frame_any_more() -> None:
    frame = frame_bytes(3, 0x80, bytes(range(12)))
    for seed in range(300):
        hurt = corrupt_byte(frame, np.random.default_rng(seed))
        assert hurt != frame and len(hurt) == len(frame)
        assert [found.data for found in FrameReader().feed(hurt)] != [bytes(range(12))]


def test_a_fault_in_one_line() -> None:
    assert read_fault("dead 0.5 left_knee_motor") == InjectedFault(
        kind="dead", start=0.5, target="left_knee_motor"
    )
    assert read_fault("lost 1 * share=0.1") == InjectedFault(kind="lost", start=1.0, share=0.1)
    with pytest.raises(AloftError, match="fault 'slow 1': kind: expected 'lost', 'trunc"):
        read_fault("slow 1")
    with pytest.raises(AloftError, match="'more' is one word too many"):
        read_fault("lost 1 * more")
