"""A real robot's drives and sensor board without a graph: found, set up, enabled and led to the
standing pose one safe step after another, and damped at the end.

``BearRobot`` puts a graph's ports around it. Time is given by whoever calls ``cycle``: a thread at
the rate of the bus, or the graph itself where the robot is a twin in virtual time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

import numpy as np

from ...blocks.signals import DrivePhase
from ...blocks.signals.robot import describe_conditions, is_critical
from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ...robots.transmission import TransmissionMap, motor_gains
from ..drive_control import DriveGoals, MotorModel
from .bus import BearBus, BusError, NoReplyError, Reply, SerialPort
from .configuration import Hardware
from .motor_loop import MotorLoop
from .protocol import Mode, Torque
from .sense_board import BoardMode, SenseBoard
from .winding_heat import hot_winding


class DriveLaw:
    """The settings of the drives, and the goals that follow from them.

    A block makes it in ``setup``, before any port is open, so that the kernel of the goals is
    compiled with those of the graph.

    Args:
        robot: the description.
        stiffness, damping: the joints' gains that run in the drives [N m/rad, N m s/rad],
            (n_joints,); where no motor gains give them, the nearest do.
        lead: the time from a measurement to when the goals made from it act [s].
        motors: what is known of the motors.

    Attributes:
        motor_stiffness, motor_damping: the gains of every drive at its output [N m/rad, N m s/rad],
            (n_joints,).
        goals: how commands become goals.
    """

    def __init__(
        self, robot: RobotDescription, stiffness: Array, damping: Array, lead: float,
        motors: MotorModel | None = None,
    ) -> None:  # fmt: skip
        self.motor_stiffness = motor_gains(robot, stiffness, "N m/rad").motor
        self.motor_damping = motor_gains(robot, damping, "N m s/rad").motor
        self.goals = DriveGoals(
            robot, stiffness, damping, self.motor_stiffness, self.motor_damping, lead, motors
        )


LISTENING = 0.05
"""Time for which the bus must be silent before anything is sent on it [s]."""
_CLEARINGS = 6
"""Number of times the torque is switched off to clear errors, as the maker's own program does."""
_RAMP = 0.2
"""The share of the soft start in which the current's limit rises to its full value."""


def find_drives(bus: BearBus, hardware: Hardware) -> dict[str, Reply]:
    """Ping every drive of the file; the answers by motor.

    Raises:
        BusError: somebody else sends on the bus, or drives do not answer: all of them are named.
    """
    if bus.listen(LISTENING):
        raise BusError(
            "another program or adapter sends instructions on the bus of the drives; nothing was "
            "sent: stop it first"
        )
    found: dict[str, Reply] = {}
    missing = []
    for name, motor in hardware.motors.items():
        try:
            found[name] = bus.ping(motor.id)
        except NoReplyError:
            missing.append(f"{name} (address {motor.id})")
    if missing:
        raise BusError(
            f"{len(missing)} of {len(hardware.motors)} drives do not answer: {', '.join(missing)}; "
            "check their supply, cables and addresses with `aloft robot scan`"
        )
    return found


def clear_errors(bus: BearBus, hardware: Hardware) -> None:
    """Switch every drive's torque off until it reports no error.

    Raises:
        BusError: a drive keeps an error: it is named with what it reports.
    """
    for name, motor in hardware.motors.items():
        for _ in range(_CLEARINGS):
            bus.write(motor.id, {"torque_enable": Torque.OFF})
            condition = bus.ping(motor.id).error_byte
            if not is_critical(condition):
                break
        else:
            raise BusError(f"drive {name} (address {motor.id}): {describe_conditions(condition)}")


def configure(
    bus: BearBus, hardware: Hardware, stiffness: Mapping[str, float], damping: Mapping[str, float]
) -> None:
    """Write and read back the configuration that a run needs; nothing of it goes to flash memory.

    Args:
        bus: the bus, with the torque of all drives off.
        hardware: limits and gains of the current loops.
        stiffness, damping: the gains of every motor at its output [N m/rad, N m s/rad].

    Raises:
        BusError: a drive does not take a value.
    """
    drives = hardware.drives
    current = dict(zip("pid", drives.iq_gains, strict=True))
    for name, motor in hardware.motors.items():
        constant = hardware.torque_constant_of(name)
        bus.verify(
            motor.id,
            {
                "mode": Mode.DIRECT_FORCE,
                "limit_i_max": drives.current_limit,
                "watchdog_timeout": round(1e6 * drives.watchdog),
                "p_gain_direct_force": stiffness[name] / constant,
                "i_gain_direct_force": 0.0,
                "d_gain_direct_force": damping[name] / constant,
                **{f"{letter}_gain_iq": gain for letter, gain in current.items()},
                **{f"{letter}_gain_id": gain for letter, gain in current.items()},
            },
        )


def check_ready(
    loop: MotorLoop,
    standing: Array,
    names: tuple[str, ...],
    load: Mapping[str, float] | None = None,
) -> None:
    """See to it that every drive is healthy and near enough to the standing pose.

    Args:
        loop: after a cycle, with the drives off.
        standing: the motors' angles in the standing pose [rad], (n_joints,).
        names: the motors.
        load: what the plan asks of them, as for ``winding_heat.rise_of``.

    Raises:
        BusError: all that is wrong, by drive.
    """
    hardware, measured = loop.hardware, loop.measured
    drives, farthest = hardware.drives, hardware.soft_start.farthest
    wrong = []
    for k, name in enumerate(names):
        voltage, angle = measured.voltage.item(k), measured.position.item(k)
        if not drives.lowest_voltage <= voltage <= drives.highest_voltage:
            wrong.append(
                f"{name} has {voltage:.1f} V instead of {drives.lowest_voltage:g} to "
                f"{drives.highest_voltage:g} V"
            )
        hot = hot_winding(hardware, name, measured.temperature.item(k), load)
        if hot is not None:
            wrong.append(str(hot))
        if not abs(angle - standing.item(k)) <= farthest:
            wrong.append(
                f"{name} is at {angle:.2f} rad and stands at {standing.item(k):.2f}: more than "
                f"{farthest:g} rad away"
            )
    if wrong:
        raise BusError(f"the drives are not enabled: {'; '.join(wrong)}")


def enable(loop: MotorLoop, names: tuple[str, ...]) -> None:
    """Switch the torque on, with the present positions as goals, and see that it is on.

    Raises:
        BusError: a drive stays off; then all are off again.
    """
    bus, hardware = loop.bus, loop.hardware
    loop.load_goals()
    off = []
    for name in names:
        bus.write(hardware.motors[name].id, {"torque_enable": Torque.ON})
    for name in names:
        loop.repeat_goals()  # the drives' watchdogs run from here on
        device = hardware.motors[name].id
        if bus.read(device, "torque_enable")["torque_enable"] != Torque.ON:
            off.append(f"{name}: {bus.ping(device).problem or 'it does not say why'}")
    if off:
        for motor in hardware.motors.values():
            bus.write(motor.id, {"torque_enable": Torque.OFF})
        raise BusError(f"drives cannot be enabled: {'; '.join(off)}")


def soft_start(loop: MotorLoop, standing: Array, next_cycle: Callable[[], bool]) -> None:
    """Lead the motors from where they are to the standing pose, slowly and with little current.

    Args:
        loop: with the drives enabled, and the present angles as ``target``.
        standing: the motors' angles in the standing pose [rad].
        next_cycle: waits for the next cycle, and says whether to go on.

    Raises:
        BusError: a fault came up, or somebody let go of the dead man's switch.
    """
    settings, period = loop.hardware.soft_start, loop.hardware.bus.period
    start, count = loop.target.copy(), max(1, math.ceil(settings.duration / period))
    loop.phase = DrivePhase.STARTING
    for k in range(1, count + 1):
        share = k / count
        loop.current_limit = settings.current * min(1.0, share / _RAMP)
        blend = 0.5 - 0.5 * math.cos(math.pi * share)
        np.multiply(standing - start, blend, out=loop.target)
        np.add(loop.target, start, out=loop.target)
        loop.cycle()
        if loop.fault:
            raise BusError(loop.fault)
        if not next_cycle():
            loop.fail("the dead man's switch was let go during the soft start")
            raise BusError(loop.fault)
    loop.target[:] = standing
    loop.phase = DrivePhase.HOLDING


_DAMPING_COMMANDS = 5
"""Least number of damping commands, since an instruction may be lost."""
_LOOK = 0.1
"""The time between two looks at the windings that cool down [s]."""
_BOARD_CYCLES = 1000
"""The exchanges within which the sensor board must have sent something."""


class Driver:
    """The drives and the sensor board of one robot.

    Args:
        robot: the description.
        hardware: how they are connected and what they may do.
        bus_port, board_port: open serial ports.
        law: the drives' gains, and how commands become their goals.
        load: what the plan of the run asks of the motors, as for ``winding_heat.rise_of``.

    Attributes:
        cooling: the strength of pump and fan that the board was told.
        waits_for_windings: whether ``close`` waits until the windings have cooled. In virtual time it
            does not: pump and fan go off at once.
    """

    waits_for_windings = True

    def __init__(
        self, robot: RobotDescription, hardware: Hardware, bus_port: SerialPort,
        board_port: SerialPort, law: DriveLaw, load: Mapping[str, float] | None = None,
    ) -> None:  # fmt: skip
        names = self._names = robot.transmission.motors
        self.hardware, self._load = hardware, load
        self.bus = BearBus(bus_port, reply_time=hardware.bus.reply_time)
        self.board = SenseBoard(board_port, hardware.board.mounted(robot))
        self._gains = (
            dict(zip(names, law.motor_stiffness.tolist(), strict=True)),
            dict(zip(names, law.motor_damping.tolist(), strict=True)),
        )
        self.loop = MotorLoop(robot, hardware, self.bus, self.board, law.goals, law.motor_stiffness)
        self.cooling = 0
        self._standing = np.zeros(len(names))
        TransmissionMap(robot).motor_motion(robot.standing_position, self._standing)

    def connect(self) -> None:
        """Find all drives and the board, and measure once. Nothing is switched on.

        Raises:
            BusError: something does not answer, or somebody else sends on the bus.
        """
        find_drives(self.bus, self.hardware)
        self.board.send(BoardMode.NOMINAL)
        for _ in range(_BOARD_CYCLES):
            self.loop.cycle()
            if self.board.packets:
                break
        self.board.require(self.hardware.board.port)
        self.loop.cycle()

    def arm(self, next_cycle: Callable[[], bool]) -> None:
        """Clear errors, configure, enable, and go to the standing pose; then the drives hold it.

        The board cools from here on.

        Args:
            next_cycle: waits for the next cycle, and says whether to go on.

        Raises:
            BusError: the text names the drive and what it does not do; nothing is left switched on.
        """
        missing = self.hardware.missing_calibration()
        if missing:
            raise BusError(f"the drives are not enabled: {'; '.join(missing)}")
        try:
            # From here on a drive may be on, so whatever goes wrong ends in damping.
            self.cooling = self.hardware.board.cooling
            self.board.send(BoardMode.NOMINAL, self.cooling)
            clear_errors(self.bus, self.hardware)
            configure(self.bus, self.hardware, *self._gains)
            self.loop.cycle()
            check_ready(self.loop, self._standing, self._names, self._load)
            enable(self.loop, self._names)
            soft_start(self.loop, self._standing, next_cycle)
            self.loop.measured.forget_torques()  # those of the way to the standing pose
        except BaseException:
            self.loop.phase = DrivePhase.DAMPED
            self.damp(_DAMPING_COMMANDS)
            raise

    def damp(self, cycles: int = 1) -> None:
        """Put all drives into damping, whatever was before; nothing if they were never on."""
        if self.loop.phase is not DrivePhase.OFF:
            self.loop.phase = DrivePhase.DAMPED
        for _ in range(cycles):
            self.loop.cycle()

    def _cool_down(self) -> None:
        """Wait until the windings have cooled, then switch pump and fan off."""
        board, loop = self.hardware.board, self.loop
        if not self.cooling:
            return
        end = time.monotonic() + board.cool_down
        try:
            while (
                self.waits_for_windings
                and loop.measured.temperature.max() > board.cooled
                and time.monotonic() < end
            ):
                loop.cycle()
                if loop.link_lost:
                    break
                time.sleep(_LOOK)
        finally:
            self.cooling = 0
            with suppress(OSError):  # its cable was pulled
                self.board.send(BoardMode.NOMINAL)

    def close(self) -> None:
        """Cool down, and give the ports back, with the drives in damping if they were on."""
        for close in (self._cool_down, self.bus.close, self.board.port.close):
            try:
                close()
            except OSError:
                continue  # a cable that was pulled
