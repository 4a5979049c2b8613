"""Every wrong wiring is found by the step that should find it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aloft.extensions.commissioning.bring_up.by_hand import STEADY, HandErrors, RobotByHand
from aloft.extensions.commissioning.bring_up.session import BringUpRecord, Session
from aloft.extensions.commissioning.bring_up.steps import STEPS
from aloft.extensions.commissioning.bring_up.walk import UnknownStepError, steps_from, walk
from aloft.extensions.commissioning.cli.bring_up_session import twin_session
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.protocol import Torque
from aloft.hal.twin.wiring import Wiring
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
    "lighter than described": (put(mass=4.53), "robot", "robot: mass"),
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
        f"IMU turned by {angle} deg about {name}": (put(imu=turned(k, angle)), "imu", "board.imu_rotation")
        for k, name in enumerate("xyz") for angle in (90, 180, 270)
    },
    "IMU askew": (put(imu=turned(2, 45)), "imu", "but for 45 deg"),
    "IMU at another place": (put(imu_position=(0.03, 0.0, 0.05)), "imu", "board.imu_position"),
    "IMU left-handed": (put(imu=np.diag([1.0, -1.0, 1.0])), "imu", "left-handed"),
    "gyroscope's axes differ": (put(gyro=turned(2, 90)), "imu", "correct its firmware's axes"),
    "gyroscope's sign": (put(gyro=-np.eye(3)), "imu", "axes"),
    "gyroscope's range": (put(gyro_scale=0.5), "imu", "board.gyro_range"),
    "accelerometer's range": (put(force_scale=0.5), "imu", "its range or its unit is another"),
    "board dead": (put(board_dead=True), "imu", "board.port"),
    "switches left and right swapped": (switches(2, 3, 0, 1), "switches", "board.switches"),
    "toe and heel swapped": (switches(1, 0, 2, 3), "switches", "board.switches"),
    "a switch inverted": (put(inverted={"left_toe"}), "switches", "board.normally_closed"),
    "all switches inverted": (put(inverted=set(Wiring.of(ROBOT).bits)), "switches", "board.normally_closed"),
    "a switch stuck closed": (put(stuck={"left_heel"}), "switches", "closed at rest"),
    "a switch broken": (put(broken={"right_toe"}), "switches", "no change"),
}  # fmt: skip
"""By what is wrong: how, the step that finds it, and a part of its message."""

UNDER_POWER: dict[str, tuple[Callable[[Wiring], None], str, str]] = {
    **{
        f"{motor.split('_', 1)[1]}'s current inverted": (
            put(current_inverted={motor}), "current", f"motors.{motor}: expected a turn with its current")
        for motor in ROBOT.transmission.motors[:5]
    },
    "a motor without current": (put(constants={"left_yaw_motor": 0.02}), "current", "its windings have no"),
    "a current limit that does not take": (
        put(fixed={"left_hip_motor_b": {"limit_i_max"}}), "current", "limit_i_max was set"),
    "a drive without its watchdog": (
        put(no_watchdog={"right_knee_motor"}), "watchdog", "motors.right_knee_motor: expected torque off"),
    "a gain that does not take": (
        put(fixed={"right_yaw_motor": {"p_gain_direct_force"}}), "motors", "p_gain_direct_force was set"),
    "a velocity of the wrong sign": (put(velocity_inverted={"right_yaw_motor"}), "motors", "right_hip_yaw"),
    "torque constant 30 % too small": (
        put(constants={"left_knee_motor": 0.7}), "motors", "motors.left_knee_motor.torque_constant"),
    "torque constant 30 % too large": (
        put(constants={"right_yaw_motor": 1.3}), "motors", "motors.right_yaw_motor.torque_constant"),
    "three times the friction": (put(friction={"left_ankle": 3.0}), "motors", "friction of left_ankle"),
}  # fmt: skip
"""The same for what only power shows."""
BEFORE_POWER = [step.name for step in STEPS].index("current")


def session_with(
    wiring: Wiring, folder: Path, seed: int = 0, errors: HandErrors = STEADY
) -> Session:
    data = Hardware.for_twin(ROBOT).model_dump(mode="json")
    file = folder / "bench.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    return twin_session(file, ROBOT, RobotByHand(ROBOT, wiring, seed, errors))


def walked(session: Session, last: str, first: str | None = None) -> list[dict[str, Any]]:
    """The entries up to the step ``last``."""
    return list(walk(session, BringUpRecord(session.file), first, last))


def assert_found(entries: list[dict[str, Any]], step: str, text: str) -> None:
    first = next(entry for entry in entries if entry["discrepancies"])
    assert first["step"] == step
    told = " | ".join(
        "{place}: expected {expected}, found {found}; {fix}".format(**each)
        for each in first["discrepancies"]
    )
    assert text in told
    assert all(each["fix"] for each in first["discrepancies"])
    if not all(each["mended"] for each in first["discrepancies"]):
        assert entries[-1] is first


def and_long(names: Iterable[str]) -> Iterator[Any]:
    """All wirings, of which those are long whose step has found another one before."""
    steps: set[str] = set()
    for name in names:
        step = WIRINGS[name][1]
        yield pytest.param(name, marks=pytest.mark.long) if step in steps else name
        steps.add(step)


@pytest.mark.parametrize("name", [*and_long(WIRINGS)])
def test_it_is_found_by_its_step(name: str, tmp_path: Path) -> None:
    change, step, text = WIRINGS[name]
    wiring = Wiring.of(ROBOT)
    change(wiring)
    entries = walked(session_with(wiring, tmp_path, 7, HandErrors()), "switches")
    assert_found(entries, step, text)
    if entries[-1]["passed"]:
        assert len(entries) == BEFORE_POWER


@pytest.mark.long
@pytest.mark.parametrize("name", UNDER_POWER)
def test_it_is_found_under_power(name: str, tmp_path: Path) -> None:
    change, step, text = UNDER_POWER[name]
    wiring = Wiring.of(ROBOT)
    change(wiring)
    entries = walked(session_with(wiring, tmp_path, 3, HandErrors()), step, step)
    assert_found(entries, step, text)


@pytest.mark.long
def test_who_lets_go_of_the_switch_ends_the_step_in_damping(tmp_path: Path) -> None:
    session = session_with(Wiring.of(ROBOT), tmp_path)
    held = iter([True] * 40)
    session._hold = lambda hardware: nullcontext(lambda: next(held, False))
    (entry,) = walked(session, "watchdog", "current")
    (found,) = entry["discrepancies"]
    assert found["place"] == "dead man's switch" and "was let go" in found["found"]
    assert entry["values"] == {}
    twin = session.operator.twin  # type: ignore[attr-defined]
    assert {drive.status["torque_enable"] for drive in twin.actuators} == {Torque.DAMPING}


def test_no_power_before_zero_and_limits(tmp_path: Path) -> None:
    session = session_with(Wiring.of(ROBOT), tmp_path)
    session.write({"left_knee_motor": {"offset": None}})
    for step in ("current", "watchdog", "motors", "gains"):
        (entry,) = walked(session, step, step)
        (found,) = entry["discrepancies"]
        assert "left_knee_motor: not calibrated" in found["found"]
    assert session.operator.twin is None  # type: ignore[attr-defined]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
def test_a_hand_is_exact_enough(seed: int, tmp_path: Path) -> None:
    """A right robot passes, and its file is right; so is that of one whose faults are written."""
    wiring = Wiring.of(ROBOT)
    wiring.signs = {"left_knee_motor": -1}
    wiring.inverted = {"left_toe"}
    wiring.imu = turned(1, 90) if seed % 2 else np.eye(3)
    session = session_with(wiring, tmp_path, seed, HandErrors())
    entries = walked(session, "switches")
    assert len(entries) == BEFORE_POWER and all(entry["passed"] for entry in entries)
    told, true = session.hardware, wiring.hardware(ROBOT)
    assert told.board.imu_to_base == pytest.approx(true.board.imu_to_base, abs=1e-3)
    assert told.board.normally_closed == ["left_toe"]
    assert told.motors["left_knee_motor"].sign == -1
    assert max(abs(motor.zero) for motor in told.motors.values()) < 0.02


@pytest.mark.long
def test_the_whole_way_from_the_first_look_to_a_hop_of_12_cm(tmp_path: Path) -> None:
    wiring = Wiring.of(ROBOT)
    wiring.signs = {"right_hip_motor_a": -1}
    wiring.zeros = {name: 0.05 * k for k, name in enumerate(ROBOT.transmission.motors)}
    wiring.imu = turned(2, 90)
    wiring.bits = [wiring.bits[k] for k in (2, 3, 0, 1)]
    wiring.inverted = {"right_heel"}
    session = session_with(wiring, tmp_path, 1, HandErrors())
    record = BringUpRecord(session.file)
    entries = list(walk(session, record))
    assert all(entry["passed"] for entry in entries), entries[-1]["discrepancies"]
    assert [entry["step"] for entry in entries] == [step.name for step in STEPS]
    rises = [e["values"]["observed_rise_m"] for e in entries if e["step"].startswith("hop")]
    assert rises == sorted(rises) and rises[-1] > 0.08
    assert steps_from(BringUpRecord(session.file), None) == ()


def test_a_right_robot_passes_and_its_file_is_complete(tmp_path: Path) -> None:
    wiring = Wiring.of(ROBOT)
    wiring.signs = {"left_knee_motor": -1}
    wiring.zeros = {name: 0.1 * k for k, name in enumerate(ROBOT.transmission.motors)}
    session = session_with(wiring, tmp_path)
    entries = walked(session, "switches")
    assert [entry["step"] for entry in entries] == [step.name for step in STEPS[:BEFORE_POWER]]
    assert all(entry["passed"] and entry["date"] for entry in entries)
    motors = Hardware.read(session.file, ROBOT).motors
    assert motors["left_knee_motor"].sign == -1
    for k, name in enumerate(ROBOT.transmission.motors):
        assert motors[name].offset == pytest.approx(0.1 * k, abs=1e-5)
        low, high = motors[name].range
        assert -4.0 < low < high < 4.0
    assert steps_from(BringUpRecord(session.file), None)[0].name == "current"
    assert (tmp_path / "bench.yaml.before").exists()


def test_it_resumes_behind_the_last_step_that_passed(tmp_path: Path) -> None:
    wiring = Wiring.of(ROBOT)
    wiring.jig_error = {"left_knee": 0.3}
    session = session_with(wiring, tmp_path)
    walked(session, "switches")
    record = BringUpRecord(session.file)
    assert steps_from(record, None)[0].name == "limits"
    wiring.jig_error = {}
    entries = walked(session, "switches", "zero")
    assert entries[0]["step"] == "zero" and all(entry["passed"] for entry in entries)
    with pytest.raises(UnknownStepError, match="there is no step 'hop'"):
        steps_from(record, "hop")


def test_the_table_of_the_page_has_every_wiring() -> None:
    page = (Path(__file__).parents[4] / "extensions/commissioning/bring_up.md").read_text(
        encoding="utf-8"
    )
    table = page.split("<!-- wirings -->")[1].split("<!-- end of wirings -->")[0]
    rows = [
        f"| {name} | `{step}` | {text} |"
        for name, (_, step, text) in (WIRINGS | UNDER_POWER).items()
    ]
    assert table.strip().splitlines()[2:] == rows


def test_the_page_has_every_step_in_order() -> None:
    page = (Path(__file__).parents[4] / "extensions/commissioning/bring_up.md").read_text(
        encoding="utf-8"
    )
    table = page.split("| step | what it does |")[1].split("\n\n")[0]
    first = [line.split("|")[1] for line in table.splitlines()[2:]]
    assert " ".join(first).replace("`", "").replace(",", "").split() == [s.name for s in STEPS]
