"""``aloft robot calibrate``: what sensors, motors and joints of a robot are like, from how it sways."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...runtime.language.errors import AloftError
from .options import AsJson, Overrides
from .output import console, errors_reported, print_json, say, table

if TYPE_CHECKING:
    from ...robots.calibration import Calibration
    from ...robots.identification import MeasuredRun
    from ...robots.robot_description import RobotDescription

_FIELDS = {
    "position": "joints.position", "velocity": "joints.velocity", "torque": "joints.torque",
    "rate": "imu.angular_velocity", "force": "imu.specific_force", "closed": "contacts.closed",
    "voltage": "health.voltage",
}  # fmt: skip
_PHASE = "phase.phase.phase"


def calibrate(
    source: Annotated[
        Path, typer.Argument(help="A graph in which the robot sways, or the recording of its run.")
    ],
    settings: Overrides = None,
    robot: Annotated[str, typer.Option(help="The path of the robot's block.")] = "robot",
    command: Annotated[
        str, typer.Option(help="The port with the robot's commands.")
    ] = "safety.command",
    mass: Annotated[
        float | None, typer.Option(help="The robot's mass by a balance [kg].", min=0.0)
    ] = None,
    jump: Annotated[
        Path | None,
        typer.Option(
            help="A graph or a recording of a jump: list by its phases what is not explained."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Write the values for a graph here.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find the IMU's place, angle and age, torque constants, friction, play and pack of a robot.

    A graph is run first; graphs/calibrate.yaml is one for BRUCE. Every value has its standard deviation,
    and what the model does not explain is listed by joint and sensor, and by phase.
    """
    from ...robots.calibration import fragment

    with errors_reported(as_json):
        signals, period, description = _measured(source, settings or [], robot, command)
        found = _found(signals, period, description, mass, source)
        if jump is not None:
            signals, period, description = _measured(jump, [], robot, command, whole=False)
        phases = _by_phase(signals, period, description, found)
        text = fragment(description, found, source.name)
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


def _measured(
    source: Path, settings: list[str], robot: str, command: str, whole: bool = True
) -> tuple[dict[str, Any], float, RobotDescription]:
    """All signals that are needed, from a run that is made now or from a recording; ``whole``: a run
    that does not succeed is of no use."""
    names = {key: f"{robot}.{field}" for key, field in _FIELDS.items()}
    names |= {key: f"{command}.{key}" for key in ("stiffness", "damping")}
    names["asked"] = f"{command}.torque"
    try:
        if source.suffix in (".yaml", ".yml"):
            from ...runtime.graph import load

            graph = load(source, settings)
            result = graph.run()
            result.raise_if_failed()
            if whole and not result.success:
                raise AloftError(f"{source}: the robot did not sway to the end: {result.reason}")
            assert graph.checked.robot is not None
            signals = {key: result.signal(name) for key, name in names.items()}
            signals["phase"] = _phases(result.signal, len(signals["asked"]))
            return signals, result.period, graph.checked.robot
        if settings:
            raise AloftError("--set is for a graph; a recording has been made already")
        from .viewing import read

        run = read(source)
        if run.header.robot is None:
            raise AloftError(f"{source}: the graph {run.header.name} names no robot")
        signals = {key: run[name] for key, name in names.items()}
        signals["phase"] = _phases(run.__getitem__, len(signals["asked"]))
        return signals, 1.0 / run.header.base_rate, run.header.robot
    except KeyError as error:
        raise AloftError(
            f"{source}: {error.args[0]}; --robot and --command name the blocks"
        ) from error


def _phases(signal: Callable[[str], Any], ticks: int) -> Any:
    """The phase of each tick; a robot whose graph tells none stands."""
    import numpy as np

    try:
        return signal(_PHASE)
    except KeyError:
        return np.zeros(ticks, dtype=np.int64)


def _motion(signals: dict[str, Any], period: float) -> MeasuredRun:
    import numpy as np

    from ...robots.identification import MeasuredRun

    return MeasuredRun(
        period, signals["position"], signals["velocity"], signals["torque"], signals["rate"],
        signals["force"], np.zeros((len(signals["position"]), 3)), signals["closed"],
    )  # fmt: skip


def _by_phase(
    signals: dict[str, Any], period: float, robot: RobotDescription, found: Calibration
) -> dict[str, dict[str, float]]:
    """What is not explained in the phases in which the robot moves as it is told."""
    from ...blocks.signals.jumping import Phase
    from ...robots.phase_residuals import phase_residuals

    standing = (Phase.STAND, Phase.SQUAT, Phase.RECOVER)
    names = {
        int(each): each.name.lower()
        for each in (
            Phase.STAND,
            Phase.SQUAT,
            Phase.THRUST,
            Phase.FLIGHT,
            Phase.LANDING,
            Phase.RECOVER,
        )
    }
    return phase_residuals(
        robot,
        _motion(signals, period),
        signals["phase"],
        names,
        frozenset(map(int, standing)),
        found,
    )


def _found(
    signals: dict[str, Any],
    period: float,
    robot: RobotDescription,
    mass: float | None,
    source: Path,
) -> Calibration:
    from ...robots.calibration import calibrate_robot
    from ...robots.identification import IdentificationError

    motion = _motion(signals, period)
    feedback = (signals["stiffness"] != 0.0).any(axis=1) | (signals["damping"] != 0.0).any(axis=1)
    try:
        return calibrate_robot(robot, motion, signals["voltage"], signals["asked"], feedback, mass)
    except IdentificationError as error:
        raise AloftError(f"{source}: {error}") from error


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
