"""The verbs of ``aloft robot`` for a robot on a bench: look, find the zero pose, move one motor, stop."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import AsJson
from ....cli.shared.output import console, errors_reported, print_json, say, table
from ....runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ....hal.bear.bus import BearBus
    from ....hal.bear.configuration import Hardware
    from ....robots.robot_description import RobotDescription


HardwareFile = Annotated[Path, typer.Argument(help="The hardware file.")]

_STATES = {0: "off", 1: "on", 2: "off after an error", 3: "damping"}


def scan(
    file: HardwareFile,
    last: Annotated[int, typer.Option(help="The last address to ping.", min=0, max=252)] = 32,
    as_json: AsJson = False,
) -> None:
    """List the drives that answer a ping. Nothing else is sent."""
    from .. import bench

    with errors_reported(as_json), _bus(file) as (bus, hardware, _):
        found = bench.scan(bus, hardware, range(last + 1))
    missing = [name for name, m in hardware.motors.items() if m.id not in {f.device for f in found}]
    if as_json:
        print_json({"drives": [vars(each) for each in found], "missing": missing})
        return
    rows = [(str(f.device), f.motor or "-", f.version, f.problem or "healthy") for f in found]
    console().print(table("", (">address", "motor", "version", "condition"), rows))
    if missing:
        say(console(), f"no answer from {', '.join(missing)}")


def status(file: HardwareFile, as_json: AsJson = False) -> None:
    """Read every drive's state, voltage, temperature and errors. Nothing is written."""
    from .. import bench

    with errors_reported(as_json), _bus(file) as (bus, hardware, _):
        rows = bench.status(bus, hardware)
    if as_json:
        print_json({"drives": rows})
        return
    shown = [
        (row["motor"], str(row["id"]), "-", "-", "-", "-", row["error"])
        if "error" in row
        else (
            row["motor"], str(row["id"]), _STATES.get(int(row["torque_enable"]), "unknown"),
            f"{row['present_position']:.4f}", f"{row['input_voltage']:.1f}",
            f"{row['winding_temperature']:.0f}", row["trouble"] or "healthy",
        )
        for row in rows
    ]  # fmt: skip
    columns = ("motor", ">address", "state", ">rad", ">V", ">deg C", "condition")
    console().print(table("", columns, shown))


def watch(
    file: HardwareFile,
    seconds: Annotated[float, typer.Option(help="For how long.", min=0.0)] = 10.0,
    every: Annotated[float, typer.Option(help="Seconds between two lines.", min=0.02)] = 0.5,
    as_json: AsJson = False,
) -> None:
    """Print the joints' angles while you move them by hand. Nothing is written to the drives."""
    import numpy as np

    from ....hal.bear.bulk import BulkExchange
    from ....hal.bear.measurement import READ, Measurement

    with errors_reported(as_json), _bus(file) as (bus, hardware, robot):
        names = robot.transmission.motors
        bulk = BulkExchange(bus, [hardware.motors[name].id for name in names], READ, ())
        measured = Measurement(robot, hardware)
        end = time.monotonic() + seconds
        joints = [joint.name for joint in robot.joints]
        first = True
        while first or time.monotonic() < end:
            answered = bulk.exchange()
            measured.take_drives(bulk)
            angles = [round(angle, 4) for angle in measured.joint_position.tolist()]
            if as_json:
                print_json({"answered": answered, "joints": dict(zip(joints, angles, strict=True))})
            else:
                if first:
                    say(console(), "  ".join(joints) + "   [rad]")
                silent = "" if answered == len(names) else f"   {len(names) - answered} silent"
                say(console(), " ".join(f"{angle:8.3f}" for angle in angles) + silent)
            first = False
            time.sleep(min(every, max(0.0, end - time.monotonic())))
        assert np.isfinite(measured.joint_position).all()


def zero(
    file: HardwareFile,
    standing: Annotated[
        bool,
        typer.Option("--standing", help="The robot is in its standing pose, not the zero pose."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Print the offsets that make the present pose the zero pose. Nothing is written."""
    import numpy as np

    from .. import bench

    with errors_reported(as_json), _bus(file) as (bus, hardware, robot):
        pose = robot.standing_position if standing else np.zeros(len(robot.joints))
        offsets = bench.calibrate(bus, hardware, robot, pose)
    if as_json:
        print_json({"offsets": offsets})
        return
    say(console(), "motors:  # put these offsets into the file")
    for name, offset in offsets.items():
        motor = hardware.motors[name]
        say(console(), f"  {name}: {{id: {motor.id}, sign: {motor.sign}, offset: {offset:.5f}}}")


def jog(
    file: HardwareFile,
    motor: Annotated[str, typer.Argument(help="The motor, by its name in the file.")],
    angle: Annotated[float, typer.Argument(help="How far, in rad; at most 0.5.")],
    seconds: Annotated[
        float, typer.Option(help="Duration of the move there and back [s].", min=0.5, max=60.0)
    ] = 3.0,
    arm: Annotated[bool, typer.Option("--arm", help="Really switch the drive on.")] = False,
    as_json: AsJson = False,
) -> None:
    """Move one motor there and back with little current. Without --arm nothing moves."""
    from .. import bench
    from .bring_up_session import held_pace

    with errors_reported(as_json):
        if not arm:
            raise AloftError(
                f"{motor} was not moved: jog switches a drive on only with --arm; read "
                "extensions/commissioning/bring_up.md first"
            )
        with _bus(file) as (bus, hardware, _), held_pace(hardware) as next_cycle:
            track = list(bench.jog(bus, hardware, motor, angle, seconds, next_cycle))
    start = track[0][1]
    farthest = max((reached - start for _, reached in track), key=abs)
    if as_json:
        print_json({"motor": motor, "asked_rad": angle, "reached_rad": farthest})
    else:
        say(console(), f"{motor} moved by {farthest:.3f} of {angle:g} rad, and is in damping")


def estop(file: HardwareFile, as_json: AsJson = False) -> None:
    """Put all drives into damping: by the run that holds the port, or else here, and read back."""
    from ....hal.bear.configuration import Hardware
    from ....hal.bear.watchdog import ask_to_stop
    from .. import bench

    with errors_reported(as_json):
        hardware = Hardware.read(file)
        if not ask_to_stop(hardware.bus.port):
            with _bus(file) as (bus, hardware, _):
                unsure = bench.stop(bus, hardware)
            if unsure:
                raise AloftError(f"not certain to be in damping: {', '.join(unsure)}")
    if as_json:
        print_json({"success": True, "damped": list(hardware.motors)})
    else:
        say(console(), f"all {len(hardware.motors)} drives are in damping")


def schema() -> None:
    """Print the JSON Schema of the hardware's file, with which editors complete its keys."""
    from ....hal.bear.configuration import Hardware

    print_json(Hardware.model_json_schema())


@contextmanager
def _bus(file: Path) -> Iterator[tuple[BearBus, Hardware, RobotDescription]]:
    """Open the bus of a file of the hardware, with the robot that it names."""
    from ....hal.bear.bus import BearBus, open_port
    from ....hal.bear.configuration import Hardware
    from ....robots.description import find_robot

    try:
        description: Any = find_robot(Hardware.read(file).robot)
    except LookupError as error:
        raise AloftError(str(error.args[0])) from error
    hardware = Hardware.read(file, description)
    bus = BearBus(
        open_port(hardware.bus.port, hardware.bus.baudrate), reply_time=hardware.bus.reply_time
    )
    try:
        yield bus, hardware, description
    finally:
        bus.close()
