"""The steps with power and the feet in the air: current signs, watchdogs, motors and joints, gains.

Only the drives of one motor or joint are on at a time, all others are in damping; only the last step
switches all of them on. Every step ends in damping, whatever happens.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import yaml

from ....blocks.signals import DrivePhase
from ....hal.bear.bulk import BulkExchange
from ....hal.bear.bus import BusError
from ....hal.bear.driver import DriveLaw, Driver
from ....hal.bear.protocol import Torque
from .. import bench
from ..identification.calibration import COMPENSATED
from .air_identification import AirMotion, identify_in_air, joint_inertia
from .session import LetGoError, Request, Session, StepReport, go_on

SHARE = 0.01
"""The share of its current limit with which a motor is tried at first."""
LARGEST_SHARE = 0.06
"""The largest share that is tried, where friction holds the motor."""
RISE = 0.15
"""The time from the first to the largest share [s]."""
TURNED = 0.02
"""Least turn of a motor that shows its direction [rad]."""
SILENT_FOR = 3.0
"""Time without a write to a drive, in times of its watchdog."""
SWING, SLOW = 0.12, 0.12
"""Amplitudes of the two waves of a joint [rad]."""
SLOW_RATE, SWING_RATES = 0.7, (2.0, 6.0)
"""The frequency of the slow wave, which shows the friction, and the lowest and highest of the swing [Hz]."""
SWING_TORQUE = 0.4
"""Torque that the inertia asks of the motor in the swing, which shows its torque constant [N m]: several times the
friction."""
WAVE_TIME = 1.5
"""Duration of a joint's motion [s]."""
APPROACH = 0.5
"""Time to reach the middle of the waves, and to grow them [s]."""
STIFFNESS, DAMPING = 12.0, 0.3
"""Stiffness and damping of the drives that move it, at their outputs [N m/rad, N m s/rad]."""
CONSTANT_ERROR = 0.2
"""The share by which a torque constant may differ: the links' inertias are not known better."""
WRITTEN_ERROR = 0.5
"""The share up to which another torque constant is written into the file."""
FRICTION_FACTOR = 2.0
"""Largest friction of a joint, in times of that described: more is a fault of its bearing or gear."""
FRICTION_ERROR = 0.5
"""The share of the described friction that this test cannot tell: no more than that is compensated."""
FRICTION_SPEED = 3.0
"""The speed at which frictions are compared, Coulomb and viscous together [rad/s]."""
HOLD_TIME = 1.0
"""Time for which all drives hold the standing pose in the air [s]."""
HELD_WITHIN, STILL_RATE = 0.3, 0.5
"""Largest distance of a motor from its goal [rad], and its largest speed, root mean square [rad/s]."""


def check_currents(session: Session) -> StepReport:
    """Give one motor after the other a little current both ways, and check that it turns as its encoder reads."""
    report = StepReport()
    if not _hang(session, report):
        return report
    turned: dict[str, float] = {}
    with session.hold() as next_cycle:
        for name in session.motors:
            try:
                turned[name] = _push(session, name, next_cycle)
            except LetGoError:
                raise
            except BusError as error:
                report.add(
                    f"motors.{name}", "a drive that follows a small current", str(error),
                    "look for the drive's error and its supply; compare its registers with another's",
                )  # fmt: skip
    report.values["turned"] = turned
    for name, angle in turned.items():
        if abs(angle) < TURNED:
            report.add(
                f"motors.{name}", f"a turn at {100.0 * LARGEST_SHARE:g} % of its current",
                f"{angle:+.3f} rad", "its windings have no current, or the joint is jammed",
            )  # fmt: skip
        elif angle < 0.0:
            report.add(
                f"motors.{name}", "a turn with its current", f"{angle:+.3f} rad, against it",
                "current and encoder have opposite signs: swap two of its phases, or calibrate the "
                "drive's commutation anew",
            )  # fmt: skip
    return report


def _push(session: Session, name: str, next_cycle: Callable[[], bool]) -> float:
    """Return the angle by which the motor turns with its current, both ways together [rad]."""
    hardware = session.hardware
    limit = hardware.drives.current_limit
    count = round(RISE / hardware.bus.period)
    total = 0.0
    with bench.PoweredDrives(session.bus, hardware, [name], LARGEST_SHARE * limit) as drive:
        for way in (1.0, -1.0):
            start = drive.position.item(0)
            for k in range(count):
                share = SHARE + (LARGEST_SHARE - SHARE) * k / count
                drive.exchange(current=np.array([way * share * limit]))
                session.board.poll()
                if abs(drive.position.item(0) - start) > 2.0 * TURNED:
                    break
                go_on(next_cycle)
            total += way * (drive.position.item(0) - start)
            while abs(drive.velocity.item(0)) > 0.2:  # it coasts to rest
                drive.exchange()
                go_on(next_cycle)
    return total


def check_watchdogs(session: Session) -> StepReport:
    """Switch one drive on without current, and write nothing to it: does it switch itself off?"""
    report = StepReport()
    if not _hang(session, report):
        return report
    hardware = session.hardware
    silent = SILENT_FOR * hardware.drives.watchdog
    report.values["silent_for_ms"] = 1e3 * silent
    with session.hold() as next_cycle:
        for name in session.motors:
            device = hardware.motors[name].id
            others = [hardware.motors[each].id for each in session.motors if each != name]
            others = others or [device]
            reading = BulkExchange(session.bus, others, ("present_position",), ())
            try:
                with bench.PoweredDrives(
                    session.bus, hardware, [name], SHARE * hardware.drives.current_limit
                ):
                    for _ in range(math.ceil(silent / hardware.bus.period)):
                        reading.exchange()
                        session.board.poll()
                        go_on(next_cycle)
                    state = session.bus.read(device, "torque_enable")["torque_enable"]
            except LetGoError:
                raise
            except BusError as error:
                report.add(f"motors.{name}", "a drive that answers", str(error), "check its cable")
                continue
            if state == Torque.ON:
                report.add(
                    f"motors.{name}", f"torque off after {1e3 * hardware.drives.watchdog:g} ms of silence",
                    f"still on after {1e3 * silent:g} ms",
                    "its watchdog does not act in direct-force mode: with a pulled cable nothing would "
                    "stop it; update its firmware, or never go on without a switch in its supply",
                )  # fmt: skip
    return report


def check_motors(session: Session) -> StepReport:
    """Move one joint after the other, slowly and in a swing: torque constants and friction.

    Torque constants beyond ``CONSTANT_ERROR`` are written; friction beyond the description's goes to
    ``NAME.friction.yaml`` for the graphs of the next steps.
    """
    report = StepReport()
    if not _hang(session, report):
        return report
    robot, hardware = session.robot, session.hardware
    motions: list[AirMotion] = []
    with session.hold() as next_cycle:
        for j, joint in enumerate(robot.joints):
            try:
                motions.append(_wave(session, j, next_cycle))
            except LetGoError:
                raise
            except BusError as error:
                report.add(
                    joint.name, "a joint that follows two waves", str(error),
                    "compare the drive's registers and its velocity with another's, and look at the "
                    "joint's gear",
                )  # fmt: skip
                return report
    constants, found = identify_in_air(robot, motions, hardware.bus.period)
    before = hardware.torque_constants(robot)
    report.values["torque_constant_factors"] = dict(zip(session.motors, constants, strict=True))
    report.values["friction_nm"] = {name: f.coulomb for name, f in found.items()}
    report.values["damping_nms"] = {name: f.viscous for name, f in found.items()}
    written: dict[str, dict[str, float]] = {}
    for k, name in enumerate(session.motors):
        factor = constants[k]
        if abs(factor - 1.0) <= CONSTANT_ERROR:
            continue
        value = float(round(factor * before.item(k), 4))
        mended = abs(factor - 1.0) <= WRITTEN_ERROR
        report.add(
            f"motors.{name}.torque_constant", f"{before.item(k):.3f} N m/A", f"{value:.3f} N m/A",
            "written" if mended else "this is another motor or gear: look at its label",
            mended=mended,
        )  # fmt: skip
        written[name] = {"torque_constant": value}
    extra: dict[str, float] = {}
    for k, joint in enumerate(robot.joints):
        known = float(robot.motors.friction[k] + FRICTION_SPEED * robot.motors.damping[k])
        friction = found[joint.name].coulomb + FRICTION_SPEED * found[joint.name].viscous
        more = friction - known
        extra[joint.name] = round(COMPENSATED * more, 4) if more > FRICTION_ERROR * known else 0.0
        if friction > FRICTION_FACTOR * known:
            report.add(
                f"friction of {joint.name}", f"about {known:.3f} N m", f"{friction:.3f} N m",
                "its bearing or its gear is jammed or too tight: turn it by hand and compare it with "
                "the other leg's",
            )  # fmt: skip
    if report.passed:
        session.write(written)
        text = "# Beyond the description's, found by `aloft robot bring-up` in the air.\n"
        text += yaml.safe_dump({"set": {"joint_pd.friction": extra}}, sort_keys=False)
        session.friction_file.write_text(text, encoding="utf-8")
    return report


def _wave(session: Session, j: int, next_cycle: Callable[[], bool]) -> AirMotion:
    """Move joint ``j`` in two waves, by the drives of its motors; gives what was measured.

    Raises:
        BusError: a drive does not do what it should, or the switch was let go.
    """
    robot, hardware = session.robot, session.hardware
    names, period = session.motors, hardware.bus.period
    to_motor = robot.joint_to_motor
    on = np.flatnonzero(to_motor[:, j]).tolist()
    constant = float(hardware.torque_constants(robot)[on].min())
    to_base = hardware.board.imu_to_base
    count, approach = round(WAVE_TIME / period), round(APPROACH / period)
    motion = AirMotion.allocate(robot, count, on)
    with bench.PoweredDrives(
        session.bus, hardware, [names[k] for k in on], hardware.soft_start.current,
        STIFFNESS / constant, DAMPING / constant, watched=names,
    ) as drives:  # fmt: skip
        start = np.asarray(np.linalg.solve(to_motor, drives.position), dtype=np.float64)
        low, high = robot.joints[j].limits or (-math.inf, math.inf)
        reach = SWING + SLOW + 0.05
        middle = min(max(start.item(j), low + reach), high - reach)
        swing = math.sqrt(SWING_TORQUE / (SWING * joint_inertia(robot, start).item(j)))
        fast = min(max(swing, 2.0 * math.pi * SWING_RATES[0]), 2.0 * math.pi * SWING_RATES[1])
        slow = 2.0 * math.pi * SLOW_RATE
        goal, speed = start.copy(), np.zeros(len(start))
        for k in range(-approach, count):
            time, share = k * period, min(1.0, 1.0 + k / approach)
            blend = 0.5 - 0.5 * math.cos(math.pi * share)
            wave = SWING * math.sin(fast * time) + SLOW * math.sin(slow * time)
            rate = SWING * fast * math.cos(fast * time) + SLOW * slow * math.cos(slow * time)
            goal[j] = start.item(j) + blend * (middle - start.item(j) + wave)
            speed[j] = blend * rate
            drives.exchange((to_motor @ goal)[on], (to_motor @ speed)[on])
            session.board.poll()
            if k >= 0:
                motion.position[k] = np.linalg.solve(to_motor, drives.position)
                motion.velocity[k] = np.linalg.solve(to_motor, drives.velocity)
                motion.torque[k] = hardware.torque_constants(robot) * drives.current
                motion.rate[k] = to_base @ session.board.angular_velocity
                motion.force[k] = to_base @ session.board.specific_force
            go_on(next_cycle)
    return motion


def hold_in_the_air(session: Session) -> StepReport:
    """Lead all drives to the standing pose with rising current, and see that they hold it quietly."""
    report = StepReport()
    if not _hang(session, report):
        return report
    robot, hardware = session.robot, session.hardware
    stiffness = np.asarray(robot.motors.peak_torque) / 3.0
    law = DriveLaw(robot, stiffness, 0.025 * stiffness, hardware.bus.lead)
    driver = Driver(robot, hardware, session.bus.port, session.board.port, law)
    names, loop = session.motors, driver.loop
    count = round(HOLD_TIME / hardware.bus.period)
    error, speed = np.zeros(len(names)), np.zeros((count, len(names)))
    try:
        with session.hold() as next_cycle:
            driver.connect()
            driver.arm(next_cycle)
            for k in range(count):
                loop.cycle()
                if loop.fault:
                    raise BusError(loop.fault)
                speed[k] = loop.measured.velocity
                go_on(next_cycle)
            error[:] = loop.measured.position - loop.target
    except LetGoError:
        raise
    except BusError as error_text:
        report.add(
            "drives", "drives that hold the standing pose in the air", str(error_text),
            "the text names the drive: --first current",
        )  # fmt: skip
        return report
    finally:
        if loop.phase is not DrivePhase.OFF:
            driver.damp(5)
    half = speed[count // 2 :]
    rates = np.sqrt((half**2).mean(axis=0))
    report.values["error_rad"] = dict(zip(names, error.round(4).tolist(), strict=True))
    report.values["rate_rad_s"] = dict(zip(names, rates.round(4).tolist(), strict=True))
    for k, name in enumerate(names):
        if abs(error.item(k)) > HELD_WITHIN:
            report.add(
                f"motors.{name}", f"the standing pose within {HELD_WITHIN:g} rad",
                f"{error.item(k):+.2f} rad off", "something holds the joint, or its gain is too small",
            )  # fmt: skip
        if rates.item(k) > STILL_RATE:
            report.add(
                f"motors.{name}", "a motor at rest", f"{rates.item(k):.2f} rad/s",
                "it oscillates: compare its gains and its velocity with another's",
            )  # fmt: skip
    return report


def _hang(session: Session, report: StepReport) -> bool:
    """Have the robot hung up, with all drives in damping; return whether they are, and may be switched on."""
    missing = session.hardware.missing_calibration()
    if missing:
        report.add(
            "motors", "zero and limits before power", "; ".join(missing), "--first zero"
        )  # fmt: skip
        return False
    session.do(
        Request(
            "hang", "",
            "hang the robot in the gantry, feet in the air, nobody within reach of its legs, emergency "
            "stop at hand",
        )
    )  # fmt: skip
    unsure = bench.stop(session.bus, session.hardware)
    if unsure:
        report.add(
            "drives", "all drives in damping", f"not certain of {', '.join(unsure)}",
            "check cables and supply; --first drives",
        )  # fmt: skip
    return not unsure
