"""Real robot descriptions with one thing made wrong: is it reported, does it work all the same, does it crash.

Each case takes a URDF of the package ``example-robot-data``, the same robot as an MJCF file that MuJoCo writes, or as a
description in YAML, and makes one seeded change, such as a person or a converter makes (``mistakes``).
It is read as ``aloft robot show``, ``import`` and ``check-up`` read it: where a URDF or MJCF file is accepted, the short
YAML is written beside it and both are read once more.
"""

from __future__ import annotations

import random
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from ...hal.simulated.mujoco_model import mujoco_spec
from ...robots.description import (
    SHIPPED,
    YAML_FILES,
    ReadRobot,
    RobotDescription,
    RobotError,
    find_robot,
    read,
)
from ...robots.importing.new_yaml import new_yaml
from ...robots.importing.package_files import find_file
from ...robots.report import report
from ...robots.surfaces import missing_meshes
from ...runtime.language.errors import AloftError
from ...studies.check_up import check_up
from .mistakes import MJCF, URDF, Change
from .mistakes_yaml import YAML, as_yaml
from .rows import Row

PACKAGE = "package://example-robot-data/robots/"
FILES = (
    "solo_description/robots/solo12.urdf", "a1_description/urdf/a1.urdf", "bolt_description/robots/bolt.urdf",
    "ur_description/urdf/ur5_robot.urdf", "iris_description/robots/iris.urdf",
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf", "hyq_description/robots/hyq_no_sensors.urdf",
    "panda_description/urdf/panda.urdf",
)  # fmt: skip


@dataclass(frozen=True)
class Format:
    """A kind of files: the content of good ones by name, and the mistakes made in them."""

    files: Mapping[str, bytes]
    mistakes: Mapping[str, Change]


def formats() -> dict[str, Format]:
    """Return the formats by name; none without the package of robots."""
    paths = [path for name in FILES if (path := find_file(PACKAGE + name, Path())) is not None]
    if not paths:
        return {}
    robots = {path.stem: find_robot(str(path)) for path in paths}
    robots = {"bruce": find_robot("bruce"), **robots}
    yaml = {f"{name}.yaml": _as_yaml(robot) for name, robot in robots.items()}
    return {
        "URDF": Format({path.name: path.read_bytes() for path in paths}, URDF),
        "MJCF": Format({f"{name}.xml": _as_mjcf(robot) for name, robot in robots.items()}, MJCF),
        "YAML": Format({**yaml, "as_written.yaml": (SHIPPED / "bruce/bruce.yaml").read_bytes()}, YAML),
    }  # fmt: skip


def _as_mjcf(robot: RobotDescription) -> bytes:
    """Write the robot as MuJoCo does, with its torques as force ranges."""
    spec = mujoco_spec(robot)
    motors = robot.motors.peak_torque @ abs(robot.joint_to_motor)
    for actuator, most in zip(spec.actuators, motors.tolist(), strict=False):
        actuator.forcerange = (-most, most)
    spec.compile()
    text: str = spec.to_xml()
    return text.encode()


def _as_yaml(robot: RobotDescription) -> bytes:
    return as_yaml(robot.model_dump(mode="json", context={"looks": True}))


def mutated_robots(count: int = 500, seed: int = 9000) -> list[Row]:
    """Measure a row for each kind of mistake in each format: the number of its cases, and their
    outcomes.

    Args:
        count: the cases of all kinds together, in each format.
        seed: of the first case of a format; each has the next.
    """
    tried = formats()
    if not tried:
        return [Row("mutated_robots", None, "", note="pip install example-robot-data")]
    rows, examples, whole = list[Row](), dict[str, str](), Counter[str]()
    for name, each in tried.items():
        found = _tried(name, each, count, seed, examples)
        both = sum(found.values(), Counter())
        rows += [
            Row(f"{name}: {kind}", float(sum(c.values())), "cases", note=_counted(c))
            for kind, c in found.items()
        ]
        rows.append(Row(f"{name}: all of them", float(count), "cases", note=_counted(both)))
        whole += both
    rows.append(Row("crashes", float(whole["crash"]), "cases", goal=0.0, note=""))
    return [
        *rows,
        *(Row(f"example of {name}", None, "", note=said) for name, said in examples.items()),
    ]


def _tried(
    name: str, tried: Format, count: int, seed: int, examples: dict[str, str]
) -> dict[str, Counter[str]]:
    """Count the outcomes of the cases of a format, by kind of mistake; the first of each is written
    to ``examples``."""
    found: dict[str, Counter[str]] = {kind: Counter() for kind in tried.mistakes}
    kinds, files = list(tried.mistakes), list(tried.files)
    with tempfile.TemporaryDirectory(prefix="aloft-mutated-") as folder:
        usual: dict[str, Usual] = {}
        for number in range(count):
            draw = random.Random(seed + number)
            kind = kinds[number % len(kinds)]
            file = draw.choice(files)
            path = Path(folder) / file
            if file not in usual:
                _write(path, tried.files[file])
                usual[file] = _usual(path)
            data = tried.mistakes[kind](draw, tried.files[file])
            if data is None:
                found[kind]["nothing to change"] += 1
                continue
            outcome, said = _outcome(path, data, usual[file])
            found[kind][outcome] += 1
            examples.setdefault(
                f"{name}: {kind}: {outcome}", f"seed {seed + number}, {file}: {said}"
            )
    return found


def _counted(counter: Counter[str]) -> str:
    return ", ".join(f"{count} {what}" for what, count in sorted(counter.items()))


class Usual(NamedTuple):
    """What is read of a file before it is made wrong: the remarks, and the robot without what is only read or seen."""

    said: frozenset[str]
    robot: RobotDescription


def _usual(path: Path) -> Usual:
    """Read a good file."""
    found = read(path)
    return Usual(frozenset(_said_of(found)), _robot(found))


def _robot(found: ReadRobot) -> RobotDescription:
    return found.description.model_copy(update={"text": "", "looks": {}})


def _said_of(found: ReadRobot) -> set[str]:
    """Collect the notes of the import, the remarks of the check-up, and the meshes that are
    missing."""
    try:
        remarks = [
            f"{each['part']}: {each['found']}" for each in check_up(found.description)["remarks"]
        ]
    except AloftError as error:
        remarks = [str(error)]
    return {*found.notes, *missing_meshes(found.description), *remarks}


def _outcome(path: Path, data: bytes, usual: Usual) -> tuple[str, str]:
    """Return the outcome of reading a file, and the remark that decided it."""
    _write(path, data)
    try:
        found = read(path)
        report(found)
        if path.suffix not in YAML_FILES:
            beside = path.with_suffix(".yaml")
            beside.write_text(new_yaml(path, beside)[0], encoding="utf-8")
            report(read(beside))
    except RobotError as error:
        return "reported", error.errors[0].message
    except Exception as error:  # noqa: BLE001  # this is what is looked for
        return "crash", f"{type(error).__name__}: {error}"
    more = sorted(_said_of(found) - usual.said)
    if more:
        return "accepted and said", more[0]
    return ("the same robot" if _robot(found) == usual.robot else "accepted"), ""


def _write(path: Path, data: bytes) -> None:
    """Write a file, with no short YAML beside it."""
    path.with_suffix(".yaml").unlink(missing_ok=True)
    path.write_bytes(data)
