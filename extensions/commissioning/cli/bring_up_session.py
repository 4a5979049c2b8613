"""The session of ``aloft robot bring-up``: on serial ports, or on a twin that is moved by hand."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ....hal.bear.configuration import Hardware
    from ....robots.robot_description import RobotDescription
    from ....runtime.running.run_result import RunResult
    from ..bring_up.by_hand import RobotByHand
    from ..bring_up.session import Devices, Operator, Session

TWIN = "twin"
"""The name of both ports of a robot that exists as a twin only."""
HOLDING_TIME = 30.0
"""Time that a person has to take the dead man's switch [s]."""


def twin_session(file: Path, robot: RobotDescription, hand: RobotByHand) -> Session:
    """Open a session with a twin, without questions; time goes on with the exchanges."""
    from ....hal.bear.bus import BearBus
    from ....hal.bear.sense_board import SenseBoard
    from ..bring_up.session import Devices, Session

    def connect(hardware: Hardware) -> Devices:
        return Devices(BearBus(hand.bus_port, reply_time=0.001), SenseBoard(hand.board_port))

    def run(graph: str, settings: Mapping[str, Any]) -> RunResult:
        from ....hal.bear.configuration import Hardware
        from ....hal.twin.server import TwinServer

        twin, hardware = hand.twin, Hardware.read(file, robot)
        assert twin is not None, "the robot was not hung up"
        with (
            TwinServer(twin, virtual=True, period=hardware.bus.period) as server,
            tempfile.TemporaryDirectory() as folder,
        ):
            served = Path(folder) / file.name
            text = hardware.at_ports(server.bus_path, server.board_path, virtual=True)
            served.write_text(text, encoding="utf-8")
            return run_on_robot(served, graph, settings, _recording(file, graph), virtual=True)

    return Session(file, robot, connect, hand, held_pace, run)


def port_session(file: Path, robot: RobotDescription, operator: Operator) -> Session:
    """Open a session with the devices at the serial ports of the file."""
    from ....hal.bear.bus import BearBus, open_port
    from ....hal.bear.configuration import Hardware
    from ....hal.bear.sense_board import BoardMode, SenseBoard
    from ..bring_up.session import Devices, Session

    def connect(hardware: Hardware) -> Devices:
        drives = open_port(hardware.bus.port, hardware.bus.baudrate)
        try:
            port = open_port(hardware.board.port, 115_200)
        except BaseException:
            drives.close()
            raise
        board = SenseBoard(port, hardware.board.mounted(robot))
        board.send(BoardMode.NOMINAL)
        return Devices(BearBus(drives, reply_time=hardware.bus.reply_time), board)

    def run(graph: str, settings: Mapping[str, Any]) -> RunResult:
        virtual = Hardware.read(file, robot).bus.is_virtual
        return run_on_robot(file, graph, settings, _recording(file, graph), virtual=virtual)

    return Session(file, robot, connect, operator, held_pace, run)


def run_on_robot(
    file: Path, graph: str, settings: Mapping[str, Any], recording: Path, *, virtual: bool
) -> RunResult:
    """Run a shipped graph, armed, on the robot of this file of the hardware, and record it.

    In real time the robot says when a tick begins.

    Raises:
        AloftError: the graph and the file do not fit.
    """
    from ....logs.recording.recorder import Recorder
    from ....runtime.graph import load
    from ....runtime.language.stages import ClockSpec

    on_robot = {
        "robot.hardware": str(file.resolve()),
        "robot.armed": True,
        "robot.time": "virtual" if virtual else "real",
    }
    loaded = load(graph, {**on_robot, **settings})
    clock = ClockSpec("free" if virtual else "robot")
    return loaded.run(clock=clock, sinks=[Recorder(recording, keep=20)], log=False)


def _recording(file: Path, graph: str) -> Path:
    """Return the path of the recordings of a graph: beside the file of the hardware."""
    return file.with_name(f"{file.stem}.{Path(graph).stem}.rrd")


@contextmanager
def held_pace(hardware: Hardware) -> Iterator[Callable[[], bool]]:
    """Wait for the next cycle of the bus, and tell whether the dead man's switch is held.

    A twin in virtual time takes the next cycle at once, and nothing must be held.
    """
    from ....hal.bear.watchdog import open_switch, wait_until_held

    if hardware.bus.port == TWIN or hardware.bus.is_virtual:
        yield lambda: True
        return
    switch = open_switch(hardware.dead_man)
    try:
        wait_until_held(switch, HOLDING_TIME)
        following = time.monotonic()

        def next_cycle() -> bool:
            nonlocal following
            following += hardware.bus.period
            rest = following - time.monotonic()
            if rest > 0.0:
                time.sleep(rest)
            else:
                following -= rest
            return switch.held()

        yield next_cycle
    finally:
        switch.close()
