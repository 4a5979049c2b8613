"""``aloft robot bring-up`` with a person at the terminal and a robot at serial ports."""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import typer

from aloft.extensions.commissioning.bring_up.by_hand import HandErrors, RobotByHand
from aloft.extensions.commissioning.bring_up.session import Request
from aloft.extensions.commissioning.bring_up.steps import BringUpStep
from aloft.extensions.commissioning.cli import bring_up as verb
from aloft.hal.bear.configuration import Hardware
from aloft.hal.simulated.parameters import SimulatorParameters, StartParameters
from aloft.hal.twin.server import PseudoTerminal, TwinServer
from aloft.hal.twin.wiring import Wiring
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


class Keyboard:
    """Standard input, into which the test types."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        reading, self._writing = os.pipe()
        monkeypatch.setattr(sys, "stdin", os.fdopen(reading))

    def type(self, text: str) -> None:
        os.write(self._writing, text.encode())

    def end(self) -> None:
        os.close(self._writing)


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Keyboard:
    return Keyboard(monkeypatch)


class Person:
    """Does what the terminal asks, by hand, and types; at the step of ``last`` types something else."""

    def __init__(self, hand: RobotByHand, keyboard: Keyboard, last: str, answer: str) -> None:
        self.hand, self.keyboard, self.last, self.answer = hand, keyboard, last, answer
        self.asked: list[str] = []

    def watch(self, monkeypatch: pytest.MonkeyPatch) -> None:
        operator = verb.TerminalOperator
        do, measure = operator.do, operator.measure

        def act(shown: Any, request: Request, observe: Any) -> None:
            self.asked.append(request.act)
            if request.act == self.last:
                self.keyboard.type(self.answer)
            else:
                self.hand.do(request, lambda: None)
                self.keyboard.type("\n")
            do(shown, request, observe)

        def tell(shown: Any, request: Request) -> float:
            self.keyboard.type(f"what?\n{self.hand.measure(request):.1f}\n")
            return measure(shown, request)

        monkeypatch.setattr(operator, "do", act)
        monkeypatch.setattr(operator, "measure", tell)


@contextmanager
def at_serial_ports(hand: RobotByHand, folder: Path) -> Iterator[Path]:
    """The robot by hand behind two pseudo-terminals; gives the hardware's file."""

    def answer(data: bytes) -> bytes:
        hand.bus_port.write(data)
        return hand.bus_port.read(4096)

    with PseudoTerminal(answer) as bus, PseudoTerminal(lambda data: b"") as board:
        ended = threading.Event()

        def stream() -> None:
            while not ended.wait(0.001):
                board.send(hand.board_port.read(64))

        thread = threading.Thread(target=stream, daemon=True)
        thread.start()
        hardware = Hardware.for_twin(ROBOT)
        patient = hardware.bus.model_copy(update={"reply_time": 2.0})
        hardware = hardware.model_copy(update={"bus": patient})
        file = folder / "bench.yaml"
        file.write_text(hardware.at_ports(bus.path, board.path, virtual=False))
        try:
            yield file
        finally:
            ended.set()
            thread.join()


def answer(keyboard: Keyboard, monkeypatch: pytest.MonkeyPatch, answers: dict[str, str]) -> None:
    """Type these answers when the steps of these names begin."""
    announce = verb._announce

    def then_type(step: BringUpStep) -> None:
        announce(step)
        keyboard.type(answers[step.name])

    monkeypatch.setattr(verb, "_announce", then_type)
    monkeypatch.setattr(verb, "PATIENCE", 20.0)


def walk(file: Path, first: str | None = None) -> int:
    """Run the verb; gives its exit code."""
    try:
        verb.bring_up(file, first, None, False, False)
    except typer.Exit as left:
        return left.exit_code
    return 0


def passed(file: Path) -> list[str]:
    entries = json.loads(file.with_suffix(".bring_up.json").read_text())["steps"]
    return [entry["step"] for entry in entries if entry["passed"]]


def test_a_person_walks_stops_and_goes_on(
    tmp_path: Path, keyboard: Keyboard, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    # one address without a drive is waited for, and so long that a busy machine's drives answer in time
    monkeypatch.setattr("aloft.extensions.commissioning.bring_up.steps.LAST_ADDRESS", 10)
    wiring = Wiring.of(ROBOT)
    wiring.signs = {"left_knee_motor": -1}
    hand = RobotByHand(ROBOT, wiring, 3, HandErrors())
    with at_serial_ports(hand, tmp_path) as file:
        person = Person(hand, keyboard, "stops", "stop\n")
        with monkeypatch.context() as patched:
            person.watch(patched)
            assert walk(file) == 2
        told = capsys.readouterr().err
        assert "robot: what could be wrong: another variant" in told
        assert "'what?' is no number" in told and "weigh the robot [kg]:" in told
        assert "move right_hip_yaw alone by about 20 deg" in told
        assert "motors.left_knee_motor.sign: expected +1, found -1; written" in told
        assert "'stop' instead of return: stopped; call it again to go on" in told
        assert passed(file) == ["robot", "drives", "directions", "zero"]
        assert Hardware.read(file, ROBOT).motors["left_knee_motor"].sign == -1

        monkeypatch.setattr(verb, "PATIENCE", 0.05)
        assert walk(file) == 2
        told = capsys.readouterr().err
        assert "limits: what could be wrong" in told and "nobody confirmed within 0.05 s" in told
        keyboard.end()
        assert walk(file) == 2
        assert "standard input ended before the step was done" in capsys.readouterr().err
        assert passed(file) == ["robot", "drives", "directions", "zero"]


@contextmanager
def served(folder: Path, *, held: bool, gantry: dict[str, Any]) -> Iterator[Path]:
    """A twin under power as `aloft twin --virtual --out` serves it; gives the file that it writes."""
    params = SimulatorParameters(seed=2, start=StartParameters(gantry=gantry))
    twin = Wiring.of(ROBOT).twin(ROBOT, params, held=held)
    with TwinServer(twin, virtual=True, period=0.001) as server:
        file = folder / "twin.yaml"
        hardware = Hardware.for_twin(ROBOT)
        file.write_text(hardware.at_ports(server.bus_path, server.board_path, virtual=True))
        yield file


@pytest.mark.long
def test_currents_are_checked_at_serial_ports(
    tmp_path: Path,
    keyboard: Keyboard,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with served(tmp_path, held=False, gantry={"height": 0.1, "lower_after": None}) as file:
        answer(keyboard, monkeypatch, {"current": "\n", "watchdog": "stop\n"})
        assert walk(file, "current") == 2
        told = capsys.readouterr().err
        assert "hang the robot in the gantry" in told and "'stop' instead of return" in told
        assert passed(file) == ["current"]


@pytest.mark.long
def test_it_stands_and_sits_at_serial_ports(
    tmp_path: Path,
    keyboard: Keyboard,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with served(tmp_path, held=True, gantry={"height": 0.04, "lower_after": 0.5}) as file:
        answer(keyboard, monkeypatch, {"stand": "\n", "sit": "stop\n"})
        assert walk(file, "stand") == 2
        assert "next the robot will stand, then sit down" in capsys.readouterr().err
        assert passed(file) == ["stand"]
