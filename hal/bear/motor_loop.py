"""One cycle of a real robot: goals to all drives, measurements back, the verdict on them; and who makes the cycles."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from threading import Lock

import numpy as np

from ...blocks.signals import CommandMode, DrivePhase, JointCommand, RobotHealth
from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ..drive_control import DriveGoals
from .bulk import BulkExchange
from .bus import BearBus, BusError
from .configuration import Hardware
from .measurement import FASTEST, LARGEST_STEP, PLAUSIBLE, READ, Measurement, Supervision
from .protocol import Torque
from .sense_board import SenseBoard

WRITE = ("goal_iq", "goal_position", "goal_velocity")


class MotorLoop:
    """Exchanges with the drives and polls the board, once a ``cycle``, and damps after a fault.

    What a cycle sends follows from ``phase``: nothing but questions while OFF; in STARTING and
    HOLDING the goals ``target`` at rest; in DRIVING the goals of ``command``, recomputed from the
    newest measurement; in DAMPED the drives' damping mode, again in every cycle, since an
    instruction may be lost. The first fault leads to DAMPED for good.

    A command for damping leads there too, without a fault. One for no torque gives zero torque.

    Args:
        robot: the description.
        hardware: the drives' addresses, directions and limits.
        bus: the drives' bus.
        board: the sensor board.
        goals: how commands become goals.
        motor_stiffness: the gains of the drives' position loops [N m/rad], (n_motors,).

    Attributes:
        measured: what was measured last.
        phase: what the drives do.
        command: what DRIVING follows.
        target: the motor angles of STARTING and HOLDING [rad], (n_joints,).
        current_limit: the current [A] that may be used: little in STARTING, and with the first
            command it rises to that of the drives.
        fault: the first fault; empty where there was none.
        cycles: how many there were.
        late_cycles: how many of them began too late.
        lost_answers: how many answers were lost or damaged.
        link_lost: whether the drives' port has failed, so that nothing can be sent any more.
        board_lost: whether the board's port has failed.
        clock: the time since the driver was opened [s]; by default that of the exchanges.
        stamp: when something was measured last, by this clock.
    """

    def __init__(
        self,
        robot: RobotDescription,
        hardware: Hardware,
        bus: BearBus,
        board: SenseBoard,
        goals: DriveGoals,
        motor_stiffness: Array,
    ) -> None:
        names = robot.transmission.motors
        devices = [hardware.motors[name].id for name in names]
        self.bus, self.board, self.hardware = bus, board, hardware
        self.measured = Measurement(robot, hardware)
        self.supervision = Supervision(hardware, names)
        self.goals = goals
        self.command = JointCommand.allocate(robot.dimensions)
        self.phase = DrivePhase.OFF
        self.fault = ""
        self.cycles = self.late_cycles = 0
        self.link_lost = self.board_lost = False
        self.clock: Callable[[], float] = lambda: self.cycles * hardware.bus.period
        self.stamp = 0.0
        self.lock = Lock()
        """Held while measurements or the command are written: who reads them from another thread
        takes it."""
        self.lost_answers = 0
        n = len(names)
        self.target = np.zeros(n)
        drives = hardware.drives
        self.current_limit = drives.current_limit
        self._highest_current = drives.current_limit - drives.current_margin
        soft = hardware.soft_start
        ramp = max(1, round(soft.ramp / hardware.bus.period))
        self._rise = max(0.0, self._highest_current - soft.current) / ramp
        self._stiffness = np.maximum(motor_stiffness, 1e-9)
        self._watch = BulkExchange(bus, devices, READ, ())
        self._drive = BulkExchange(bus, devices, READ, WRITE)
        self._damp = BulkExchange(bus, devices, READ, ("torque_enable",))
        self._damp.goals.fill(Torque.DAMPING)
        for exchange in (self._watch, self._drive, self._damp):
            exchange.plausible[:] = PLAUSIBLE
            exchange.largest_step[0] = LARGEST_STEP + FASTEST * hardware.bus.period
        self._released = JointCommand.allocate(robot.dimensions)
        self._reach, self._scratch = np.zeros(n), np.zeros(n)
        ranges = np.array([hardware.motors[name].range for name in names])
        self._low, self._high = ranges[:, 0].copy(), ranges[:, 1].copy()
        self._last = self._watch

    def cycle(self) -> int:
        """Exchange once with everything; gives how many drives answered.

        It raises nothing: whatever goes wrong is a ``fault``.
        """
        self.cycles += 1
        if self.link_lost:
            return 0
        try:
            with self.lock:
                bulk = self._prepare()
                self._switch_to(bulk)
            answered = bulk.exchange()
        except BusError as error:
            self.fail(str(error))
            return 0
        except Exception as error:  # noqa: BLE001  # whatever a serial port raises
            self.link_lost = True
            self.fail(
                f"a port failed ({type(error).__name__}: {error}): the drives stop by their own "
                "watchdog"
            )
            return 0
        fresh = self._poll_board()
        with self.lock:
            self.lost_answers += len(bulk.ages) - answered
            self.measured.take_drives(bulk)
            if answered:
                self.stamp = self.clock()
            if fresh:
                self.measured.take_board(self.board)
        driving = self.phase in (DrivePhase.STARTING, DrivePhase.HOLDING, DrivePhase.DRIVING)
        fault = self.supervision.check_drives(self.measured, bulk, driving)
        fault = self.supervision.check_board(self.board, fresh) or fault
        if fault and driving:
            self.fail(fault)
        return answered

    def _poll_board(self) -> int:
        """Read the board, and return the number of its new packets. Its port is not the drives': without it they are
        damped."""
        if self.board_lost:
            return 0
        try:
            return self.board.poll()
        except Exception as error:  # noqa: BLE001  # whatever a serial port raises
            self.board_lost = True
            self.fail(f"the port of the sensor board failed ({type(error).__name__}: {error})")
            return 0

    def follow(self, command: JointCommand) -> None:
        """Follow this command from the next cycle on, if the drives are on."""
        with self.lock:
            for name, values in command:
                getattr(self.command, name)[...] = values
            if self.phase is DrivePhase.HOLDING:
                self.phase = DrivePhase.DRIVING

    def fail(self, reason: str) -> None:
        """Damp from the next cycle on, for this reason, unless there was another before."""
        if not self.fault:
            self.fault = reason
        if self.phase is not DrivePhase.OFF:
            self.phase = DrivePhase.DAMPED

    def load_goals(self) -> None:
        """Write the present positions as goals, with the drives off: what they hold at first."""
        self.target[:] = self.measured.position
        self._fill(self.target)
        self._switch_to(self._drive)
        self._drive.exchange()
        self.measured.take_drives(self._drive)

    def repeat_goals(self) -> None:
        """Send the same goals again."""
        self._drive.exchange()

    def report(self, health: RobotHealth) -> None:
        """Write how everything is."""
        measured, bulk, period = self.measured, self._last, self.hardware.bus.period
        health.state[()] = self.phase
        health.voltage[:] = measured.voltage
        health.temperature[:] = measured.temperature
        health.current[:] = measured.current
        health.condition[:] = bulk.error_bytes
        for k, age in enumerate(bulk.ages.tolist()):
            health.age[k] = age * period
        silent = self.supervision.imu_silent
        health.imu_age[()] = silent * period
        health.stamp[()] = self.stamp
        health.joints_valid[()] = not self.link_lost and not any(bulk.ages.tolist())
        health.imu_valid[()] = not self.link_lost and self.supervision.imu_valid
        health.contacts_valid[()] = not self.link_lost and silent == 0
        health.late_cycles[()] = self.late_cycles
        health.lost_answers[()] = self.lost_answers

    def parts(self) -> list[tuple[object, tuple[str, ...]]]:
        """Return the objects that change in a run, and the names of their attributes."""
        found: list[tuple[object, tuple[str, ...]]] = [
            (self, ("phase", "cycles", "late_cycles", "lost_answers", "target", "current_limit",
                    "link_lost", "board_lost", "stamp", "exchange_in_use")),
            (self.supervision, ("low", "hot", "still", "last", "moved", "numbers", "frozen",
                                "saturated", "imu_silent", "imu_valid")),
            *self.measured.parts(),
            (self.board, ("specific_force", "angular_velocity", "closed", "packets")),
            *((sample, tuple(sample.views())) for sample in self.board.samples.values()),
            (self.command, tuple(self.command.views())),
        ]  # fmt: skip
        exchanges = (self._watch, self._drive, self._damp)
        return found + [
            (each, ("goals", "values", "ages", "error_bytes", "known")) for each in exchanges
        ]

    def restored(self) -> None:
        """Take over what was set from outside."""
        self.measured.restored(self._last)
        if self.phase is not DrivePhase.DAMPED:
            self.fault = ""

    @property
    def exchange_in_use(self) -> int:
        """The number of the last exchange: 0 to watch, 1 to drive, 2 to damp."""
        return (self._watch, self._drive, self._damp).index(self._last)

    @exchange_in_use.setter
    def exchange_in_use(self, which: int) -> None:
        self._last = (self._watch, self._drive, self._damp)[which]

    def _switch_to(self, bulk: BulkExchange) -> None:
        """Take over the last answers into another exchange: a drive may not answer at first."""
        if bulk is not self._last:
            bulk.ages[:] = self._last.ages
            bulk.values[:] = self._last.values
            bulk.error_bytes[:] = self._last.error_bytes
            bulk.known[:] = self._last.known
            self._last = bulk

    def _prepare(self) -> BulkExchange:
        """Return the exchange that belongs to the phase, with its goals."""
        measured = self.measured
        if self.phase is DrivePhase.DRIVING and self.command.mode[()] == CommandMode.DAMPING:
            self.phase = DrivePhase.DAMPED
        if self.phase is DrivePhase.OFF:
            return self._watch
        if self.phase is DrivePhase.DAMPED:
            return self._damp
        if self.phase is DrivePhase.DRIVING:
            active = self.command.mode[()] == CommandMode.ACTIVE
            self.goals.follow(
                self.command if active else self._released, measured.position, measured.velocity,
                measured.joint_position, measured.joint_velocity,
            )  # fmt: skip
            if self.current_limit < self._highest_current:
                self._limit_current()
        else:
            self._approach()
        self._fill(self.goals.position)
        return self._drive

    def _approach(self) -> None:
        """Goals at rest, no further from where the motors are than the current's limit allows."""
        measured = self.measured
        np.divide(self.current_limit * measured.torque_constant, self._stiffness, out=self._reach)
        self.goals.hold(self.target)
        np.subtract(measured.position, self._reach, out=self._scratch)
        np.maximum(self.goals.position, self._scratch, out=self.goals.position)
        np.add(measured.position, self._reach, out=self._scratch)
        np.minimum(self.goals.position, self._scratch, out=self.goals.position)

    def _limit_current(self) -> None:
        """Keep the torques within a limit that rises from that of the soft start.

        The drives add their own feedback to a goal, so the two together are limited.
        """
        self.current_limit = min(self._highest_current, self.current_limit + self._rise)
        goals, measured, gears = self.goals, self.measured, self.goals.gears
        largest = self.current_limit * measured.torque_constant
        feedback, scratch = self._reach, self._scratch
        np.subtract(goals.position, measured.position, out=feedback)
        np.multiply(feedback, gears.motor_stiffness, out=feedback)
        np.subtract(goals.velocity, measured.velocity, out=scratch)
        np.multiply(scratch, gears.motor_damping, out=scratch)
        np.add(feedback, scratch, out=feedback)
        np.add(goals.torque, feedback, out=scratch)
        np.minimum(scratch, largest, out=scratch)
        np.maximum(scratch, -largest, out=scratch)
        np.subtract(scratch, feedback, out=goals.torque)

    def _fill(self, position: Array) -> None:
        """Write the goals in the drives' units and directions, clamped to what they do not ignore."""
        measured, goals, out = self.measured, self.goals, self._drive.goals
        np.divide(goals.torque, measured.torque_constant, out=self._scratch)
        np.minimum(self._scratch, self._highest_current, out=self._scratch)
        np.maximum(self._scratch, -self._highest_current, out=self._scratch)
        np.multiply(self._scratch, measured.sign, out=out[:, 0])
        np.maximum(position, self._low, out=self._scratch)
        np.minimum(self._scratch, self._high, out=self._scratch)
        np.add(self._scratch, measured.offset, out=self._scratch)
        np.multiply(self._scratch, measured.sign, out=out[:, 1])
        np.multiply(goals.velocity, measured.sign, out=out[:, 2])


_SWITCHING = 2e-4
"""Time after which Python lets another thread run [s]; its default is five periods of the bus."""
_TIMED_CYCLES = 256
"""The number of last cycles of which is known when they were done."""


class MotorThread:
    """Makes a cycle every period, whatever the graph does.

    While the drives are on it damps them when the last command is older than ``command_age``, or
    when ``stop_reason`` gives a reason.

    Args:
        loop: the motor loop.
        command_age: how old a command may be [s].
        stop_reason: called before every cycle; a text that is not empty ends the driving.
    """

    def __init__(self, loop: MotorLoop, command_age: float, stop_reason: Callable[[], str]) -> None:
        self._loop, self._command_age, self._stop_reason = loop, command_age, stop_reason
        self._stop = threading.Event()
        self._cycle = threading.Condition()
        self._done = 0
        self._done_at = [0] * _TIMED_CYCLES
        self._commanded = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="aloft motors", daemon=True)
        self._switching = sys.getswitchinterval()

    @property
    def done(self) -> int:
        """The cycles so far."""
        return self._done

    def done_at(self, cycle: int) -> int:
        """Return when one of the last cycles was done, by ``time.perf_counter_ns``; zero if it was
        not, or too long ago."""
        behind = self._done - cycle
        return self._done_at[cycle % _TIMED_CYCLES] if 0 <= behind < _TIMED_CYCLES else 0

    def start(self) -> None:
        """Begin."""
        sys.setswitchinterval(_SWITCHING)
        self._commanded = time.monotonic()
        self._thread.start()

    def follow(self, command: JointCommand, last_command: int = 0) -> None:
        """Follow this command from the next cycle on.

        ``last_command`` says when what it was made from last came from another machine, by the monotonic
        clock [ns]; zero where it was made here.
        """
        self._commanded = last_command * 1e-9 if last_command else time.monotonic()
        self._loop.follow(command)

    def wait_for(self, cycle: int, seconds: float) -> bool:
        """Wait until this number of cycles is done; returns whether it is."""
        with self._cycle:
            return self._cycle.wait_for(lambda: self._done >= cycle, seconds)

    def stop(self) -> None:
        """End after the present cycle."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(2.0)
        sys.setswitchinterval(self._switching)

    def _run(self) -> None:
        loop, period = self._loop, self._loop.hardware.bus.period
        following = time.monotonic()
        while not self._stop.is_set():
            if loop.phase in (DrivePhase.HOLDING, DrivePhase.DRIVING):
                self._look()
            loop.cycle()
            with self._cycle:
                self._done += 1
                self._done_at[self._done % _TIMED_CYCLES] = time.perf_counter_ns()
                self._cycle.notify_all()
            following += period
            rest = following - time.monotonic()
            if rest > 0.0:
                time.sleep(rest)
            else:
                loop.late_cycles += 1
                following -= rest

    def _look(self) -> None:
        age = time.monotonic() - self._commanded
        reason = self._stop_reason()
        if reason:
            self._loop.fail(reason)
        elif age > self._command_age and self._loop.phase is DrivePhase.DRIVING:
            self._loop.fail(f"no new command has come for {1e3 * age:.0f} ms")


class CommandQueue:
    """Gives each command to the motor loop when its latency is over, and makes a tick's cycles.

    In cycle ``j`` (from 1) behind tick ``n`` acts the newest command that is ``latency`` old, in
    whole periods of the bus, of which at least one has passed: the command of the tick itself can
    only be in the next exchange.

    Args:
        loop: the motor loop.
        robot: the description.
        latency: from the measurement to the exchange that carries the command [s].
        tick: the graph's period [s]; it is a whole number of the bus's.

    Attributes:
        commands: memory for the commands on their way.
        sent: how many commands there were.
    """

    def __init__(
        self, loop: MotorLoop, robot: RobotDescription, latency: float, tick: float
    ) -> None:
        period = loop.hardware.bus.period
        self._loop = loop
        self.cycles = round(tick / period)
        self._wait = max(1, math.ceil(latency / period - 1e-9))
        slots = math.ceil(latency / period) + 2  # enough for any tick
        self.commands = [JointCommand.allocate(robot.dimensions) for _ in range(slots)]
        self.sent = 0

    def give(self, command: JointCommand) -> None:
        """Take over the command of this tick."""
        slot = self.commands[self.sent % len(self.commands)]
        for name, values in command:
            getattr(slot, name)[...] = values
        self.sent += 1

    def advance(self) -> None:
        """Make the cycles up to the next tick."""
        for j in range(1, self.cycles + 1):
            age = max(0, (self._wait - j + self.cycles - 1) // self.cycles)
            index = self.sent - 1 - age
            if index >= 0:
                self._loop.follow(self.commands[index % len(self.commands)])
            self._loop.cycle()

    def parts(self) -> list[tuple[object, tuple[str, ...]]]:
        """Return the objects that change in a run, and the names of their attributes."""
        found: list[tuple[object, tuple[str, ...]]] = [(self, ("sent",))]
        return found + [(command, tuple(command.views())) for command in self.commands]
