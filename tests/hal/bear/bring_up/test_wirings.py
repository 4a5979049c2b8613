"""Every wrong wiring is found by the step that should find it, before a drive is switched on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from aloft.hal.bear.bring_up.session import Journal, Session
from aloft.hal.bear.bring_up.steps import STEPS
from aloft.hal.bear.bring_up.walk import UnknownStepError, steps_from, walk
from aloft.hal.bear.bus import BearBus
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.sense_board import SenseBoard
from aloft.hal.twin.by_hand import RobotByHand, Wiring
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
TOOTH = 2.0 * np.pi / 64


def swap(*pairs: tuple[str, str]) -> Callable[[Wiring], None]:
    def change(wiring: Wiring) -> None:
        for a, b in pairs:
            addresses = wiring.addresses
            addresses[a], addresses[b] = addresses[b], addresses[a]

    return change


def legs(wiring: Wiring) -> None:
    right = [name for name in wiring.addresses if name.startswith("right")]
    swap(*((name, name.replace("right", "left")) for name in right))(wiring)


def sign(*motors: str) -> Callable[[Wiring], None]:
    return lambda wiring: wiring.signs.update(dict.fromkeys(motors, -1))


def put(**values: object) -> Callable[[Wiring], None]:
    def change(wiring: Wiring) -> None:
        for name, value in values.items():
            if isinstance(value, dict):
                getattr(wiring, name).update(value)
            else:
                setattr(wiring, name, value)

    return change


def turned(axis: int, degrees: float) -> np.ndarray:
    a, b = [k for k in range(3) if k != axis]
    matrix = np.eye(3)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix[a, a], matrix[a, b], matrix[b, a], matrix[b, b] = c, -s, s, c
    return matrix


def switches(*order: int) -> Callable[[Wiring], None]:
    return lambda wiring: setattr(wiring, "bits", [wiring.bits[k] for k in order])


def lost(wiring: Wiring) -> None:
    del wiring.addresses["left_knee_motor"]


WIRINGS: dict[str, tuple[Callable[[Wiring], None], str, str]] = {
    "the maker's other variant": (
        put(lengths={"right_knee": 0.2045, "right_ankle": 0.1999}, mass=4.53), "robot", "another variant"),
    "lighter than described": (put(mass=4.53), "robot", "4.530 kg"),
    "wrong baud rate": (put(deaf=True), "drives", "bus.baudrate"),
    "a drive missing": (lost, "drives", "motors.left_knee_motor.id"),
    "a duplicate address": (
        put(addresses={"left_knee_motor": 4}), "drives", "two drives may have one address"),
    "an unknown address": (put(addresses={"left_knee_motor": 21}), "drives", "a drive at address 21"),
    "a low pack": (put(voltage=12.0), "drives", "12.0 V"),
    "too high a supply": (put(voltage=24.0), "drives", "24.0 V"),
    "an encoder's error": (put(errors={"left_knee_motor": 1 << 2}), "drives", "left_knee_motor"),
    "a drive that is on": (put(enabled={"left_knee_motor"}), "drives", "torque off"),
    "knees swapped": (swap(("right_knee_motor", "left_knee_motor")), "directions", "right_knee_motor.id"),
    "knee and ankle swapped": (
        swap(("right_knee_motor", "right_ankle_motor")), "directions", "right_ankle_motor"),
    "hip motors a and b swapped": (
        swap(("right_hip_motor_a", "right_hip_motor_b")), "directions", "right_hip_motor_b"),
    "yaw and knee swapped": (
        swap(("left_yaw_motor", "left_knee_motor")), "directions", "left_knee_motor"),
    "legs swapped": (legs, "directions", "left_yaw_motor"),
    "yaw inverted": (sign("right_yaw_motor"), "directions", "right_yaw_motor.sign"),
    "hip motor a inverted": (sign("left_hip_motor_a"), "directions", "left_hip_motor_a.sign"),
    "hip motor b inverted": (sign("left_hip_motor_b"), "directions", "left_hip_motor_b.sign"),
    "knee inverted": (sign("right_knee_motor"), "directions", "right_knee_motor.sign"),
    "ankle inverted": (sign("left_ankle_motor"), "directions", "left_ankle_motor.sign"),
    "all inverted": (sign(*ROBOT.transmission.motors), "directions", "right_hip_motor_a.sign"),
    "a hip gear of another ratio": (
        put(ratios={"right_hip_motor_a": 0.5}), "directions", "motors.right_hip_motor_a"),
    "an encoder that stands still": (put(ratios={"right_yaw_motor": 0.0}), "directions", "encoder is dead"),
    "knee 90 deg off": (put(jig_error={"right_knee": np.pi / 2}), "limits", "zero of right_knee"),
    "ankle 10 deg off": (put(jig_error={"left_ankle": 0.1745}), "limits", "zero of left_ankle"),
    "hip pitch one tooth off": (put(jig_error={"left_hip_pitch": TOOTH}), "limits", "zero of left_hip_pitch"),
    "knee that does not bend": (put(limits={"right_knee": (-1.5, -0.02)}), "limits", "in the way"),
    "ankle without a stop": (put(limits={"right_ankle": (-1.8, 0.95)}), "limits", "a stop is missing"),
    "a motor's range of another ratio": (
        put(ratios={"right_yaw_motor": 2.0}), "limits", "limits of right_hip_yaw"),
    **{
        f"IMU turned by {angle} deg about {name}": (put(imu=turned(k, angle)), "imu", "mount the board along")
        for k, name in enumerate("xyz") for angle in (90, 180, 270)
    },
    "IMU askew": (put(imu=turned(2, 45)), "imu", "askew"),
    "IMU left-handed": (put(imu=np.diag([1.0, -1.0, 1.0])), "imu", "left-handed"),
    "gyroscope's axes differ": (put(gyro=turned(2, 90)), "imu", "correct its firmware's axes"),
    "gyroscope's sign": (put(gyro=-np.eye(3)), "imu", "axes"),
    "gyroscope's range": (put(gyro_scale=0.5), "imu", "board.gyro_range"),
    "accelerometer's range": (put(force_scale=0.5), "imu", "4.91 m/s^2"),
    "board dead": (put(board_dead=True), "imu", "board.port"),
    "switches left and right swapped": (switches(2, 3, 0, 1), "switches", "board.switches"),
    "toe and heel swapped": (switches(1, 0, 2, 3), "switches", "board.switches"),
    "a switch inverted": (put(inverted={"left_toe"}), "switches", "polarity is inverted"),
    "all switches inverted": (put(inverted=set(Wiring.of(ROBOT).bits)), "switches", "polarity is inverted"),
    "a switch stuck closed": (put(stuck={"left_heel"}), "switches", "closed at rest"),
    "a switch broken": (put(broken={"right_toe"}), "switches", "no change"),
}  # fmt: skip
"""By what is wrong: how, the step that finds it, and a part of its message."""


def session_with(wiring: Wiring, folder: Path) -> Session:
    data = Hardware.for_twin(ROBOT).model_dump(mode="json")
    file = folder / "bench.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    robot = RobotByHand(ROBOT, wiring)
    return Session(
        file, ROBOT, BearBus(robot.bus_port, reply_time=0.001), SenseBoard(robot.board_port), robot
    )


@pytest.mark.parametrize("name", WIRINGS)
def test_it_is_found_by_its_step(name: str, tmp_path: Path) -> None:
    change, step, text = WIRINGS[name]
    wiring = Wiring.of(ROBOT)
    change(wiring)
    session = session_with(wiring, tmp_path)
    entries = list(walk(session, Journal(session.file)))
    first = next(entry for entry in entries if entry["findings"])
    assert first["step"] == step
    told = " | ".join(" ".join(map(str, finding.values())) for finding in first["findings"])
    assert text in told
    assert all(finding["fix"] for finding in first["findings"])
    mended = all(finding["mended"] for finding in first["findings"])
    assert (len(entries) == len(STEPS)) if mended else entries[-1] is first


def test_a_right_robot_passes_and_its_file_is_complete(tmp_path: Path) -> None:
    wiring = Wiring.of(ROBOT)
    wiring.signs = {"left_knee_motor": -1}
    wiring.zeros = {name: 0.1 * k for k, name in enumerate(ROBOT.transmission.motors)}
    session = session_with(wiring, tmp_path)
    journal = Journal(session.file)
    entries = list(walk(session, journal))
    assert [entry["step"] for entry in entries] == [step.name for step in STEPS]
    assert all(entry["passed"] and entry["date"] for entry in entries)
    motors = Hardware.read(session.file, ROBOT).motors
    assert motors["left_knee_motor"].sign == -1
    for k, name in enumerate(ROBOT.transmission.motors):
        assert motors[name].offset == pytest.approx(0.1 * k, abs=1e-5)
        low, high = motors[name].range
        assert -4.0 < low < high < 4.0
    assert steps_from(Journal(session.file), None) == ()
    assert (tmp_path / "bench.yaml.before").exists()


def test_it_resumes_behind_the_last_step_that_passed(tmp_path: Path) -> None:
    wiring = Wiring.of(ROBOT)
    wiring.jig_error = {"left_knee": 0.3}
    session = session_with(wiring, tmp_path)
    list(walk(session, Journal(session.file)))
    journal = Journal(session.file)
    assert steps_from(journal, None)[0].name == "limits"
    wiring.jig_error = {}
    entries = list(walk(session, journal, "zero"))
    assert entries[0]["step"] == "zero" and all(entry["passed"] for entry in entries)
    with pytest.raises(UnknownStepError, match="there is no step 'hop'"):
        steps_from(journal, "hop")


def test_the_table_of_the_page_has_every_wiring() -> None:
    page = (Path(__file__).parents[4] / "docs/bring_up.md").read_text(encoding="utf-8")
    table = page.split("<!-- wirings -->")[1].split("<!-- end of wirings -->")[0]
    rows = [f"| {name} | `{step}` | {text} |" for name, (_, step, text) in WIRINGS.items()]
    assert table.strip().splitlines()[2:] == rows
