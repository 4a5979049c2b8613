"""Cycles of the motor loop without a thread: the graph's own ticks make them, in virtual time."""

from __future__ import annotations

import math

from ...blocks.signals import JointCommand
from ...robots.robot_description import RobotDescription
from .motor_loop import MotorLoop


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
        commands: room for the commands on their way.
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
        """What changes in a run: objects, and the names of their attributes."""
        found: list[tuple[object, tuple[str, ...]]] = [(self, ("sent",))]
        return found + [(command, tuple(command.views())) for command in self.commands]
