"""Every robot file of dm_control, Gymnasium and ``example-robot-data``: what becomes of it, and how what is imported compares
with MuJoCo's own compile of the file and with Pinocchio's reading of it."""

from __future__ import annotations

import importlib.util
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...blocks.signals import CommandMode
from ...hal.simulated.mujoco_robot import MujocoRobot
from ...robots.comparison.differences import SAME
from ...robots.description import ReadRobot, RobotError, read
from ...robots.importing.package_files import find_file
from ...runtime.language.errors import AloftError
from ...runtime.testing.bench import BlockBench
from .rows import Row

ONE = "package://example-robot-data/robots/go2_description/urdf/go2.urdf"
FOLDERS = {"dm_control": ("suite",), "gymnasium": ("envs", "mujoco", "assets")}
"""Where the packages keep their MJCF files."""
SECOND = 500
"""Ticks of a second."""


def robot_files() -> list[Row]:
    """Read every file and return a row for each: its largest difference to either reading, as a share of what is compared,
    the kinds of differences on purpose, and what it does in a second of simulation with damped joints.

    The last rows count files that are equal or differ on purpose, and the kinds. Packages that are not installed have no
    rows; of dm_control the files alone are enough (``pip install --no-deps dm_control``).
    """
    kinds: Counter[str] = Counter()
    rows = [_row(path, name, kinds) for name, path in _files()]
    if not rows:
        return [
            Row(
                "robot_files",
                None,
                "",
                note="pip install example-robot-data gymnasium, and --no-deps dm_control",
            )
        ]
    differing = sum(row.note.startswith("differs") for row in rows)
    refused = sum(row.note.startswith("refused") for row in rows)
    counted = (
        f"{len(rows) - refused - differing} of {len(rows)} files equal or named, {refused} refused"
    )
    return [
        *rows,
        Row("files that differ", float(differing), "files", goal=0.0, note=counted),
        Row("kinds on purpose", float(len(kinds)), "kinds", goal=12.0,
            note="; ".join(f"{count} {kind}" for kind, count in kinds.most_common())),
    ]  # fmt: skip


def _files() -> Iterator[tuple[str, Path]]:
    """Yield the name and path of every file."""
    for package, inside in FOLDERS.items():
        found = importlib.util.find_spec(package)
        for folder in (found.submodule_search_locations or ()) if found else ():
            for path in sorted(Path(folder, *inside).glob("*.xml")):
                yield f"{package}/{path.name}", path
    one = find_file(ONE, Path())
    if one is not None:
        root = one.parents[2]
        for path in sorted(root.rglob("*.urdf")):
            yield str(path.relative_to(root)), path


def _row(path: Path, name: str, kinds: Counter[str]) -> Row:
    try:
        found = read(path)
    except RobotError as error:
        first = error.errors[0].message
        word = "differs" if "'s reading of the file" in first else "refused"
        return Row(name, None, "", note=f"{word}: {first}")
    named = dict.fromkeys(kind for each in found.compared for kind in each.named)
    kinds.update(named.keys())
    largest = max((each.largest for each in found.compared), default=0.0)
    robot = found.description
    differences = ", ".join(f"{each.judge} {each.largest:.0e}" for each in found.compared)
    said = f"{robot.total_mass:.3g} kg, {robot.base_joint}, {len(robot.joints)} joints, {len(robot.feet)} feet; {differences}; {_begins(found)}"
    why = f"; on purpose: {'; '.join(named)}" if named else ""
    return Row(name, largest, "", goal=None if named else SAME, note=said + why)


def _begins(found: ReadRobot) -> str:
    """Simulate a second with damped joints, standing where the robot stands, and return what happens."""
    for start, word in (
        ({}, "starts as described"),
        ({"start": {"stand": False}}, "starts with stand: false"),
    ):
        try:
            robot = BlockBench(MujocoRobot, start, robot=found.description)
        except AloftError as error:
            why = str(error).splitlines()[0]
            continue
        robot.set("command", mode=CommandMode.DAMPING)
        for _ in range(SECOND):
            robot.step()
        robot.block.emit()
        if not np.isfinite(robot.get("truth").com).all():
            return "its simulation diverges"
        return word
    return f"does not start: {why}"
