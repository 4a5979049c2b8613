"""``aloft robot bring-up``: the guided steps, with the person at the terminal."""

from __future__ import annotations

import select
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import AsJson
from ....cli.shared.output import errors_reported, print_json
from ....runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ..bring_up.session import Request, Session
    from ..bring_up.steps import BringUpStep

PATIENCE = 300.0
"""Longest time that a step waits for the person [s]."""
_PAUSE = 0.005


def bring_up(
    file: Annotated[Path, typer.Argument(help="The hardware file; steps write into it.")],
    first: Annotated[
        str | None,
        typer.Option(
            "--first", help="The first step; by default the one after the last that passed."
        ),
    ] = None,
    last: Annotated[
        str | None, typer.Option("--last", help="The last step; by default all.")
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Ask no questions; only where both ports are `twin`.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Walk through all steps from the first look to a hop of 12 cm; power comes with the step `current`."""
    from ..bring_up.session import BringUpRecord
    from ..bring_up.walk import UnknownStepError, walk

    with errors_reported(as_json), _session(file, yes) as session:
        record = BringUpRecord(file)
        entries: list[dict[str, Any]] = []
        try:
            for entry in walk(session, record, first, last, _announce):
                entries.append(entry)
                _tell(entry)
        except UnknownStepError as error:
            raise AloftError(str(error.args[0])) from error
        passed = all(entry["passed"] for entry in entries)
        if as_json:
            print_json({"success": passed, "record": str(record.path), "steps": entries})
            if not passed:
                raise typer.Exit(1)
        elif not passed:
            raise AloftError(f"step {entries[-1]['step']} did not pass; mend it, and go on from it")
        else:
            what = "all steps passed" if last is None else f"all steps up to {last} passed"
            _say(f"{what}: go on with extensions/commissioning/bring_up.md")


def _say(text: str) -> None:
    """Print for the person, on standard error; standard output belongs to ``--json``."""
    typer.echo(text, err=True)


def _announce(step: BringUpStep) -> None:
    _say(f"\n{step.name}: what could be wrong: {step.risk}")


def _tell(entry: dict[str, Any]) -> None:
    _say(f"{entry['step']}: {'passed' if entry['passed'] else 'NOT PASSED'}")
    for each in entry["discrepancies"]:
        _say(
            f"  {each['place']}: expected {each['expected']}, found {each['found']}; {each['fix']}"
        )


class TerminalOperator:
    """The person at the terminal, who confirms with the return key."""

    def do(self, request: Request, observe: Callable[[], None]) -> None:
        """Show what to do, and observe until it is confirmed.

        Raises:
            AloftError: nobody confirms in time, something else is typed, or standard input ended.
        """
        if sys.stdin.isatty():  # what was typed before the text was read confirms nothing
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
        _say(f"  {request.text}; then press return, or type stop")
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            observe()
            if select.select([sys.stdin], [], [], _PAUSE)[0]:
                line = sys.stdin.readline()
                if not line:
                    raise AloftError("standard input ended before the step was done")
                if line.strip():
                    raise AloftError(
                        f"{line.strip()!r} instead of return: stopped; call it again to go on"
                    )
                observe()
                return
        raise AloftError(f"nobody confirmed within {PATIENCE:g} s")

    def measure(self, request: Request) -> float:
        """Ask for a number until one is typed.

        Raises:
            AloftError: standard input ended.
        """
        while True:
            _say(f"  {request.text}:")
            line = sys.stdin.readline()
            if not line:
                raise AloftError("standard input ended before the step was done")
            try:
                return float(line)
            except ValueError:
                _say(f"  {line.strip()!r} is no number")


@contextmanager
def _session(file: Path, yes: bool) -> Iterator[Session]:
    from ....hal.bear.configuration import Hardware
    from ....robots.description import find_robot
    from .bring_up_session import TWIN, port_session, twin_session

    try:
        robot = find_robot(Hardware.read(file).robot)
    except LookupError as error:
        raise AloftError(str(error.args[0])) from error
    hardware = Hardware.read(file, robot)
    on_twin = hardware.bus.port == hardware.board.port == TWIN
    if yes != on_twin:
        raise AloftError(
            "--yes asks nobody, and is for a file whose two ports are `twin`"
            if yes
            else "both ports are `twin`, on which nobody can be asked: give --yes"
        )
    if on_twin:
        from ....hal.twin.wiring import Wiring
        from ..bring_up.by_hand import HandErrors, RobotByHand

        wiring = Wiring.of(robot)
        wiring.addresses = {name: motor.id for name, motor in hardware.motors.items()}
        session = twin_session(file, robot, RobotByHand(robot, wiring, errors=HandErrors()))
    else:
        session = port_session(file, robot, TerminalOperator())
    try:
        yield session
    finally:
        session.close()
