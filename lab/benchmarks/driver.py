"""The cost of the drives' driver beside a bare write and read of the same bytes on the same ports.

A second process holds the far ends of two pseudo-terminals. It answers every instruction with the
next of some recorded answers of BRUCE's ten drives, after the packet of the sensor board that
belongs to it, and computes nothing. The answers are those of the robot's twin, so they are what the
driver takes for a healthy robot. A whole cycle of the driver (goals from the command, one exchange
with all drives, the board's packet, measurements, verdict) takes turns with the exchange alone and
with a bare ``write`` and ``read`` of as many bytes.
"""

from __future__ import annotations

import json
import os
import select
import sys
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.signals import CommandMode, DrivePhase, JointCommand
from ...hal.bear.bulk import BulkExchange
from ...hal.bear.bus import open_port
from ...hal.bear.configuration import Hardware
from ...hal.bear.driver import DriveLaw, Driver
from ...hal.bear.measurement import READ
from ...hal.bear.motor_loop import WRITE
from ...hal.simulated.parameters import SensorParameters, SimulatorParameters
from ...hal.twin.twin import standing_twin
from ...hal.twin.twin_robot import VirtualBoardPort, VirtualBusPort
from ...mathematics.compiling.compile_calls import compile_calls
from ...mathematics.compiling.kernel_call import collect_calls
from ...robots.description import find_robot
from .rows import Row, compare, other_process, take_turns

GOAL = 300.0
"""Largest processor time of a good driver's cycle [us]: at 1 kHz less than a third of a
core, and with 0.5 ms on the wire within the period."""
BARE = "bare write and read"
RECORDED = 64
"""Number of recorded answers; they come again and again."""
NOISE = 0.02
"""Noise of the gyroscope [rad/s]: an IMU whose numbers never change counts as frozen."""


@dataclass
class Talk:
    """Bytes that a driver sends and receives in its cycles in the phase DRIVING."""

    request: bytes
    """The instruction of the last cycle."""
    answers: list[bytes]
    packets: list[bytes]


class _RecordingBus(VirtualBusPort):
    """The bus of a twin, which keeps its traffic."""

    request = answer = b""

    def write(self, data: bytes | bytearray) -> int:
        written = super().write(data)
        self.request, self.answer = bytes(data), bytes(self._received)
        return written


class _RecordingBoard(VirtualBoardPort):
    """The port of a twin's board, which keeps the last packet."""

    packet = b""

    def read(self, size: int = 1) -> bytes:
        part = super().read(size)
        self.packet = part or self.packet
        return part


def recorded() -> tuple[Driver, Talk]:
    """Return a driver of BRUCE whose drives are on and follow a command, and its recorded talk."""
    robot = find_robot("bruce")
    hardware = Hardware.for_twin(robot)
    twin = standing_twin(
        robot, SimulatorParameters(sensors=SensorParameters(gyro_noise=NOISE)), hardware
    )
    bus, board = _RecordingBus(twin), _RecordingBoard(twin)
    stiffness = np.full(len(robot.joints), 3.5)
    with collect_calls() as calls:
        law = DriveLaw(robot, stiffness, 0.1 * stiffness, hardware.bus.lead)
    compile_calls(calls)  # as a graph does
    driver = Driver(robot, hardware, bus, board, law)
    driver.connect()
    driver.arm(lambda: True)
    command = JointCommand.allocate(robot.dimensions)
    command.mode[()] = CommandMode.ACTIVE
    command.position[:] = robot.standing_position
    command.stiffness.fill(100.0)
    command.damping.fill(2.0)
    command.torque.fill(0.01)
    driver.loop.follow(command)
    talk = Talk(b"", [], [])
    for _ in range(RECORDED):
        driver.loop.cycle()
        talk.answers.append(bus.answer)
        talk.packets.append(board.packet)
    talk.request = bus.request
    return driver, talk


@contextmanager
def far_end(talk: Talk) -> Iterator[tuple[str, str]]:
    """Start another process that answers as recorded; yield the paths of the bus's and the board's
    ports."""
    with other_process("from aloft.lab.benchmarks.driver import answer; answer()") as other:
        said = {"size": len(talk.request), "answers": [each.hex() for each in talk.answers],
                "packets": [each.hex() for each in talk.packets]}  # fmt: skip
        bus, board = other.ask(json.dumps(said))
        yield bus, board


def answer() -> None:
    """Answer until the standard input ends, in the other process."""
    said = json.loads(sys.stdin.readline())
    answers = [bytes.fromhex(each) for each in said["answers"]]
    packets = [bytes.fromhex(each) for each in said["packets"]]
    (bus, bus_end), (board, board_end) = os.openpty(), os.openpty()
    for descriptor in (bus, bus_end, board, board_end):
        tty.setraw(descriptor)
    print(json.dumps([os.ttyname(bus_end), os.ttyname(board_end)]), flush=True)
    received = turn = 0
    while True:
        ready, _, _ = select.select([bus, sys.stdin], [], [])
        if bus not in ready:
            return
        received += len(os.read(bus, 4096))
        while received >= said["size"]:
            received -= said["size"]
            os.write(board, packets[turn % len(packets)])
            os.write(bus, answers[turn % len(answers)])
            turn += 1


def driver(rounds: int = 60, repetitions: int = 50) -> list[Row]:
    """Time a cycle of the driver, and its exchange alone, beside a bare write and read; and the
    processor time of a cycle."""
    made, talk = recorded()
    loop = made.loop
    with far_end(talk) as (bus_path, board_path):
        bus, board = open_port(bus_path), open_port(board_path)
        board.timeout = 0.0
        made.bus.port, made.board.port, made.bus.now = bus, board, time.monotonic
        made.bus.reply_time = 5.0  # a busy machine is no fault of the drives
        devices = [motor.id for motor in made.hardware.motors.values()]
        alone = BulkExchange(made.bus, devices, READ, WRITE)
        bare = _bare(bus.fileno(), board.fileno(), talk)  # type: ignore[attr-defined]  # both are serial ports
        spent = {"cycle": [0.0, 0.0], "bare": [0.0, 0.0]}

        def cycles(count: int) -> None:
            began = time.thread_time()
            for _ in range(count):
                loop.cycle()
            spent["cycle"][0] += time.thread_time() - began
            spent["cycle"][1] += count

        def exchanges(count: int) -> None:
            for _ in range(count):
                alone.exchange()
                board.read(4096)

        def bares(count: int) -> None:
            began = time.thread_time()
            for _ in range(count):
                bare()
            spent["bare"][0] += time.thread_time() - began
            spent["bare"][1] += count

        cases = {
            "driver's cycle for ten motors": cycles,
            "its exchange alone": exchanges,
            BARE: bares,
        }
        times = take_turns(cases, rounds, repetitions)
        made.close()
    if loop.fault or loop.phase is not DrivePhase.DRIVING:
        raise RuntimeError(f"the driver did not drive: {loop.fault or loop.phase.name}")
    size = f"{len(talk.request)} B there, {len(talk.answers[0])} and {len(talk.packets[0])} B back"
    rows = [replace(compare(name, times, BARE, note=size), unit="us") for name in list(cases)[:2]]
    cost, bare_cost = (1e6 * total / count for total, count in spent.values())
    return [*rows, Row("processor time of a cycle", cost, "us", goal=GOAL,
                       note=f"of which a bare write and read takes {bare_cost:.0f}")]  # fmt: skip


def _bare(bus: int, board: int, talk: Talk) -> Callable[[], None]:
    """Return a call that writes an instruction, reads the answers and the packet, and does nothing
    else."""
    request, size, packet = talk.request, len(talk.answers[0]), len(talk.packets[0])

    def exchange() -> None:
        os.write(bus, request)
        left = size
        while left:
            select.select([bus], [], [])
            left -= len(os.read(bus, left))
        left = packet
        while left:
            select.select([board], [], [])
            left -= len(os.read(board, left))

    return exchange
