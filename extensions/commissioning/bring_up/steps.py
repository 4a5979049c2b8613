"""All steps, and those before power: which robot, drives, directions, zero, limits.

The steps here read, never switch a drive on, and return what they found. A discrepancy names the place,
what was expected, what was found, and the fix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ....hal.bear.bus import BusError
from ....mathematics.arrays import Array
from .. import bench
from . import power_steps, standing_steps
from .imu_step import check_imu
from .session import Request, Session, StepReport
from .switch_step import check_switches

LENGTH_ERROR, MASS_ERROR = 0.004, 0.05
"""A rule's error [m], and the share by which the mass may differ."""
SHORTEST = 0.1
"""Shorter links are not measured [m]."""
LAST_ADDRESS = 32
"""The last address that is queried."""
LEAST_MOVE = 0.1
"""Least motion of a joint by hand that shows its direction [rad]."""
RATIO_ERROR = 0.25
"""Share by which the drives' motions may differ from those of the moved joint, and the part of the motion that counts
as none."""
STOP_ERROR = 0.06
"""Largest distance of a hard stop from the description's limit [rad]: less than a gear's tooth."""
MARGIN = 0.02
"""Margin of a motor to its stops [rad]."""


@dataclass(frozen=True)
class BringUpStep:
    """A step: its name, what could go wrong with it, and what it does."""

    name: str
    risk: str
    run: Callable[[Session], StepReport]


def check_robot(session: Session) -> StepReport:
    """Check that this is the described robot: lengths of the legs and mass, measured by a person."""
    report = StepReport()
    robot = session.robot
    for joint in robot.joints:
        length = float(np.linalg.norm(joint.origin))
        if length < SHORTEST:
            continue
        text = f"measure from the axis above to the axis of {joint.name} [mm]"
        found = 1e-3 * session.operator.measure(Request("measure", joint.name, text))
        report.values[joint.name] = found
        if abs(found - length) > LENGTH_ERROR:
            report.add(
                f"robot: length to {joint.name}", f"{1e3 * length:.1f} mm", f"{1e3 * found:.1f} mm",
                f"this is another variant of {robot.name}: describe it and name it in `robot`",
            )  # fmt: skip
    mass = session.operator.measure(Request("measure", "mass", "weigh the robot [kg]"))
    report.values["mass"] = mass
    if abs(mass / robot.total_mass - 1.0) > MASS_ERROR:
        report.add(
            "robot: mass", f"{robot.total_mass:.3f} kg", f"{mass:.3f} kg",
            "another variant, or a battery is missing: describe the robot as it is",
        )  # fmt: skip
    return report


def check_drives(session: Session) -> StepReport:
    """Check that exactly the file's drives answer, healthy, off, and with a good supply."""
    report = StepReport()
    hardware = session.hardware
    answered = {
        each.device: each for each in bench.scan(session.bus, hardware, range(LAST_ADDRESS + 1))
    }
    report.values["answered"] = sorted(answered)
    if not answered:
        report.add(
            "bus.baudrate", f"answers at {hardware.bus.baudrate} bit/s from {hardware.bus.port}",
            "no answer from any address", "check supply, bus.port and bus.baudrate",
        )  # fmt: skip
        return report
    names = {motor.id: name for name, motor in hardware.motors.items()}
    damaged = session.bus.counts.damaged
    for device in sorted(set(names) - set(answered)):
        text = "no answer" + (", but damaged answers on the bus" if damaged else "")
        fix = "two drives may have one address: connect them one at a time" if damaged else (
            "check its cable and its address; a drive on another's address disturbs its answers"
        )  # fmt: skip
        report.add(
            f"motors.{names[device]}.id", f"a drive at address {device}", text, fix
        )  # fmt: skip
    for device in sorted(set(answered) - set(names)):
        report.add(
            "motors", "only the file's addresses", f"a drive at address {device}",
            "give the drive the address of the motor that is missing",
        )  # fmt: skip
    drives = hardware.drives
    for row in bench.status(session.bus, hardware):
        place = f"motors.{row['motor']}"
        if "error" in row:
            continue
        volts = float(row["input_voltage"])
        if not drives.lowest_voltage <= volts <= drives.highest_voltage:
            report.add(
                place, f"{drives.lowest_voltage:g} to {drives.highest_voltage:g} V", f"{volts:.1f} V",
                "charge the pack, or check the drive's supply",
            )  # fmt: skip
        if row["trouble"]:
            report.add(place, "a healthy drive", str(row["trouble"]), "switch it off and on")
        if row["torque_enable"]:
            report.add(
                place, "torque off", f"torque_enable = {row['torque_enable']:g}",
                "end the program that drives it, then `aloft robot estop`",
            )  # fmt: skip
    return report


def check_directions(session: Session) -> StepReport:
    """Find the drive that moves with each joint, and its direction; writes ``sign``.

    A joint moved by hand turns the drives by a column of the map from joints to motors. All
    joints together give a row for every drive, which tells the motor that it drives and its sign.
    """
    report = StepReport()
    robot, names = session.robot, session.motors
    n = len(names)
    seen = np.zeros((n, n))
    for j, joint in enumerate(robot.joints):
        axis = " ".join(f"{value:g}" for value in joint.axis)
        text = (
            f"move {joint.name} alone by about 20 deg, counter-clockwise about its axis ({axis}; "
            "forward, left, up)"
        )
        before = session.raw_positions()
        session.do(Request("move", joint.name, text))
        seen[:, j] = session.raw_positions() - before
    farthest = np.abs(seen).max(axis=0)
    for j, joint in enumerate(robot.joints):
        if farthest[j] < LEAST_MOVE:
            report.add(
                joint.name, f"drives that turn by more than {LEAST_MOVE:g} rad",
                f"{farthest[j]:.3f} rad", "move it further; if it was, its encoder is dead",
            )  # fmt: skip
    if report.discrepancies:
        return report
    turned = seen / farthest
    expected = robot.joint_to_motor / np.abs(robot.joint_to_motor).max(axis=0)
    signs: dict[str, int] = {}
    for k, name in enumerate(names):
        motor = session.hardware.motors[name]
        match = _closest_motor(turned[k], expected)
        if match is None:
            moved = [robot.joints[j].name for j in np.flatnonzero(np.abs(turned[k]) > RATIO_ERROR)]
            report.add(
                f"motors.{name}", "motion with its joints", f"motion with {', '.join(moved) or 'none'}",
                "check its gear, its belt and its encoder; move one joint at a time",
            )  # fmt: skip
            continue
        found, sign = match
        if found != k:
            report.add(
                f"motors.{name}.id", f"address {motor.id} turns with {name}",
                f"it turns with {names[found]}",
                f"swap the cables, or give {names[found]} the id {motor.id}",
            )  # fmt: skip
            continue
        signs[name] = sign
        if sign != motor.sign:
            report.add(
                f"motors.{name}.sign", f"{motor.sign:+d}", f"{sign:+d}", "written", mended=True
            )
    report.values["signs"] = signs
    if report.passed:
        session.write({name: {"sign": sign} for name, sign in signs.items()})
    return report


def _closest_motor(row: Array, expected: Array) -> tuple[int, int] | None:
    """Return the motor and the sign whose motions with all joints are those of this drive, if any."""
    for sign in (1, -1):
        errors = np.abs(sign * expected - row).max(axis=1)
        if errors.min() < RATIO_ERROR:
            return int(errors.argmin()), sign
    return None


def set_zero(session: Session) -> StepReport:
    """Take the offsets with the robot in the jig of its zero pose; writes ``offset``."""
    report = StepReport()
    session.do(Request("pose", "zero", "put the legs into the jig of the zero pose, and let go"))
    try:
        pose = np.zeros(len(session.robot.joints))
        offsets = bench.calibrate(session.bus, session.hardware, session.robot, pose)
    except BusError as error:
        report.add("jig", "drives off and at rest", str(error), "hold the robot still, try again")
        return report
    report.values["offsets"] = offsets
    session.write({name: {"offset": offset} for name, offset in offsets.items()})
    return report


def measure_limits(session: Session) -> StepReport:
    """Move every joint to both stops, and compare with the description; writes ``low`` and ``high``.

    Both ends shifted alike tell a wrong zero; another width tells another part or an obstacle.
    """
    report = StepReport()
    robot = session.robot
    n = len(robot.joints)
    lowest, highest = np.zeros(n), np.zeros(n)
    for j, joint in enumerate(robot.joints):
        track: list[float] = []

        def observe(j: int = j, track: list[float] = track) -> None:
            track.append(session.joint_positions().item(j))

        session.do(Request("stops", joint.name, f"move {joint.name} to both stops"), observe)
        lowest[j], highest[j] = min(track), max(track)
        if joint.limits is None:
            continue
        low, high = joint.limits
        report.values[joint.name] = [lowest.item(j), highest.item(j)]
        shift = 0.5 * (lowest.item(j) + highest.item(j) - low - high)
        wider = (highest.item(j) - lowest.item(j)) - (high - low)
        should, are = f"stops at {low:.3f} and {high:.3f} rad", (
            f"{lowest.item(j):.3f} and {highest.item(j):.3f} rad"
        )  # fmt: skip
        if abs(wider) > 2.0 * STOP_ERROR:
            fix = (
                "it was not moved to both stops, or something is in the way" if wider < 0.0
                else "a stop is missing, or this is another variant of the robot"
            )  # fmt: skip
            report.add(f"limits of {joint.name}", should, are, fix)
        elif abs(shift) > STOP_ERROR:
            report.add(
                f"zero of {joint.name}", should, are,
                f"its zero is off by {shift:+.3f} rad ({np.degrees(shift):+.1f} deg): check the jig and "
                "the gear's teeth, then --first zero",
            )  # fmt: skip
    if report.passed:
        session.write(_motor_ranges(session, lowest + MARGIN, highest - MARGIN))
    return report


def _motor_ranges(session: Session, low: Array, high: Array) -> dict[str, dict[str, float]]:
    """Return the range of every motor while its joints are within theirs."""
    forward = np.maximum(session.robot.joint_to_motor, 0.0)
    backward = np.minimum(session.robot.joint_to_motor, 0.0)
    lowest, highest = forward @ low + backward @ high, forward @ high + backward @ low
    return {
        name: {"low": round(lowest.item(k), 4), "high": round(highest.item(k), 4)}
        for k, name in enumerate(session.motors)
    }


STEPS = (
    BringUpStep(
        "robot", "another variant of the robot has other legs, masses and gears", check_robot
    ),
    BringUpStep("drives", "a drive is silent, has another's address, or no supply", check_drives),
    BringUpStep(
        "directions", "cables are swapped, or a motor turns the other way", check_directions
    ),
    BringUpStep("zero", "the jig is not seated, or a drive is on", set_zero),
    BringUpStep("limits", "a zero is off by a tooth, or a leg is not free", measure_limits),
    BringUpStep("imu", "the board is turned, or its range is another", check_imu),
    BringUpStep("switches", "switches are swapped, stuck, or inverted", check_switches),
    BringUpStep(
        "current",
        "a motor turns against its encoder, and would run away",
        power_steps.check_currents,
    ),
    BringUpStep(
        "watchdog", "a drive goes on when the cable is pulled", power_steps.check_watchdogs
    ),
    BringUpStep(
        "motors", "a motor is weaker than specified, or a joint is tight", power_steps.check_motors
    ),
    BringUpStep("gains", "a loop oscillates, or does not hold", power_steps.hold_in_the_air),
    BringUpStep("stand", "a switch stays open, or the robot falls", standing_steps.stand),
    BringUpStep("sit", "it sinks fast, or drives stay on", standing_steps.sit),
    BringUpStep("squat", "a leg gives way under load", standing_steps.squat),
    *(
        BringUpStep(
            f"hop_{100.0 * rise:g}cm",
            "it falls, or jumps higher than it should",
            standing_steps.hop(rise),
        )
        for rise in standing_steps.HOPS
    ),
)
"""All steps, in their order."""
