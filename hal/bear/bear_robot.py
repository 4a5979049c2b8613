"""A real robot on BEAR actuators and BRUCE's sensor board."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from ...blocks.signals import DrivePhase
from ...runtime.language.block import Context, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ..drive_control import joint_gains
from .bus import BusError, open_port
from .configuration import Hardware, HardwareError
from .driven_robot import DrivenRobot, DriveParameters, missing_sensors, read_hardware
from .driver import DriveLaw, Driver
from .motor_loop import CommandQueue, MotorThread
from .watchdog import AlwaysHeld, DeadMansSwitch, DriveWatchdog, open_switch, wait_until_held

_HOLDING_TIME = 30.0
"""Longest wait for somebody to take the dead man's switch [s]."""
_LOST_TIME = 1.0
"""After so long without a cycle the motor thread counts as dead [s]."""


class BearParameters(DriveParameters):
    """The parameters of ``BearRobot``."""

    hardware: str = parameter(..., text="file of the hardware, relative to the graph")
    time: Literal["real", "virtual"] = parameter(
        "real", text="virtual: the robot is a twin whose time goes on with the exchanges"
    )
    command_age: float = parameter(
        0.02, unit="s", gt=0, le=1.0, text="without a command for so long the drives are damped"
    )
    graph_timeout: float = parameter(
        0.025, unit="s", gt=0, le=2.0, text="after so long the watchdog's process damps the drives"
    )
    sit_down_speed: float = parameter(
        0.15, unit="m/s", ge=0.0, le=0.5,
        text="speed at which a robot that stands at the end sits down before it is damped; zero: not",
    )  # fmt: skip
    latency: float = parameter(
        0.0, unit="s", ge=0, le=0.1, text="with virtual time: delay from sensing to the exchange"
    )


class BearRobot(DrivenRobot):
    """The robot of the graph on BEAR drives and BRUCE's sensor board (``extensions/commissioning/bring_up.md``).

    **Nothing moves unless** ``armed`` is true. Without it the drives are watched, and never written
    to. With it ``open`` finds every drive, refuses if somebody else sends on the bus, waits for the
    dead man's switch, clears errors, writes the configuration and reads it back, checks voltages,
    temperatures and angles, starts the watchdog, enables the drives where they are, leads them to
    the standing pose with little current, and holds it until the first command.

    **Time.** A thread exchanges with all drives once every period of the bus, 1 kHz, with goals made
    from the newest command and the newest measurement; the graph runs beside it. Its clock should
    be ``robot``, with which ticks begin with the thread's cycles, or ``paced``; an armed robot is not
    opened with a ``free`` one.

    **Ends.** Every fault ends in the drives' damping mode, and the run with the reason:

    * in the motor thread: a drive or the board is silent, reports an error, is too hot, has too low
      a voltage; a stuck encoder, a frozen IMU, a saturated gyroscope; a second writer on the bus; a
      command older than ``command_age``; the dead man's switch let go;
    * in a process of its own: ``aloft robot estop`` is called; the graph hangs for ``graph_timeout`` or
      has died, or a link that brings commands from another machine was silent for ``links.watchdog``, by default 15 ms;
    * in the drives: nothing written for the hardware's ``drives.watchdog``.

    It was never run on a real robot; against the twin every shipped jump was (``aloft twin``).

    Raises:
        BusError: ``open`` could not do one of its steps; the text says which drive, and why.
    """

    Params = BearParameters
    params: BearParameters

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report gains that no drives can give the joints, and a wrong file of the hardware."""
        assert isinstance(params, BearParameters) and context.robot is not None
        yield from super().requires(params, context)
        try:
            hardware = read_hardware(params.hardware, context, context.robot)
        except HardwareError as error:
            yield UnmetRequirement(str(error), parameter="hardware", found=params.hardware)
            return
        yield from missing_sensors(hardware, context.robot)
        if params.armed and params.time == "virtual" and not hardware.bus.is_virtual:
            yield UnmetRequirement(
                f"in virtual time nothing guards the drives at {hardware.bus.port}: only a twin may be "
                "armed so",
                parameter="time",
                expected="real, or the file that `aloft twin --virtual --out` writes",
                found="virtual",
            )
        ratio = context.period / hardware.bus.period
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            yield UnmetRequirement(
                f"the bus's period {hardware.bus.period} s does not divide the control period "
                f"{context.period} s"
            )

    @classmethod
    def example_parameters(cls) -> dict[str, str]:
        """Return the file of BRUCE's hardware."""
        return {"hardware": str(Path(__file__).parents[2] / "graphs/hardware/bruce.yaml")}

    def setup(self) -> None:
        """Read the file of the hardware; nothing is opened."""
        super().setup()
        self._hardware: Hardware = read_hardware(self.params.hardware, self.context, self.robot)
        gains = joint_gains(self.params, self.robot)
        motors = self.params.motor_model
        self._law = DriveLaw(self.robot, *gains, self._hardware.bus.lead, motors)
        self._thread: MotorThread | None = None
        self._watchdog: DriveWatchdog | None = None
        self._switch: DeadMansSwitch = AlwaysHeld()
        self._queue: CommandQueue | None = None
        self._opened_at = self._cycle = 0.0
        self._next_tick = 0

    def open(self) -> None:
        """Connect; if armed, come to the standing pose; then begin to exchange."""
        hardware, params = self._hardware, self.params
        if params.armed and params.time == "real" and self.context.clock.kind == "free":
            raise BusError(
                "the graph would run faster than the robot: nothing was switched on; give it the robot's "
                "pace, --set clock.kind=robot"
            )
        bus_port = open_port(hardware.bus.port, hardware.bus.baudrate)
        try:
            board_port = open_port(hardware.board.port, 115_200)
        except BusError:
            bus_port.close()
            raise
        driver = Driver(self.robot, hardware, bus_port, board_port, self._law, params.planned_load)
        self.driver = driver
        self._opened_at = time.monotonic()
        driver.loop.clock = self.now
        driver.connect()
        if params.armed:
            self._switch = open_switch(hardware.dead_man)
            wait_until_held(self._switch, _HOLDING_TIME)
            if params.time == "real":
                devices = [motor.id for motor in hardware.motors.values()]
                descriptor = bus_port.fileno()  # type: ignore[attr-defined]  # a serial port
                silence = self.context.clock.command_limit
                self._watchdog = DriveWatchdog(
                    descriptor, devices, params.graph_timeout, silence, hardware.bus.port
                )
            self._cycle = time.monotonic()
            driver.arm(self._next_cycle)
        if params.time == "real":
            self._thread = MotorThread(driver.loop, self.oldest_command, self._stop_reason)
            self._thread.start()
        else:
            self._queue = CommandQueue(driver.loop, self.robot, params.latency, self.period)

    @property
    def oldest_command(self) -> float:
        """The age of a command at which the drives are damped [s]: also that of a silent link."""
        limit = self.context.clock.command_limit
        return min(self.params.command_age, limit) if limit else self.params.command_age

    def now(self) -> float:
        """Return the time since ``open`` [s]: of the clock, or of the exchanges."""
        if self.params.time == "virtual":
            return self._driver.loop.cycles * self._hardware.bus.period
        return time.monotonic() - self._opened_at

    def write(self) -> None:
        """Give the command to the motor thread, or to the next exchanges."""
        last_command = self.context.clock.commands_heard()
        if self._watchdog is not None:
            self._watchdog.beat(last_command)
        if self._thread is not None:
            self._thread.follow(self.command, last_command)
        elif self._queue is not None:
            self._queue.give(self.command)
        self.stop_after_fault()

    def advance(self) -> None:
        """Exchange until the next tick in virtual time; else time passes by itself."""
        if self._queue is not None:
            self._queue.advance()

    def wait(self) -> int:
        """Wait for the cycle with which the next tick begins; gives the ticks that were missed."""
        thread = self._thread
        if thread is None:
            return 0
        each = max(1, round(self.period / self._hardware.bus.period))
        self._next_tick = max(self._next_tick + each, each)
        missed = max(0, (thread.done - self._next_tick) // each)
        self._next_tick += missed * each
        if not thread.wait_for(self._next_tick, _LOST_TIME):
            self._driver.loop.fail(f"the motor thread made no cycle for {_LOST_TIME:g} s")
            self.stop_after_fault()
        return missed

    def ready_at(self) -> int:
        """Return when the cycle was done with which the tick begins, by ``time.perf_counter_ns``; zero
        in virtual time."""
        return 0 if self._thread is None else self._thread.done_at(self._next_tick)

    def damp(self) -> None:
        """Put the drives into damping for a tick; if they were never on, only watch them."""
        driver, thread = self.driver, self._thread
        if driver is None or driver.loop.link_lost:
            return
        if thread is None:
            driver.damp(self._queue.cycles if self._queue is not None else 1)
            return
        if driver.loop.phase is not DrivePhase.OFF:
            driver.loop.phase = DrivePhase.DAMPED
        thread.wait_for(thread.done + 2, _LOST_TIME)

    def close(self) -> None:
        """End the thread and the watchdog, and give the ports back."""
        if self._thread is not None:
            self._thread.stop()
        if self._watchdog is not None:
            self._watchdog.close()
        self._switch.close()
        DrivenRobot.close(self)

    def _stop_reason(self) -> str:
        """Return the reason why the motor thread must not go on; empty if it may."""
        if self._watchdog is not None and self._watchdog.asked:
            return "`aloft robot estop` has damped the drives"
        if self._watchdog is not None and self._watchdog.tripped:
            limit, silence = 1e3 * self.params.graph_timeout, 1e3 * self.context.clock.command_limit
            links = f", or no commands came over the links for {silence:g} ms" if silence else ""
            return f"the watchdog has damped the drives: the graph hung for {limit:g} ms{links}"
        return "" if self._switch.held() else "the dead man's switch was let go"

    def _next_cycle(self) -> bool:
        """While the drives are led to the standing pose: the next period has begun, and the dead
        man's switch is held."""
        if self.params.time == "virtual":
            return True
        self._cycle += self._hardware.bus.period
        rest = self._cycle - time.monotonic()
        if rest > 0.0:
            time.sleep(rest)
        else:
            self._cycle -= rest
        if self._watchdog is not None and self._watchdog.asked:
            self._driver.loop.fail(self._stop_reason())
            return False
        return self._switch.held()
