"""A real robot's drives and sensor board, from finding them to letting go, without a graph.

``BearRobot`` puts a graph's ports around it. Time is given by whoever calls ``cycle``: a thread at
the rate of the bus, or the graph itself where the robot is a twin in virtual time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...blocks.signals import DrivePhase
from ...robots.robot_description import RobotDescription
from ...robots.transmission import Transmission
from . import arming
from .bus import BearBus, SerialPort
from .configuration import Hardware
from .drive_law import DriveLaw
from .motor_loop import MotorLoop
from .sense_board import BoardMode, SenseBoard

STOP_CYCLES = 5
"""How often damping is commanded at least, since an instruction may be lost."""
_BOARD_CYCLES = 1000
"""The exchanges within which the sensor board must have sent something."""


class Driver:
    """The drives and the sensor board of one robot.

    Args:
        robot: the description.
        hardware: how they are connected and what they may do.
        bus_port, board_port: open serial ports.
        law: the drives' gains, and how commands become their goals.
    """

    def __init__(
        self, robot: RobotDescription, hardware: Hardware, bus_port: SerialPort,
        board_port: SerialPort, law: DriveLaw,
    ) -> None:  # fmt: skip
        names = self._names = robot.transmission.motors
        self.hardware = hardware
        self.bus = BearBus(bus_port, reply_time=hardware.bus.reply_time)
        self.board = SenseBoard(board_port)
        self._gains = (
            dict(zip(names, law.motor_stiffness.tolist(), strict=True)),
            dict(zip(names, law.motor_damping.tolist(), strict=True)),
        )
        self.loop = MotorLoop(robot, hardware, self.bus, self.board, law.goals, law.motor_stiffness)
        self._standing = np.zeros(len(names))
        Transmission(robot).motor_motion(robot.standing_position, self._standing)

    def connect(self) -> None:
        """Find all drives and the board, and measure once. Nothing is switched on.

        Raises:
            BusError: something does not answer, or somebody else sends on the bus.
        """
        arming.find_drives(self.bus, self.hardware)
        self.board.send(BoardMode.NOMINAL)
        for _ in range(_BOARD_CYCLES):
            self.loop.cycle()
            if self.board.packets:
                break
        self.board.require(self.hardware.board.port)
        self.loop.cycle()

    def arm(self, next_cycle: Callable[[], bool]) -> None:
        """Clear errors, configure, enable, and go to the standing pose; then the drives hold it.

        Args:
            next_cycle: waits for the next cycle, and says whether to go on.

        Raises:
            BusError: the text says which drive does not do what; nothing is left switched on.
        """
        try:
            # From here on a drive may be on, so whatever goes wrong ends in damping.
            arming.clear_errors(self.bus, self.hardware)
            arming.configure(self.bus, self.hardware, *self._gains)
            self.loop.cycle()
            arming.check_ready(self.loop, self._standing, self._names)
            arming.enable(self.loop, self._names)
            arming.soft_start(self.loop, self._standing, next_cycle)
            self.loop.measured.forget_torques()  # those of the way to the standing pose
        except BaseException:
            self.loop.phase = DrivePhase.DAMPED
            self.damp(STOP_CYCLES)
            raise

    def damp(self, cycles: int = 1) -> None:
        """Put all drives into damping, whatever was before; nothing if they were never on."""
        if self.loop.phase is not DrivePhase.OFF:
            self.loop.phase = DrivePhase.DAMPED
        for _ in range(cycles):
            self.loop.cycle()

    def close(self) -> None:
        """Give the ports back, with the drives in damping if they were on."""
        for close in (self.bus.close, self.board.port.close):
            try:
                close()
            except OSError:
                continue  # a cable that was pulled
