"""The common ground of a bring-up's steps: the devices, the person who helps, discrepancies and the record."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import yaml

from ....hal.bear.bus import BearBus, BusError
from ....hal.bear.configuration import Hardware
from ....hal.bear.sense_board import SenseBoard
from ....mathematics.arrays import Array
from ....robots.robot_description import RobotDescription

PACKET_TIME = 0.001
"""Time between two packets of the sensor board [s]."""


@dataclass(frozen=True)
class Request:
    """An instruction to a person, until it is done.

    Attributes:
        act: ``measure``, ``move`` a joint, ``stops`` of a joint, take a ``pose``, ``place`` or
            ``turn`` the robot, ``press`` a switch, ``hang`` the robot up with its feet in the air, be
            ``ready`` to lower it, and to watch what it does next.
        target: of what: a length, a joint, a side, an axis, a contact point, a motion.
        text: the instruction in words.
    """

    act: Literal["measure", "move", "stops", "pose", "place", "turn", "press", "hang", "ready"]
    target: str
    text: str


class Operator(Protocol):
    """The person beside the robot, or a test in its place."""

    def do(self, request: Request, observe: Callable[[], None]) -> None:
        """Do it, and call ``observe`` all the while, the last time when it is done."""

    def measure(self, request: Request) -> float:
        """Measure something with a rule or a scale; the number in the unit of the text."""


@dataclass(frozen=True)
class Discrepancy:
    """Something that is not as it should be.

    Attributes:
        place: the key of the hardware's file, or the part.
        expected, found, fix: what should be, what is, and what to do.
        mended: whether the step wrote the right value into the file.
    """

    place: str
    expected: str
    found: str
    fix: str
    mended: bool = False

    def __str__(self) -> str:
        return f"{self.place}: expected {self.expected}, found {self.found}; {self.fix}"


@dataclass
class StepReport:
    """The findings of a step."""

    values: dict[str, Any] = field(default_factory=dict)
    discrepancies: list[Discrepancy] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """True if the next step may follow."""
        return all(discrepancy.mended for discrepancy in self.discrepancies)

    def add(self, place: str, expected: str, found: str, fix: str, mended: bool = False) -> None:
        """Note a discrepancy."""
        self.discrepancies.append(Discrepancy(place, expected, found, fix, mended))


class LetGoError(BusError):
    """Somebody let go of the dead man's switch."""


def go_on(next_cycle: Callable[[], bool]) -> None:
    """Wait for the next cycle.

    Raises:
        LetGoError: the dead man's switch is not held.
    """
    if not next_cycle():
        raise LetGoError("the dead man's switch was let go")


class Devices(NamedTuple):
    """The open bus of the drives and the open sensor board."""

    bus: BearBus
    board: SenseBoard


class BringUpRun(Protocol):
    """The outcome of a graph's run."""

    @property
    def success(self) -> bool:
        """True if the run went as its graph intends."""

    @property
    def reason(self) -> str:
        """The reason of its end or of its failure."""

    @property
    def metrics(self) -> Mapping[str, Any]:
        """The metrics of the blocks."""


class GraphRunner(Protocol):
    """Runs a graph with the robot of a session, as `aloft run` does, with its ports closed here."""

    def __call__(self, graph: str, settings: Mapping[str, Any]) -> BringUpRun:
        """Run the ``graph``, by its name, with these parameters besides the hardware's file."""


class Session:
    """A robot on the bench: its file, its devices, and the person beside it.

    Args:
        file: of the hardware.
        robot: the description.
        connect: opens the devices; their ports are closed again while a graph runs.
        operator: the person.
        hold: gives a function that waits for the next cycle of the bus and returns whether to go on.
        run_graph: runs a graph on this robot.

    Nothing that it offers switches a drive on by itself.
    """

    def __init__(
        self, file: Path, robot: RobotDescription, connect: Callable[[Hardware], Devices],
        operator: Operator, hold: Callable[[Hardware], AbstractContextManager[Callable[[], bool]]],
        run_graph: GraphRunner,
    ) -> None:  # fmt: skip
        self.file, self.robot, self.operator = file, robot, operator
        self._connect, self._hold, self._run_graph = connect, hold, run_graph
        self._devices: Devices | None = None
        self.hardware = Hardware.read(file, robot)

    @property
    def bus(self) -> BearBus:
        """The bus of the drives."""
        return self._opened().bus

    @property
    def board(self) -> SenseBoard:
        """The sensor board."""
        return self._opened().board

    def _opened(self) -> Devices:
        if self._devices is None:
            self._devices = self._connect(self.hardware)
        return self._devices

    def close(self) -> None:
        """Close the ports; they are opened again when they are needed."""
        if self._devices is not None:
            devices, self._devices = self._devices, None
            devices.bus.close()
            devices.board.port.close()

    def hold(self) -> AbstractContextManager[Callable[[], bool]]:
        """Wait until the dead man's switch is held; gives what waits for the next cycle."""
        return self._hold(self.hardware)

    def run_graph(self, graph: str, settings: Mapping[str, Any]) -> BringUpRun:
        """Run a graph on this robot."""
        self.close()
        return self._run_graph(graph, settings)

    @property
    def friction_file(self) -> Path:
        """The graph fragment with the joints' friction beyond the description's."""
        return self.file.with_suffix(".friction.yaml")

    @property
    def motors(self) -> tuple[str, ...]:
        """The robot's motors, in the order of the description."""
        return self.robot.transmission.motors

    def raw_positions(self) -> Array:
        """Read every drive's encoder [rad], (n_motors,)."""
        ids = [self.hardware.motors[name].id for name in self.motors]
        return np.array([self.bus.read(k, "present_position")["present_position"] for k in ids])

    def joint_positions(self) -> Array:
        """Return the joints' angles by the file's signs and offsets [rad], (n_joints,)."""
        settings = [self.hardware.motors[name] for name in self.motors]
        sign = np.array([float(motor.sign) for motor in settings])
        zero = np.array([motor.zero for motor in settings])
        return np.linalg.solve(
            self.robot.joint_to_motor, sign * self.raw_positions() - zero
        )  # fmt: skip

    def do(self, request: Request, observe: Callable[[], None] = lambda: None) -> None:
        """Have the operator do something."""
        self.operator.do(request, observe)

    def write(
        self, changes: dict[str, dict[str, Any]], board: dict[str, Any] | None = None
    ) -> None:
        """Change keys of motors and of the board in the file, and read it again.

        The file as it was stays beside it, with the ending ``.before``; comments are lost.
        """
        text = self.file.read_text(encoding="utf-8")
        data = yaml.safe_load(text)
        for name, keys in changes.items():
            data["motors"][name] |= keys
        data["board"] |= board or {}
        before = self.file.with_name(self.file.name + ".before")
        if not before.exists():
            _write(before, text)
        _write(self.file, yaml.safe_dump(data, sort_keys=False))
        self.hardware = Hardware.read(self.file, self.robot)


class BringUpRecord:
    """The record of all steps, beside the hardware's file: ``NAME.bring_up.json``."""

    def __init__(self, hardware: Path) -> None:
        self.path = hardware.with_suffix(".bring_up.json")
        self.entries: list[dict[str, Any]] = []
        if self.path.exists():
            self.entries = json.loads(self.path.read_text(encoding="utf-8"))["steps"]

    def add(self, step: str, report: StepReport) -> dict[str, Any]:
        """Note a step's report, and write the file."""
        entry = {
            "step": step,
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "passed": report.passed,
            "values": report.values,
            "discrepancies": [asdict(discrepancy) for discrepancy in report.discrepancies],
        }
        self.entries.append(entry)
        _write(self.path, json.dumps({"steps": self.entries}, indent=2) + "\n")
        return entry

    def passed(self, step: str) -> bool:
        """Check that this step passed the last time."""
        last = [entry for entry in self.entries if entry["step"] == step]
        return bool(last) and bool(last[-1]["passed"])


def _write(path: Path, text: str) -> None:
    """Write a whole file or nothing."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)
