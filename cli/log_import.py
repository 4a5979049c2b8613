"""``aloft log import``: lists the columns of a log that others wrote, and writes a graph that plays it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from ..runtime.language.errors import AloftError
from .shared.options import AsJson
from .shared.output import console, errors_reported, print_json, say, table

_WORDS: Mapping[str, tuple[tuple[str, ...], tuple[int, ...]]] = {
    "time": (("stamp", "time"), (1,)),
    "angular_velocity": (("angular_velocity", "gyro", "omega"), (3,)),
    "specific_force": (("linear_acceleration", "accel", "imuacc", "acc"), (3,)),
    "joint_position": (
        ("joint_position", "jointspos", "joint_states.position", "position", "q"),
        (),
    ),
    "joint_velocity": (
        ("joint_velocity", "jointsvel", "joint_states.velocity", "velocity", "qd"),
        (),
    ),
    "joint_torque": (("joint_torque", "effort", "torque", "tau"), ()),
    "truth_position": (("basepos", "base_position", "mocap", "pose.position"), (3,)),
    "truth_rpy": (("baserot", "base_rpy", "rpy"), (3,)),
    "truth_quaternion": (("quaternion", "pose.orientation"), (4,)),
}
"""Words in the names of columns, the likeliest first, and their widths; none: as many as there are joints."""


def import_log(
    file: Annotated[
        Path, typer.Argument(help="The log: HDF5, .npz, .csv, .parquet, .mcap, a bag.")
    ],
    robot: Annotated[Path | None, typer.Option(help="The robot's YAML.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The graph; by default named like the log.")
    ] = None,
    force: Annotated[bool, typer.Option(help="Overwrite an existing graph.")] = False,
    as_json: AsJson = False,
) -> None:
    """List the columns of a log, guess which is what, and write a graph that plays it."""
    from ..hal.log.log_file import LogError, read_log

    with errors_reported(as_json):
        try:
            found = read_log(file)
        except LogError as error:
            raise AloftError(str(error)) from None
        widths = {name: each.values.shape[1] for name, each in found.arrays.items()}
        guessed = guess(widths)
        target = out or file.with_suffix(".yaml")
        if target.exists() and not force:
            raise AloftError(f"{target} exists; --force overwrites it, --out names another")
        own_stamps = any(each.stamps is not None for each in found.arrays.values())
        graph = graph_of(file, robot, guessed, own_stamps)
        head = "# Guessed by `aloft log import` from names and widths: look at each column, unit and foot.\n"
        target.write_text(head + yaml.safe_dump(graph, sort_keys=False), encoding="utf-8")
    if as_json:
        print_json({"graph": str(target), "columns": widths, "guessed": guessed})
        return
    meaning = {column: what for what, column in guessed.items()}
    rows = [
        (name, str(len(each.values)), str(widths[name]), each.unit or "", meaning.get(name, ""))
        for name, each in found.arrays.items()
    ]
    console().print(table(str(file), ("column", ">rows", ">width", "unit", "guessed as"), rows))
    say(console(), f"wrote {target}: look at each part, then `aloft check {target}`")


def guess(widths: Mapping[str, int]) -> dict[str, str]:
    """Return the column of each quantity, of those whose names have its words and whose width fits."""
    guessed: dict[str, str] = {}
    for what, (words, allowed) in _WORDS.items():
        free = [name for name in widths if name not in guessed.values()]
        column = _first(words, free, widths, allowed)
        if column is not None:
            guessed[what] = column
    return guessed


def _first(
    words: Iterable[str], names: list[str], widths: Mapping[str, int], allowed: tuple[int, ...]
) -> str | None:
    for word in words:
        for name in names:
            fits = widths[name] in allowed if allowed else widths[name] > 4
            if fits and (word in name.lower() if len(word) > 2 else word == name.lower()):
                return name
    return None


def graph_of(
    file: Path, robot: Path | None, guessed: Mapping[str, str], own_stamps: bool
) -> dict[str, Any]:
    """Return a graph that plays what was guessed, estimates the base, and scores where there is a truth."""
    played: dict[str, Any] = {"file": file.name}
    if "time" in guessed and not own_stamps:
        played["clock"] = {"stamps": guessed["time"]}
    if "joint_position" in guessed:
        parts = ("position", "velocity", "torque")
        played["joints"] = {
            part: guessed[f"joint_{part}"] for part in parts if f"joint_{part}" in guessed
        }
    imu = {
        part: guessed[part] for part in ("angular_velocity", "specific_force") if part in guessed
    }
    if len(imu) == 2:
        played["imu"] = imu
    turn = next((each for each in ("rpy", "quaternion") if f"truth_{each}" in guessed), None)
    if "truth_position" in guessed and turn is not None:
        played["truth"] = {"position": guessed["truth_position"], turn: guessed[f"truth_{turn}"]}
    blocks: dict[str, Any] = {"robot": {"use": "hal.LogRobot", "with": played}}
    blocks["estimator"] = {
        "use": "blocks.StateEstimator",
        "in": {
            "imu": "robot.imu",
            "joints": "robot.joints",
            "contacts": {"active": "robot.contacts.closed"},
        },
    }
    if "truth" in played:
        blocks["score"] = {
            "use": "blocks.EstimatorScore",
            "with": {"align": "start"},
            "in": {"truth": "robot.truth", "base": "estimator.base"},
        }
    return {"rate": "500 Hz", "robot": str(robot or "robot.yaml"), "blocks": blocks}
