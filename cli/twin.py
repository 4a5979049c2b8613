"""``aloft twin``: a robot's twin behind serial ports, for a driver in another process."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..runtime.language.errors import AloftError
from .shared.options import AsJson
from .shared.output import console, errors_reported, print_json, say


def twin(
    robot: Annotated[str, typer.Argument(help="The robot.")] = "bruce",
    hardware: Annotated[
        Path | None, typer.Option(help="Its hardware file; the ports are the twin's own.")
    ] = None,
    write: Annotated[
        Path,
        typer.Option("--out", "-o", help="The hardware file to write, with the twin's ports."),
    ] = Path("twin.yaml"),
    virtual: Annotated[
        bool,
        typer.Option(
            "--virtual", help="Virtual time, which advances with the exchanges on the bus."
        ),
    ] = False,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="A parameter of the simulator: seed=3, gyro_noise=0.02, friction=0.5 ..."
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(help="A fault to inject: 'dead 0.5 left_knee_motor', 'lost 1 * share=0.1'."),
    ] = None,
    seconds: Annotated[float, typer.Option(help="End after this time [s]; 0: at Ctrl-C.")] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Serve the drives and the sensor board of a robot on pseudo-terminals, with physics behind.

    Run a graph with hal.BearRobot against it: the file that is written names the ports.
    """
    from ..hal.bear.configuration import Hardware
    from ..hal.simulated.parameters import SimulatorParameters
    from ..hal.twin.injected_faults import read_fault
    from ..hal.twin.server import TwinServer
    from ..hal.twin.twin import standing_twin
    from ..robots.description import RobotError, find_robot

    with errors_reported(as_json):
        try:
            description = find_robot(robot)
        except (LookupError, RobotError) as error:
            raise AloftError(str(error.args[0])) from error
        settings = _settings(set_ or [])
        params = SimulatorParameters.model_validate(settings)
        faults = tuple(read_fault(text) for text in fault or [])
        found = (
            Hardware.read(hardware, description)
            if hardware is not None
            else Hardware.for_twin(description)
        )
        made = standing_twin(description, params, found, faults=faults)
        with TwinServer(made, virtual=virtual, period=found.bus.period) as server:
            text = found.at_ports(server.bus_path, server.board_path, virtual=virtual)
            write.write_text(text, encoding="utf-8")
            if as_json:
                print_json({"bus": server.bus_path, "board": server.board_path, "file": str(write)})
            else:
                out = console()
                say(out, f"drives on {server.bus_path}, sensor board on {server.board_path}")
                say(out, f"wrote {write}: --set robot.hardware={write.resolve()}")
            _wait(seconds)
        if not as_json and server.behind > 0.1:
            say(console(), f"the twin's time is {server.behind:.1f} s behind the clock")


def _wait(seconds: float) -> None:
    """Wait until SIGINT or SIGTERM, or the end of the time."""
    ended = False

    def end(number: int, frame: object) -> None:
        nonlocal ended
        ended = True

    before = [signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)]
    finish = time.monotonic() + seconds if seconds > 0.0 else float("inf")
    try:
        while not ended and time.monotonic() < finish:
            time.sleep(0.05)
    finally:
        for number, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
            signal.signal(number, handler)


def _settings(texts: list[str]) -> dict[str, Any]:
    """Parse ``name=value`` texts as parameters. Raises ``AloftError``."""
    import yaml

    from ..hal.simulated.parameters import SimulatorParameters
    from ..robots.validation.errors import nearest
    from ..runtime.language.parameters import declared_fields

    known = {**SimulatorParameters.model_fields, **dict(declared_fields(SimulatorParameters))}
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise AloftError(f"--set {text}: expected name=value")
        if name not in known:
            near = nearest(name, known)
            hint = f"; did you mean {near}?" if near else ""
            raise AloftError(f"--set {text}: the simulator has no parameter {name!r}{hint}")
        *groups, last = name.split(".")
        inside = found
        for group in groups:
            inside = inside.setdefault(group, {})
        inside[last] = yaml.safe_load(value)
    return found
