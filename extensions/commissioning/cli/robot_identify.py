"""``aloft robot identify``: fit a robot's parameters to a recorded run."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import AsJson
from ....cli.shared.output import console, errors_reported, print_json, say, table
from ....runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ....logs.file.reader import RecordedRun
    from ....robots.robot_description import RobotDescription
    from ..identification.identification import IdentifiedBody, IdentifiedDelay

Logs = Annotated[
    list[Path],
    typer.Argument(
        help="Recordings of runs, files .rrd, or graphs with hal.LogRobot, whose logs are read."
    ),
]


def identify(
    files: Logs,
    held_out: Annotated[
        list[Path] | None,
        typer.Option("--held-out", help="A log that judges the fit; may be repeated."),
    ] = None,
    robot: Annotated[str | None, typer.Option(help="The path of the robot's block.")] = None,
    base: Annotated[str, typer.Option(help="The port with the estimated base.")] = "estimator.base",
    command: Annotated[
        str, typer.Option(help="The port with the robot's commands.")
    ] = "safety.command",
    encoder_std: Annotated[
        float, typer.Option(help="Standard deviation of the encoders' offsets [rad].", min=0.0)
    ] = 0.003,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Write the values for a graph or a robot here."),
    ] = None,
    band: Annotated[
        float | None,
        typer.Option(
            help="Fit below this frequency [Hz]; by default by the torques' spectra.", min=0.1
        ),
    ] = None,
    trusted: Annotated[
        list[str] | None,
        typer.Option(
            help="A joint whose torques are right, not only in proportion; may be repeated."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fit a robot's dynamics to logs, each value with its standard deviation.

    One recording of a floating base with an estimator tells mass, torso's CoM, joint friction and delay. Any other log tells what
    the equations of motion hold of inertias, gravity, friction, rotors, torque constants and delay.
    """
    with errors_reported(as_json):
        if (
            band is not None
            or held_out
            or trusted
            or not _stands_alone(files, robot or "robot", base)
        ):
            _dynamics(files, held_out or [], robot, command, band, trusted or [], out, as_json)
            return
        file = files[0]
        run, description = _recorded(file)
        body, delay = _identified(run, description, robot or "robot", base, command, encoder_std)
        text = graph_values(run, description, body, delay, file)
        _write(out, text)
    if as_json:
        print_json(
            {
                "success": True, "recording": str(file), "robot": description.name,
                "body": asdict(body), "delay": asdict(delay), "graph": text,
                "written": str(out) if out else None,
            }
        )  # fmt: skip
        return
    columns = ("value", ">found", ">+-", ">description", "unit")
    console().print(table(str(file), columns, list(_rows(description, body, delay))))
    if body.resting:
        say(console(), f"friction as described, for they hardly turned: {', '.join(body.resting)}")
    if out is not None:
        say(console(), f"wrote {out}: include it after the controller and its gains")
    else:
        typer.echo(text, nl=False)


def _stands_alone(files: list[Path], robot: str, base: str) -> bool:
    """Check for one recording of a floating base whose orientation was estimated."""
    if len(files) != 1 or files[0].suffix in (".yaml", ".yml"):
        return False
    run, description = _recorded(files[0])
    signals = run.signals()
    named = (f"{robot}.imu.specific_force", f"{base}.orientation")
    return description.base_joint == "floating" and any(name in signals for name in named)


def _write(out: Path | None, text: str) -> None:
    if out is None:
        return
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise AloftError(f"{out} cannot be written: {error.strerror}") from error


def _dynamics(
    files: list[Path], held_out: list[Path], robot: str | None, command: str, band: float | None,
    trusted: list[str], out: Path | None, as_json: bool,
) -> None:  # fmt: skip
    from .identified_dynamics import (
        as_data,
        description_text,
        dynamics_of,
        residual_rows,
        value_rows,
    )

    found, description = dynamics_of(files, held_out, robot, command, band, trusted)
    text = description_text(found, files)
    _write(out, text)
    if as_json:
        written = {"robot": description.name, "text": text, "written": str(out) if out else None}
        print_json({"success": True, **written, **as_data(found)})
        return
    columns = ("value", ">found", ">+-", ">description", "unit")
    title = f"{description.name}, below {found.fit.band:.3g} Hz"
    console().print(table(title, columns, list(value_rows(found))))
    columns = ("log", "joint", ">torque", ">not explained", ">by the description")
    console().print(table("rms [N m]", columns, list(residual_rows(found))))
    for line in found.warnings:
        say(console(), f"warning: {line}")
    for line in found.untold:
        say(console(), f"not told: {line}")
    if out is not None:
        say(console(), f"wrote {out}: a profile for the robot's YAML")


def _recorded(file: Path) -> tuple[RecordedRun, RobotDescription]:
    from ....cli.shared.viewing import read

    run = read(file)
    if run.header.robot is None:
        raise AloftError(f"{file}: the graph {run.header.name} names no robot")
    return run, run.header.robot


def _identified(
    run: RecordedRun, description: RobotDescription, robot: str, base: str, command: str,
    encoder_std: float,
) -> tuple[IdentifiedBody, IdentifiedDelay]:  # fmt: skip
    import numpy as np

    from ....mathematics.rotations import to_matrix
    from ..identification.identification import (
        IdentificationError,
        MeasuredRun,
        identify_delay,
        identify_rigid_body,
    )

    names = {
        "position": f"{robot}.joints.position", "velocity": f"{robot}.joints.velocity",
        "torque": f"{robot}.joints.torque", "rate": f"{robot}.imu.angular_velocity",
        "force": f"{robot}.imu.specific_force", "closed": f"{robot}.contacts.closed",
        "turned": f"{base}.orientation", "asked": f"{command}.torque",
        "stiffness": f"{command}.stiffness", "damping": f"{command}.damping",
    }  # fmt: skip
    try:
        seen = {key: run[name] for key, name in names.items()}
    except KeyError as error:
        raise AloftError(
            f"{run.path}: {error.args[0]}; --robot, --base and --command say which blocks to read"
        ) from error
    block = next((each for each in run.header.blocks if each.path == robot), None)
    if (block is not None and block.period_ticks != 1) or (np.diff(run.ticks) != 1).any():
        raise AloftError(
            f"{run.path}: the robot must run, and be recorded, in every tick of the graph"
        )
    matrix = np.zeros((3, 3))
    up = np.zeros((len(seen["turned"]), 3))
    for k, orientation in enumerate(seen["turned"]):
        to_matrix(orientation, matrix)
        up[k] = matrix[2]
    period = 1.0 / run.header.base_rate
    motion = MeasuredRun(
        period, seen["position"], seen["velocity"], seen["torque"], seen["rate"], seen["force"], up,
        seen["closed"],
    )  # fmt: skip
    feedback = (seen["stiffness"] != 0.0).any(axis=1) | (seen["damping"] != 0.0).any(axis=1)
    try:
        body = identify_rigid_body(description, motion, encoder_std)
        return body, identify_delay(period, seen["asked"], seen["torque"], feedback)
    except IdentificationError as error:
        raise AloftError(f"{run.path}: {error}") from error


def _rows(
    robot: RobotDescription, body: IdentifiedBody, delay: IdentifiedDelay
) -> list[tuple[str, str, str, str, str]]:
    def row(name: str, value: Any, described: float | None, unit: str, factor: float = 1.0) -> Any:
        shown = "" if described is None else f"{factor * described:.4g}"
        return (name, f"{factor * value.value:.4g}", f"{factor * value.std:.2g}", shown, unit)

    motors = robot.motors
    index = {joint.name: k for k, joint in enumerate(robot.joints)}
    rows = [row("mass", body.mass, robot.total_mass, "kg")]
    for axis, offset in zip("xyz", body.com_offset, strict=True):
        rows.append(row(f"torso's CoM, offset {axis}", offset, 0.0, "mm", 1e3))
    for name, value in body.coulomb.items():
        k = index[name]
        unit = robot.joints[k].unit("N m")
        rows.append(row(f"friction of {name}", value, motors.friction[k], unit))
    for name, value in body.viscous.items():
        k = index[name]
        unit = robot.joints[k].unit("N m s/rad")
        rows.append(row(f"damping of {name}", value, motors.damping[k], unit))
    rows.append(row("delay from tick to torque", delay.delay, None, "ms", 1e3))
    return rows


def graph_values(
    run: RecordedRun,
    robot: RobotDescription,
    body: IdentifiedBody,
    delay: IdentifiedDelay,
    file: Path,
) -> str:
    """Return the values as a graph's ``set``, for the blocks of the recorded graph that take them."""

    def path(kind: str, usual: str) -> str:
        found = (b.path for b in run.header.blocks if b.type.rpartition(":")[2] == kind)
        return next(found, usual)

    weight, joint_pd = path("MassEstimator", "weight"), path("JointPD", "joint_pd")
    waiting = path("DelayEstimator", "delay")
    usual = run.header.parameters.get(f"{waiting}.usual", 0.001)
    nominal = max(0.0, delay.delay.value - float(usual))
    index = {joint.name: k for k, joint in enumerate(robot.joints)}
    further = {
        name: max(0.0, value.value - float(robot.motors.friction[index[name]]))
        for name, value in body.coulomb.items()
    }
    offsets = ", ".join(f"{value.value:.4f}" for value in body.com_offset)
    lines = [
        f"# {robot.name} as {file.name} shows it, found by `aloft robot identify`. Include this file after the",
        "# controller and its gains. Standard deviations are in the comments; damping of the joints is not set.",
        "set:",
        f"  {weight}.mass: {body.mass.value:.3f} kg  # +- {body.mass.std:.3f} kg",
        f"  {weight}.mass_spread: {max(1e-4, body.mass.std / body.mass.value):.4f}",
        f"  {weight}.com_offset: [{offsets}]  # m; +- "
        + ", ".join(f"{1e3 * value.std:.1f}" for value in body.com_offset)
        + " mm",
        f"  {weight}.com_spread: {max(value.std for value in body.com_offset):.4f} m",
        f"  {waiting}.nominal: {1e3 * nominal:.2f} ms  # +- {1e3 * delay.delay.std:.2f} ms",
        f"  {joint_pd}.friction:  # beyond the description's [N m]",
        '    "*": 0',
        *(
            f"    {name}: {value:.3f}  # +- {body.coulomb[name].std:.3f}"
            for name, value in further.items()
        ),
    ]
    return "\n".join(lines) + "\n"
