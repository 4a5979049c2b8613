"""``aloft log import``: lists the columns of a log that others wrote, and writes a graph that plays it."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
import yaml

from ..hal.log.played_log import UNNAMED
from ..mathematics.constants import GRAVITY
from ..runtime.language.errors import AloftError
from .logged_joints import (
    LoggedJoints,
    columns_of_joints,
    commented,
    doubt_of,
    lists_of_joints,
    name_joints,
)
from .shared.options import AsJson
from .shared.output import console, errors_reported, print_json, say, table

if TYPE_CHECKING:
    from ..hal.log.log_file import LogFile
    from ..robots.robot_description import RobotDescription

_WORDS: Mapping[str, tuple[tuple[str, ...], tuple[int, ...]]] = {
    "time": (("stamp", "time", "t"), (1,)),
    "specific_force": (("specific_force", "linear_acceleration", "acc", "a"), (3,)),
    "angular_velocity": (("angular_velocity", "gyr", "omega", "w"), (3,)),
    "joint_position": (
        ("joint_position", "jointspos", "joint_states.position", "position", "pos", "q"),
        (),
    ),
    "joint_velocity": (
        ("joint_velocity", "jointsvel", "joint_states.velocity", "velocity", "vel", "qd", "dq"),
        (),
    ),
    "joint_torque": (("joint_torque", "effort", "torque", "tau"), ()),
    "truth_position": (
        ("basepos", "truth.base_position", "base_position", "mocap", "pose.position"),
        (3,),
    ),
    "truth_rpy": (("baserot", "base_rpy", "rpy"), (3,)),
    "truth_quaternion": (("quaternion", "pose.orientation", "base_orientation"), (4,)),
}
"""Words in the names of columns, the likeliest first, and their widths; none: as many as there are joints."""
_FORCE = re.compile(r"(force|grf)_?z?$|fz$", re.IGNORECASE)
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+")
_SIDES = {"l": "left", "lf": "left", "left": "left", "r": "right", "rf": "right", "right": "right"}
"""Names of a force along a sole's normal, their words, and the words of a side."""
_CLOSES, _OPENS = 0.25, 0.2
"""Shares of the weight above which a foot's contact is closed, and below which it is opened."""
_NUMBERED = re.compile(r"(?P<stem>.*?)[_\[]?(?P<number>\d+)\]?(?P<rest>\D*)")
_AXES = (
    re.compile(r"(.+?)([xyzw])(\)?)", re.IGNORECASE),
    re.compile(r"((?:.*[^a-z])?)([xyzw])([^a-z].*)", re.IGNORECASE),
)
"""Names with an axis at their end, and with one that stands alone: `GyrX`, `acc_x_raw`."""
_STAMP_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_STEPS = (1e-4, 0.1)
"""Units of stamps [s]; between these are the steps of a log whose stamps' unit is guessed [s]."""

Guess = str | list[str]
"""A column, or the columns of one number each, in order."""


def import_log(
    file: Annotated[
        Path, typer.Argument(help="The log: HDF5, .npz, .csv, .parquet, .mcap, a bag.")
    ],
    robot: Annotated[Path | None, typer.Option(help="The robot's YAML.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The graph; by default named like the log.")
    ] = None,
    joints: Annotated[
        str,
        typer.Option(
            help="The joints' names in the columns' order, with commas between; - for a column that is none."
        ),
    ] = "",
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
        described = described_robot(robot)
        given = [name.strip() for name in joints.split(",")] if joints else []
        guessed = guess(widths, _numbers_of_joints(found, described, given))
        if described is not None and "joint_position" not in guessed:
            guessed = guess(widths)
        own = (
            {}
            if described is None
            else columns_of_joints(widths, described, _one(guessed.get("specific_force", "")))
        )
        forces = {} if described is None else forces_of_feet(widths, described)
        target = out or file.with_suffix(".yaml")
        if target.exists() and not force:
            raise AloftError(f"{target} exists; --force overwrites it, --out names another")
        own_stamps = any(each.stamps is not None for each in found.arrays.values())
        dates = [name for name, each in found.arrays.items() if each.unit in _STAMP_UNITS and widths[name] == 1]  # fmt: skip
        if "time" not in guessed and dates:
            guessed["time"] = dates[0]
        graph = graph_of(_beside(target, file), robot, guessed, own_stamps)
        played = graph["blocks"]["robot"]["with"]
        if own:
            played["joints"] = own
            guessed = {k: v for k, v in guessed.items() if not k.startswith("joint_")}
            guessed |= {f"joint_{part}": own[part] for part in own if part != "names"}
        if described is not None and forces:
            weight = GRAVITY * described.total_mass
            played["contacts"] = {
                foot: {
                    "force": column,
                    "closes": f"{_CLOSES * weight:.0f} N",
                    "opens": f"{_OPENS * weight:.0f} N",
                }
                for foot, column in forces.items()
            }
        guessed |= {f"force of {foot}": column for foot, column in forces.items()}
        switches = {} if described is None or forces else switches_of_feet(widths, described)
        if switches:
            played["contacts"] = {foot: {"closed": each} for foot, each in switches.items()}
            guessed |= {f"contact of {foot}": each for foot, each in switches.items()}
        notes = _clock(found, played, guessed)
        named = LoggedJoints()
        if "joints" in played:
            try:
                named = name_joints(found, played, described, given)
            except LogError as error:
                raise AloftError(str(error)) from None
            if named.names is not None:
                played["joints"] = {**played["joints"], "names": named.names}
        elif given:
            raise AloftError(f"--joints: {file.name} has no columns of joints' angles")
        notes += named.notes
        if named.sensor is not None:
            played["imu"]["sensor"] = named.sensor
        head = "# Guessed by `aloft log import`: look at each column, unit and foot.\n"
        text = commented(yaml.safe_dump(graph, sort_keys=False, width=200), named)
        target.write_text(head + text, encoding="utf-8")
    if as_json:
        columns = [vars(each) for each in named.columns]
        print_json(
            {
                "graph": str(target),
                "columns": widths,
                "guessed": guessed,
                "joints": columns,
                "notes": notes,
            }
        )
        return
    meaning = {
        column: what
        for what, columns in guessed.items()
        for column in (columns if isinstance(columns, list) else [columns])
    }
    rows = [
        (name, str(len(each.values)), str(widths[name]), each.unit or "", meaning.get(name, ""))
        for name, each in found.arrays.items()
    ]
    console().print(table(str(file), ("column", ">rows", ">width", "unit", "guessed as"), rows))
    if {each.sure for each in named.columns} - {"named", "given"}:
        joined = [
            (each.column, each.joint or UNNAMED, each.sure, each.why) for each in named.columns
        ]
        console().print(table("joints", ("column", "joint", "how sure", "why"), joined))
    for note in notes:
        say(console(), note)
    say(console(), f"wrote {target}: look at each part, then `aloft check {target}`")


def _numbers_of_joints(
    log: LogFile, robot: RobotDescription | None, given: list[str]
) -> tuple[int, ...]:
    """Return how many columns a quantity of the joints may have; empty if nothing says so."""
    if given:
        return (len(given),)
    listed = {len(names) for names in lists_of_joints(log.texts, robot).values()}
    return tuple(listed) or (() if robot is None else (len(robot.joints),))


def _one(guess: Guess) -> str:
    return guess if isinstance(guess, str) else guess[0]


def _beside(graph: Path, file: Path) -> Path:
    """Return a log's path from the folder of a graph."""
    return Path(os.path.relpath(file.resolve(), graph.parent.resolve()))


def _clock(log: LogFile, played: dict[str, Any], guessed: Mapping[str, Guess]) -> list[str]:
    """Guess the unit of stamps that have none, and take those whose steps vary much for arrival times; say so."""
    from ..hal.log.columns import MOST_APART, MOST_JITTER, LogClock, moments_of, usual_step
    from ..hal.log.log_file import LogError
    from ..hal.log.series import GAP, Series

    if "clock" not in played:
        return []
    clock, notes = played["clock"], []
    stamps = log.array(clock["stamps"])
    step = usual_step(stamps.values[:, 0])
    if stamps.unit is None and step > MOST_APART:
        fits = [unit for unit, per in _STAMP_UNITS.items() if _STEPS[0] <= step * per < _STEPS[1]]
        if fits:
            clock["unit"] = fits[0]
            rate = 1.0 / (step * _STAMP_UNITS[fits[0]])
            notes.append(
                f"the stamps are taken for {fits[0]}, {rate:.4g} rows a second (clock.unit)"
            )
    given = LogClock.model_validate(clock)
    try:
        times = moments_of(log, given, len(stamps.values), None).times
    except LogError as error:
        return [*notes, str(error)]
    # a table of several topics has numbers of each in some of its rows only, whose steps count
    spreads = [Series(times, stamps.values).spread()]
    for columns in guessed.values():
        names = columns if isinstance(columns, list) else [columns]
        arrays = [log.array(name).values for name in names]
        if {len(each) for each in arrays} == {len(times)}:
            rows = np.isfinite(np.hstack(arrays)).all(axis=1)
            if rows.any():
                spreads.append(Series(times[rows], stamps.values[rows]).spread())
    even = given.model_copy(update={"even": True})
    shift = moments_of(log, even, len(times), None).shift
    if min(spreads) <= MOST_JITTER or shift > GAP * usual_step(times):  # rows are missing
        return notes
    clock["even"] = True
    return [
        *notes,
        f"the steps between stamps vary by {100.0 * min(spreads):.0f} %: they are taken for arrival times, rows evenly apart (clock.even)",
    ]


def described_robot(robot: Path | None) -> RobotDescription | None:
    """Return a robot's description; ``None`` without one. Raises ``AloftError``."""
    if robot is None:
        return None
    from ..robots.description import RobotError, find_robot

    try:
        return find_robot(str(robot))
    except (LookupError, RobotError) as error:
        raise AloftError(f"--robot {robot}: {error.args[0]}") from error


def forces_of_feet(widths: Mapping[str, int], robot: RobotDescription) -> dict[str, str]:
    """Guess the column of the force on each foot, by the sides in both names, where each has one on that side."""
    found: dict[str, str] = {}
    for side in ("left", "right"):
        feet = [foot.name for foot in robot.feet if _side(foot.name) == side]
        columns = [
            name for name, width in widths.items()
            if width == 1 and _FORCE.search(name) and _side(name) == side
        ]  # fmt: skip
        if len(feet) == len(columns) == 1:
            found[feet[0]] = columns[0]
    return found


def switches_of_feet(widths: Mapping[str, int], robot: RobotDescription) -> dict[str, list[str]]:
    """Return the columns of the switches in each foot's points, where a log of aloft has one for every point."""
    whole = [name for name, width in widths.items() if width == len(robot.contacts) > 0]
    columns = {name: [f"{name}[{k}]" for k in range(widths[name])] for name in whole} | {
        stem: each for stem, each in numbered(widths).items() if len(each) == len(robot.contacts)
    }
    found = [each for name, each in columns.items() if name.endswith(".contacts.closed")]
    if len(found) != 1:
        return {}
    owners = robot.foot_of_contact()
    return {
        foot.name: [column for column, owner in zip(found[0], owners, strict=True) if owner == k]
        for k, foot in enumerate(robot.feet)
    }


def _side(name: str) -> str | None:
    words = (word.lower() for word in _WORD.findall(name))
    return next((_SIDES[word] for word in words if word in _SIDES), None)


def guess(widths: Mapping[str, int], joints: Collection[int] = ()) -> dict[str, Guess]:
    """Guess the column of each quantity, by the words in its name and its width.

    Columns of one number that differ by a number only (``pos_meas1``, ``pos_meas2``) are one quantity. What was measured
    comes before what was wanted or computed.

    Args:
        widths: numbers of each column, by its name.
        joints: how many numbers a quantity of the joints may have; without it more than four, or it is of numbered columns.

    Returns:
        The column, or the columns in order, by quantity.
    """
    counted = numbered(widths)
    series = {**of_axes(widths), **counted}
    known = {**widths, **{stem: len(columns) for stem, columns in series.items()}}
    guessed: dict[str, Guess] = {}
    for what, (words, allowed) in _WORDS.items():
        free = [name for name in known if name not in guessed.values()]
        fitting = [
            name
            for name in free
            if (known[name] in allowed if allowed else _of_joints(name, known, counted, joints))
        ]
        measured = not what.startswith("truth")
        beside = guessed.get("specific_force" if measured else "truth_position", "")
        column = _best(words, fitting, _one(beside), measured)
        if column is not None:
            guessed[what] = column
    return {what: series.get(str(column), column) for what, column in guessed.items()}


def numbered(widths: Mapping[str, int]) -> dict[str, list[str]]:
    """Return the columns of one number that count up from 0 or 1, by what their names share."""
    found: dict[str, dict[int, str]] = {}
    for name, width in widths.items():
        match = _NUMBERED.fullmatch(name)
        if match is not None and width == 1 and match["stem"]:
            found.setdefault(match["stem"] + match["rest"], {})[int(match["number"])] = name
    return {
        stem: [columns[k] for k in sorted(columns)]
        for stem, columns in found.items()
        if len(columns) > 1 and sorted(columns) == list(range(min(columns), min(columns) + len(columns)))
        and min(columns) in (0, 1) and stem not in widths
    }  # fmt: skip


def of_axes(widths: Mapping[str, int]) -> dict[str, list[str]]:
    """Return the columns of one number for x, y, z, and w where there is one, by what their names share."""
    found: dict[str, dict[str, str]] = {}
    for name, width in widths.items():
        for match in [match for form in _AXES if width == 1 and (match := form.fullmatch(name))]:
            stem = match[1].rstrip("_/.( ") + match[3]
            found.setdefault(stem, {})[match[2].lower()] = name
    return {
        stem: [columns[axis] for axis in "xyzw" if axis in columns]
        for stem, columns in found.items()
        if set("xyz") <= set(columns) and stem not in widths
    }


def _of_joints(
    name: str, widths: Mapping[str, int], series: Mapping[str, list[str]], joints: Collection[int]
) -> bool:
    """Tell whether a column may have a number for each joint."""
    if joints:
        return widths[name] in joints
    return widths[name] > 4 or name in series


def _best(words: Sequence[str], names: Iterable[str], beside: str, measured: bool) -> str | None:
    """Return the name that has one of some words: which it is, measured rather than computed, like the one beside it, by the first word."""
    ranked = []
    for order, name in enumerate(names):
        plain = name.lower().replace("/", ".")
        said = [
            k for k, word in enumerate(words) if (word in plain if len(word) > 2 else word == plain)
        ]
        if said:
            doubt, apart = doubt_of(name, beside)
            ranked.append(
                (name not in words, doubt if measured else 0, apart, said[0], order, name)
            )
    return min(ranked)[-1] if ranked else None


def graph_of(
    file: Path, robot: Path | None, guessed: Mapping[str, Guess], own_stamps: bool
) -> dict[str, Any]:
    """Return a graph that plays what was guessed, estimates the base where there is an IMU, and scores that
    where there is a truth."""
    played: dict[str, Any] = {"file": str(file)}
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
    if "imu" in played:
        blocks["estimator"] = {
            "use": "blocks.StateEstimator",
            "in": {
                "imu": "robot.imu",
                "joints": "robot.joints",
                "contacts": {"active": "robot.contacts.closed"},
            },
        }
    if "truth" in played and "estimator" in blocks:
        blocks["score"] = {
            "use": "blocks.EstimatorScore",
            "with": {"align": "start"},
            "in": {"truth": "robot.truth", "base": "estimator.base"},
        }
    return {"rate": "500 Hz", "robot": str(robot or "robot.yaml"), "blocks": blocks}
