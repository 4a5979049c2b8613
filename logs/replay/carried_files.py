"""Gives a replay the files of the recorded run where they have changed or gone since.

A recording carries the files that parameters named and that blocks found, such as tasks and plans,
and the robot's description. Where the present ones are the same they are used. Else the recorded
ones are written to a folder of their own and the graph is made to name those.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import yaml

from ...robots.description import RobotDescription, RobotError, find_robot
from ..file.format import Header
from ..file.surroundings import named_file, unpacked

_ENTRY = re.compile(r"(?P<block>[^:/]+)\.(?P<parameter>\w+)(?P<kind>: |/)(?P<name>.*)", re.DOTALL)
_ROBOT = re.compile(r"^robot: .*$", re.MULTILINE)


@dataclass(frozen=True)
class Restored:
    """What was restored.

    Attributes:
        text: the graph's text, which names the restored description of the robot.
        overrides: by ``block.parameter``, the restored file or folder.
        said: what was restored and why, each in one sentence.
        entries: the entries of the restored files in ``Header.files``.
    """

    text: str
    overrides: Mapping[str, str]
    said: tuple[str, ...]
    entries: frozenset[str]


def restored(header: Header, text: str, graph_folder: Path, folder: Path) -> Restored:
    """Write the files that are other than they were, or are not there any more, to ``folder``.

    Args:
        header: the recording's header.
        text: the graph's text.
        graph_folder: the folder of the graph file, to which names are relative.
        folder: an empty folder.
    """
    overrides: dict[str, str] = {}
    said, entries = [], set()
    for entry, block, parameter, kind, name in _entries(header):
        content = unpacked(header.contents[header.files[entry]])
        found_in_folder = kind == "/"
        now = named_file(name, graph_folder)
        if now is not None and sha256(now.read_bytes()).hexdigest() == header.files[entry]:
            continue
        place = folder / f"{block}.{parameter}"
        _write(place / Path(name).name, content)
        overrides[f"{block}.{parameter}"] = str(
            place if found_in_folder else place / Path(name).name
        )
        entries.add(entry)
        if found_in_folder:
            said.append(f"the file {name} of {block} is taken from the recording")
            continue
        why = "is not there any more" if now is None else "has other content now"
        said.append(f"the file of {entry} {why}; the recorded one is used")
    robot = header.robot
    if robot is not None and _ROBOT.search(text) and not _is_present(robot, text, graph_folder):
        place = folder / f"{robot.name}.yaml"
        _write(place, yaml.safe_dump(robot.model_dump(mode="json"), sort_keys=False).encode())
        text = _ROBOT.sub(lambda _: f"robot: {place}", text, count=1)
        said.append(
            f"the description of the robot {robot.name} is not the recorded one any more, or is "
            "not there; the recorded one is used"
        )
    return Restored(text, overrides, tuple(said), frozenset(entries))


def _entries(header: Header) -> Iterator[tuple[str, str, str, str, str]]:
    """Entry, block, parameter, kind and name of each file that the recording carries."""
    for entry, digest in header.files.items():
        match = _ENTRY.fullmatch(entry)
        if match is not None and digest in header.contents:
            yield entry, match["block"], match["parameter"], match["kind"], match["name"]


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def _is_present(robot: RobotDescription, text: str, folder: Path) -> bool:
    """Whether the robot that the graph's text names is, in every value, the recorded one."""
    found = _ROBOT.search(text)
    assert found is not None
    name = str(yaml.safe_load(found[0])["robot"])
    try:
        now = find_robot(name, folder)
    except (LookupError, RobotError, OSError):
        return False
    if robot.profile in now.profiles:
        now = now.with_profile(robot.profile)
    return now.model_dump(mode="json") == robot.model_dump(mode="json")
