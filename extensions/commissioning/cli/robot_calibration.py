"""``aloft robot calibrate``: the properties of a robot's sensors, motors and joints, from its swaying."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import AsJson, Overrides
from ....cli.shared.output import console, errors_reported, print_json, say, table
from ....cli.shared.robot_trials import robot_setting
from ....runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ..identification.calibration import Calibration
    from ..identification.robot_calibration import SwayedRun


def calibrate(
    source: Annotated[
        Path | None,
        typer.Argument(help="A graph in which the robot sways, or the recording of its run."),
    ] = None,
    settings: Overrides = None,
    robot: Annotated[
        str,
        typer.Option(
            help="Instead of a graph: the robot that sways, by name or URDF, MJCF or YAML file."
        ),
    ] = "",
    block: Annotated[str, typer.Option(help="The path of the robot's block.")] = "robot",
    command: Annotated[
        str, typer.Option(help="The port with the robot's commands.")
    ] = "safety.command",
    mass: Annotated[
        float | None, typer.Option(help="The robot's weighed mass [kg].", min=0.0)
    ] = None,
    jump: Annotated[
        Path | None,
        typer.Option(help="A graph or recording of a jump: also list the residuals by its phases."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Write the values for a graph here.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find the IMU's place, angle and age, torque constants, friction, play and pack of a robot.

    A graph is run first; extensions/commissioning/graphs/calibrate.yaml is one for BRUCE, extensions/commissioning/graphs/robots/calibrate.yaml for all robots. Every value has
    its standard deviation, and what the model does not explain is listed by joint and sensor, and by phase.
    """
    from ..identification.calibration import fragment
    from ..identification.robot_calibration import calibration_from

    with errors_reported(as_json):
        source, own = _chosen(source, robot)
        with _blocks_of(source):
            run = _measured(source, [*own, *(settings or [])], block, command)
            found = calibration_from(run, mass)
        if jump is not None:
            with _blocks_of(jump):
                run = _measured(jump, [], block, command, whole=False)
        phases = _by_phase(run, found)
        text = fragment(run.robot, found, source.name)
        if out is not None:
            try:
                out.write_text(text, encoding="utf-8")
            except OSError as error:
                raise AloftError(f"{out} cannot be written: {error.strerror}") from error
    if as_json:
        print_json({
            "success": True, "source": str(source), "calibration": found.model_dump(),
            "residuals_by_phase": phases, "graph": text, "written": str(out) if out else None,
        })  # fmt: skip
        return
    console().print(table(str(source), ("value", ">found", ">+-", "unit"), list(_rows(found))))
    left = [(name, f"{value:.3g}") for name, value in found.residuals.items()]
    console().print(table("not explained", ("joint or sensor", ">root mean square"), left))
    columns = ("base or joint", *(f">{name}" for name in phases))
    by_phase = [
        (part, *(f"{each[part]:.3g}" for each in phases.values()))
        for part in next(iter(phases.values()), {})
    ]
    console().print(table("not explained by phase [N, N m]", columns, by_phase))
    if out is not None:
        say(console(), f"wrote {out}: include it behind controllers/late_sensors.yaml")
    else:
        typer.echo(text, nl=False)


def _chosen(source: Path | None, robot: str) -> tuple[Path, list[str]]:
    """Return the graph or recording, and the settings that name its robot: one of both is given."""
    if (source is None) == (robot == ""):
        raise AloftError("give a graph or a recording, or a robot, such as --robot go2")
    if source is not None:
        return source, []
    from ....runtime.loading.reading.files import PREFIX, shipped_graphs

    name = "commissioning/calibrate" if robot == "bruce" else "commissioning/robots/calibrate"
    return shipped_graphs()[f"{PREFIX}{name}"], [robot_setting(robot)]


@contextmanager
def _blocks_of(source: Path) -> Iterator[None]:
    """Report a missing block or port as an error of this file."""
    try:
        yield
    except KeyError as error:
        raise AloftError(
            f"{source}: {error.args[0]}; --block and --command name the blocks"
        ) from error


def _measured(
    source: Path, settings: list[str], block: str, command: str, whole: bool = True
) -> SwayedRun:
    """Return a run that is made now, or a recorded one; ``whole``: a run that does not succeed is
    of no use."""
    from ..identification.robot_calibration import read_run, swayed

    if source.suffix in (".yaml", ".yml"):
        from ....runtime.graph import load

        return swayed(load(source, settings), block, command, whole)
    if settings:
        raise AloftError("--set is for a graph; a recording has been made already")
    from ....cli.shared.viewing import read

    run = read(source)
    if run.header.robot is None:
        raise AloftError(f"the graph {run.header.name} names no robot")
    return read_run(run.__getitem__, 1.0 / run.header.base_rate, run.header.robot, block, command)


def _by_phase(run: SwayedRun, found: Calibration) -> dict[str, dict[str, float]]:
    """Return the unexplained forces of each phase in which the robot follows its commands."""
    from ....planner.task.phase import Phase
    from ..identification.phase_residuals import phase_residuals

    standing = (Phase.STAND, Phase.SQUAT, Phase.RECOVER)
    judged = (*standing[:2], Phase.THRUST, Phase.FLIGHT, Phase.LANDING, Phase.RECOVER)
    return phase_residuals(
        run.robot,
        run.motion,
        run.phase,
        {int(each): each.name.lower() for each in judged},
        frozenset(map(int, standing)),
        found,
    )


def _rows(found: Calibration) -> list[tuple[str, str, str, str]]:
    def row(name: str, value: Any, unit: str, factor: float = 1.0) -> tuple[str, str, str, str]:
        return name, f"{factor * value.value:.4g}", f"{factor * value.std:.2g}", unit

    rows = [row("mass", found.mass, "kg")]
    for axis, place in zip("xyz", found.imu_position, strict=True):
        rows.append(row(f"IMU's place {axis}", place, "mm", 1e3))
    for axis, angle in zip("xyz", found.imu_rotation, strict=True):
        rows.append(row(f"IMU's angle about {axis}", angle, "mrad", 1e3))
    rows += [
        row("age of the gyroscope", found.gyro_age, "ms", 1e3),
        row("age of the accelerometer", found.accelerometer_age, "ms", 1e3),
        row("age of joint velocities", found.velocity_age, "ms", 1e3),
        row("saturation", found.saturation, ""), row("load friction", found.load_friction, ""),
        row("rotor inertia, factor", found.rotor_inertia, ""),
        row("compliance of gears", found.gear_compliance, "mrad/(N m)", 1e3),
    ]  # fmt: skip
    if found.delay is not None:
        rows.append(row("delay from tick to torque", found.delay, "ms", 1e3))
    if found.open_voltage is not None and found.resistance is not None:
        rows.append(row("open voltage", found.open_voltage, "V"))
        rows.append(row("resistance of the pack", found.resistance, "mohm", 1e3))
    for what, values, unit, factor in (
        ("torque constant", found.torque_constant, "", 1.0),
        ("friction", found.friction, "N m", 1.0), ("damping", found.damping, "N m s/rad", 1.0),
        ("play", found.play, "mrad", 1e3),
    ):  # fmt: skip
        rows += [row(f"{what} of {name}", value, unit, factor) for name, value in values.items()]
    return rows
