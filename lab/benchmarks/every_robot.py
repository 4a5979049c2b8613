"""Every URDF of the Python package ``example-robot-data``: is it read and imported, what is guessed, does it stand."""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from pathlib import Path

from ...planner.library.library import shipped_folder
from ...robots.description import ReadRobot, RobotError, read
from ...robots.importing.new_yaml import new_yaml
from ...robots.importing.package_files import find_file
from ...robots.report import report
from ...runtime.graph import load
from ...runtime.language.errors import AloftError
from ...studies.check_up import check_up, obstacles_to_jumping
from .rows import Row

ONE = "package://example-robot-data/robots/go2_description/urdf/go2.urdf"
SETTINGS = ("push.speed_change=0 m/s",)


def every_robot() -> list[Row]:
    """Read every file and return a row for each: its joints, or none where it is refused, and the
    outcome.

    A robot with feet that floats is put on the ground as a file without a YAML is read, and stands in the
    robust trial for 3.5 s or until the score has judged it. The time is the processor's for reading the file. The YAML that
    ``aloft robot import`` would write is read, too; where it is refused the row says why.
    """
    one = find_file(ONE, Path())
    if one is None:
        return [Row("every_robot", None, "", note="pip install example-robot-data")]
    root = one.parents[2]
    rows = [_row(path, str(path.relative_to(root))) for path in sorted(root.rglob("*.urdf"))]
    found = Counter(row.note.partition(":")[0] for row in rows)
    counts = ", ".join(f"{count} {kind}" for kind, count in found.items())
    return [*rows, Row("all of them", float(len(rows)), "files", note=counts)]


def _row(path: Path, name: str) -> Row:
    start = time.process_time()
    try:
        found = read(path)
    except RobotError as error:
        description_error = error.errors[0]
        more = f" (and {len(error.errors) - 1} more)" if len(error.errors) > 1 else ""
        return Row(name, None, "joints", note=f"refused: {description_error.message}{more}")
    took = time.process_time() - start
    robot = found.description
    said = f"{robot.total_mass:.3g} kg, {len(robot.feet)} feet, read in {took:.1f} s"
    refused = _import(path)
    more = f"; its imported YAML is refused: {refused}" if refused else ""
    return Row(name, float(len(robot.joints)), "joints", note=f"{_standing(found)}; {said}{more}")


def _import(path: Path) -> str:
    """Import a file and return the error of the YAML that this writes; empty where it is read and
    shown."""
    with tempfile.TemporaryDirectory(prefix="aloft-import-") as folder:
        target = Path(folder) / "robot.yaml"
        target.write_text(new_yaml(path, target)[0], encoding="utf-8")
        try:
            report(read(target))
        except RobotError as error:
            return error.errors[0].message
    return ""


def _standing(found: ReadRobot) -> str:
    """Make a robot stand and return the verdict with its reason."""
    robot = found.description
    if robot.base_joint != "floating":
        return f"read: {robot.base_joint} base"
    if not robot.contacts:
        return "read: no feet"
    if not robot.standing or any("no standing pose was found" in note for note in found.notes):
        return "read: no standing pose was found"
    obstacles = obstacles_to_jumping(robot)
    if obstacles:
        return f"does not stand: {obstacles[0]}"
    try:
        unusual = len(check_up(robot)["remarks"])
        settings = [f"robot={str(found.path)!r}", *SETTINGS]
        run = load(shipped_folder() / "robots" / "stand.yaml", settings).run()
    except AloftError as error:
        why = str(error).splitlines()[0].rpartition(": ")[2].partition(" (at ")[0]
        return f"does not stand: {why}"
    verdict = "stands" if run.success else "does not stand"
    return f"{verdict}: {run.reason}, {unusual} remarks of check-up"
