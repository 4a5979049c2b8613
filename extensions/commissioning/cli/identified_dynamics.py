"""Tables, JSON and YAML of ``aloft robot identify`` for a robot's dynamics by its logs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....cli.shared.viewing import read
from ....runtime.language.errors import AloftError
from ..identification.identification import IdentificationError

if TYPE_CHECKING:
    from ....robots.robot_description import RobotDescription
    from ..identification.dynamics_report import IdentifiedDynamics
    from ..identification.motion_log import MotionLog

KINDS = (
    ("rotor inertia", "kg m^2"), ("coulomb", "N m"), ("viscous", "N m s/rad"), ("load", "of the torque"),
    ("torque constant", "of the log's"), ("offset", "N m"), ("age of torques", "s"),
    ("accelerometer offset", "m/s^2"),
)  # fmt: skip


def read_log(file: Path, block: str | None, command: str) -> tuple[MotionLog, RobotDescription]:
    """Read a recording, or the log of a graph with ``hal.LogRobot``. Raises ``AloftError``."""
    from ..identification.motion_log import log_of_graph, log_of_recording

    if file.suffix in (".yaml", ".yml"):
        return log_of_graph(file, block)
    run = read(file)
    if run.header.robot is None:
        raise AloftError(f"{file}: the graph {run.header.name} names no robot")
    return log_of_recording(run, block or "robot", command), run.header.robot


def dynamics_of(
    files: list[Path], held_out: list[Path], block: str | None, command: str, band: float | None,
    trusted: list[str],
) -> tuple[IdentifiedDynamics, RobotDescription]:  # fmt: skip
    """Fit the dynamics of the robot that is in all these files. Raises ``AloftError``."""
    from ..identification.dynamics_report import identify_dynamics

    every = [read_log(file, block, command) for file in (*files, *held_out)]
    robot = every[0][1]
    for file, (_, other) in zip((*files, *held_out), every, strict=True):
        if [j.name for j in other.joints] != [j.name for j in robot.joints]:
            raise AloftError(f"{file} is of {other.name}, and {files[0]} of {robot.name}")
    logs = [log for log, _ in every]
    try:
        found = identify_dynamics(
            robot, logs[: len(files)], logs[len(files) :], band, tuple(trusted)
        )
    except IdentificationError as error:
        raise AloftError(f"{files[0]}: {error}") from error
    return found, robot


def value_rows(found: IdentifiedDynamics) -> Iterator[tuple[str, str, str, str, str]]:
    """Give the rows of the table: value, found, standard deviation, the description's, unit."""
    model = found.model
    units = iter(model.links.units)
    described = iter(model.links.described_base)
    for name, value in found.values("base").items():
        yield name, f"{value.value:.4g}", f"{value.std:.2g}", f"{next(described):.4g}", next(units)
    motors = model.robot.motors
    index = {joint: k for k, joint in enumerate(model.joints)}
    known = {"rotor inertia": model.rotors, "coulomb": motors.friction, "viscous": motors.damping}
    for kind, unit in KINDS:
        for name, value in found.values(kind).items():
            beside = f"{known[kind][index[name]]:.4g}" if kind in known else ""
            shown = kind if kind == "age of torques" else f"{kind} of {name}"
            yield shown, f"{value.value:.4g}", f"{value.std:.2g}", beside, unit
    if found.delay is not None:
        yield (
            "delay from command to torque",
            f"{found.delay.value:.4g}",
            f"{found.delay.std:.2g}",
            "",
            "s",
        )


def residual_rows(found: IdentifiedDynamics) -> Iterator[tuple[str, str, str, str, str]]:
    """Give the rows of the second table: log, joint, and root mean squares."""
    for each in found.residuals:
        name = f"{each.log}, held out" if each.held_out else each.log
        for joint, torque in each.torque.items():
            yield (
                name,
                joint,
                f"{torque:.3f}",
                f"{each.fitted[joint]:.3f}",
                f"{each.described[joint]:.3f}",
            )
            name = ""


def as_data(found: IdentifiedDynamics) -> dict[str, Any]:
    """Return all of it for JSON."""
    kinds = ("base", *(kind for kind, _ in KINDS))
    return {
        "band_hz": found.fit.band,
        "values": {kind: {n: asdict(v) for n, v in found.values(kind).items()} for kind in kinds},
        "delay": None if found.delay is None else asdict(found.delay),
        "links": {name: asdict(link) for name, link in found.body.links.items()},
        "residuals": [asdict(each) for each in found.residuals],
        "warnings": list(found.warnings), "untold": list(found.untold),
    }  # fmt: skip


def description_text(found: IdentifiedDynamics, files: list[Path]) -> str:
    """Return the values as a profile for the robot's YAML, and in comments the links' inertias for its URDF."""
    model = found.model

    keys = {"friction": "coulomb", "damping": "viscous", "rotor_inertia": "rotor inertia"}
    values = {key: found.values(kind) for key, kind in keys.items()}
    lines = [
        f"# {model.robot.name} as {', '.join(file.name for file in files)} show it, found by `aloft robot identify`.",
        *(("profiles:", "  identified:", "    motors:") if model.joints else ()),
    ]
    for joint in model.joints:
        lines.append(f"      {joint}:")
        for key, each in values.items():
            if joint in each:
                lines.append(f"        {key}: {each[joint].value:.6f}  # +- {each[joint].std:.2g}")
        if joint not in values["rotor_inertia"]:
            own = float(model.rotors[model.joints.index(joint)])
            lines.append(
                f"        rotor_inertia: {own:.6f}  # as described: it acts with the link's"
            )
    lines.append(
        "# The <inertial> of every link: the nearest bodies that can exist; of them only the base parameters are told."
    )
    for name, link in found.body.links.items():
        com = " ".join(f"{each:.5f}" for each in link.com)
        parts = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), link.inertia, strict=True)
        lines.append(
            f"# {name}: mass {link.mass:.5f}, origin {com}, "
            + " ".join(f"{k} {v:.6f}" for k, v in parts)
        )
    return "\n".join(lines) + "\n"
