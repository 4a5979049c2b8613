"""Finds the description of a robot by name or file, reads it and checks it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files.document import read_file
from ..files.nodes import MapNode, plain
from ..files.problems import Code, Problem, Problems
from ..files.validation import locate
from .element import Vector3
from .importing.package_files import SCHEME, find_file, located, package_of
from .importing.xacro_text import XACRO
from .plausible_size import wrong_size
from .robot_description import (
    BASE_VELOCITIES,
    ActuatorProfile,
    Appearance,
    Box,
    ContactPoint,
    Foot,
    Joint,
    Link,
    Mesh,
    MotorRating,
    Motors,
    RobotDescription,
    Sensors,
    Thruster,
    Transmission,
    TurnedShape,
)
from .shapes import Capsule, Hull, Shape
from .validation import DescriptionError, RobotError, find_errors

if TYPE_CHECKING:
    from .comparison.differences import Differences
    from .importing.description_data import Imported


SHIPPED = Path(__file__).parent
MODEL_FILES = (".urdf", ".xml", ".mjcf", XACRO)
YAML_FILES = (".yaml", ".yml")
ROBOT_FILES = (*YAML_FILES, *MODEL_FILES)
"""The endings by which the name of a robot is taken for a file."""
OTHER_FORMATS = {
    ".sdf": "gz sdf has no way back to a URDF: export one from where this file came from",
}
"""Formats of robots that are not read, and what to do instead."""
DISTRIBUTIONS = {"example-robot-data": "example-robot-data"}
"""Distribution to install for a package of files, where their names differ."""
_KIND = ("a robot's description", "name, base, links, joints")


@dataclass(frozen=True)
class ReadRobot:
    """A robot that was read: its ``description``, the file it is from, the URDF or MJCF behind it
    if there is one, what that lacks or what was approximated in ``notes``, and how it compares with other programs' readings
    of that file."""

    description: RobotDescription
    path: Path
    model_file: Path | None = None
    notes: tuple[str, ...] = ()
    compared: tuple[Differences, ...] = ()


@dataclass(frozen=True)
class LocatedYaml:
    """A robot's YAML as plain ``data``, none where it is empty, with the line and column of every value,
    and the ``errors`` of the YAML alone."""

    data: Any
    tree: MapNode
    errors: tuple[DescriptionError, ...]

    @classmethod
    def read(cls, path: Path) -> LocatedYaml:
        """Return the file's content.

        Raises:
            RobotError: it cannot be read, is no text in UTF-8, no YAML or no mapping.
        """
        problems = Problems()
        tree = read_file(path, str(path), problems, _KIND, may_be_empty=True)
        errors = tuple(map(_yaml_error, problems.report(str(path)).problems))
        if tree is None:
            raise RobotError(str(path), errors)
        return cls(plain(tree) if tree.entries else None, tree, errors)

    def place(self, path: tuple[str | int, ...]) -> tuple[int, int]:
        """Return the line and column of the value at a path, or of the nearest thing that holds it; (0, 0) where the
        file holds nothing of it.
        """
        steps, node, _ = locate(self.tree, path)
        if not self.tree.entries or (path and not steps):
            return (0, 0)
        return node.where.line, node.where.column

    def holds(self, path: tuple[str | int, ...]) -> bool:
        """Check whether the file has an entry at that path."""
        return len(locate(self.tree, path)[0]) == len(path)

    def placed(self, description_error: DescriptionError) -> DescriptionError:
        """Return the same fault with its line and column."""
        if description_error.line:
            return description_error
        line, column = self.place(description_error.path)
        if not line and self.tree.entries:
            line, column = self.tree.where.line, self.tree.where.column
        return replace(description_error, line=line, column=column)


def _yaml_error(problem: Problem) -> DescriptionError:
    """Return a problem of the YAML as a fault of the robot."""
    where, message = problem.where, problem.message
    if problem.code is Code.YAML:
        message = f"this is no YAML: {message}"
    return DescriptionError(
        (), message, problem.expected, problem.found, problem.fix, where.line, where.column
    )


def path_of(name: str, folder: Path | None = None) -> Path:
    """Return the file that describes the robot called ``name``, ours or relative to ``folder``.

    Raises:
        LookupError: there is none; the message names the robots that there are.
    """
    if name.endswith((*ROBOT_FILES, *OTHER_FORMATS)):
        found = find_file(name, folder or Path())
        if found is None:
            where = name if name.startswith(SCHEME) else (folder or Path()) / name
            raise LookupError(f"no robot description at {where}")
        return found
    path = SHIPPED / name / f"{name}.yaml"
    if not path.is_file():
        raise LookupError(f"no robot called {name!r}; there is {', '.join(robot_names())}")
    return path


def find(name: str, folder: Path | None = None) -> RobotDescription:
    """Return the robot called ``name``; see ``description.find_robot``."""
    path = path_of(name, folder)
    return (_read_shipped(path) if path.is_relative_to(SHIPPED) else read(path)).description


@lru_cache(maxsize=16)
def _read_shipped(path: Path) -> ReadRobot:
    return read(path)


def read(path: Path) -> ReadRobot:
    """Return the robot that a YAML, URDF or MJCF file describes.

    A YAML of the same name beside a URDF or MJCF file adds what that lacks; a YAML with a key
    ``file`` adds to the file that it names. A URDF or MJCF file without a YAML gets what
    ``aloft robot import`` would guess, and ``notes`` say so.

    Raises:
        RobotError: the file cannot be read, or describes no robot; it carries every fault.
    """
    if path.suffix in OTHER_FORMATS:
        what = f"files in {path.suffix.removeprefix('.').upper()} are not read"
        description_error = DescriptionError(
            (), what, "a URDF, MJCF or YAML file", path.suffix, OTHER_FORMATS[path.suffix]
        )
        raise RobotError(str(path), [description_error])
    if path.suffix in MODEL_FILES:
        beside = next((p for s in YAML_FILES if (p := path.with_suffix(s)).is_file()), None)
        beside_text = LocatedYaml.read(beside) if beside else None
        if beside and beside_text and _is_graph(beside_text.data):
            raise _graph_beside(path, beside)
        return _read_model(path, beside, beside_text)
    text = LocatedYaml.read(path)
    if isinstance(text.data, dict) and "file" in text.data:
        return _read_model(_named_file(path, text), path, text)
    data = text.data
    _complete(data)
    errors = [*text.errors, *find_errors(data)]
    if errors:
        raise RobotError(
            str(path), [text.placed(description_error) for description_error in errors]
        )
    robot = _with_locations(RobotDescription.model_validate(data), path.parent)
    return ReadRobot(robot, path, notes=wrong_size(robot))


def _is_graph(data: object) -> bool:
    """Check whether a YAML is a graph, by keys that no robot's YAML has."""
    return isinstance(data, dict) and "blocks" in data and ("rate" in data or "robot" in data)


def _graph_beside(path: Path, graph: Path) -> RobotError:
    """Return the error of a robot's file that has a graph beside it where its own YAML is looked for."""
    message = (
        f"{graph.name} beside {path.name} is a graph, and its name is that of the robot's own YAML"
    )
    description_error = DescriptionError(
        (), message, f"a graph of another name than {path.stem}", graph.name,
        f"rename the graph, such as to run_{graph.name}", 1, 1,
    )  # fmt: skip
    return RobotError(str(graph), [description_error])


def _named_file(path: Path, text: LocatedYaml) -> Path:
    """Return the URDF or MJCF file that a YAML names. Raises ``RobotError`` where it is not there."""
    name = text.data["file"]
    if isinstance(name, str) and name.endswith(MODEL_FILES):
        found = find_file(name, path.parent)
        if found is not None:
            return found
    expected = (
        "the path of a URDF, xacro or MJCF file, from this file's folder or as package://NAME/PATH"
    )
    message, fix = f"there is no file {name}", ""
    if not isinstance(name, str) or not name.endswith(MODEL_FILES):
        message = f"file cannot be {name!r}"
    elif name.startswith(SCHEME):
        package = package_of(name)
        message = (
            f"there is no file {name}: no folder {package} is above this file, and no installed "
            "Python package brings it"
        )
        fix = f"pip install {DISTRIBUTIONS.get(package, package)}"
    description_error = DescriptionError(("file",), message, expected, str(name), fix)
    raise RobotError(str(path), [text.placed(description_error)])


def _read_model(path: Path, added: Path | None, text: LocatedYaml | None) -> ReadRobot:
    from .comparison.differences import unread
    from .importing.description_data import import_robot, written_path
    from .importing.fit_to_ground import fit_to_ground

    content = text.data if text is not None and text.data is not None else {}
    imported = import_robot(path, content)
    guessed: list[str] = []
    if text is None:
        from .importing.new_yaml import guess

        content, guessed = guess(imported)
        imported = import_robot(path, content, imported.model)
    errors = [*(text.errors if text else ()), *imported.errors]
    # A fault of the YAML's own keys also shows in what is made of them: once is enough.
    own = {description_error.path[:2] for description_error in errors}
    found = find_errors(imported.data)
    errors += [f for f in found if written_path(f, imported.data)[:2] not in own]
    if errors:
        placed = [_placed(description_error, imported, text) for description_error in errors]
        raise RobotError(str(added or path), placed)
    compared = tuple(imported.compared())
    robot = RobotDescription.model_validate(imported.data)
    robot = _with_locations(robot, (added or path).parent)
    robot, more = fit_to_ground(robot, "standing" in content, imported.model.pose)
    notes = (*guessed, *imported.notes, *more, *wrong_size(robot), *unread(compared))
    return ReadRobot(robot, added or path, path, notes, compared)


def _with_locations(robot: RobotDescription, folder: Path) -> RobotDescription:
    """Return the robot with meshes that are found from anywhere; a description in ``folder`` names them."""
    if not robot.looks:
        return robot
    looks = {
        link: look.model_copy(
            update={
                "meshes": tuple(
                    mesh.model_copy(update={"file": located(mesh.file, folder)})
                    for mesh in look.meshes
                )
            }
        )
        for link, look in robot.looks.items()
    }
    return robot.changed(looks=looks)


def _placed(
    description_error: DescriptionError, imported: Imported, added: LocatedYaml | None
) -> DescriptionError:
    """Return the fault with its place: in the YAML where that sets the value, else in the URDF or MJCF file."""
    from .importing.description_data import located_in_model, written_path

    path = written_path(description_error, imported.data)
    if added is not None and added.holds(path):
        return added.placed(replace(description_error, path=path))
    in_model = located_in_model(description_error, imported.data, imported.model)
    if added is None or in_model.line:
        return in_model
    return added.placed(replace(description_error, path=path))


def _complete(data: object) -> None:
    """Fill in what a description may leave out: one motor a joint, called as the joint."""
    if not isinstance(data, dict) or "transmission" in data:
        return
    joints = data.get("joints")
    if not isinstance(joints, list):
        return
    from .importing.description_data import own_motors

    names = [joint.get("name") if isinstance(joint, dict) else None for joint in joints]
    if all(isinstance(name, str) for name in names):
        data["transmission"] = own_motors([str(name) for name in names])


@lru_cache(maxsize=1)
def robot_names() -> tuple[str, ...]:
    """Return the names a graph may give after ``robot:``, sorted, after BRUCE.

    All files of BRUCE are in this package; those of most others come with ``example-robot-data``.
    """
    files = Path(__file__).parent.glob("*/*.yaml")
    names = (path.stem for path in files if path.stem == path.parent.name)
    return tuple(sorted(names, key=lambda name: (name != "bruce", name)))


__all__ = [
    "BASE_VELOCITIES",
    "ActuatorProfile",
    "Appearance",
    "Box",
    "Capsule",
    "ContactPoint",
    "DescriptionError",
    "Foot",
    "Hull",
    "Joint",
    "Link",
    "Mesh",
    "MotorRating",
    "Motors",
    "RobotDescription",
    "RobotError",
    "Sensors",
    "Shape",
    "Thruster",
    "Transmission",
    "TurnedShape",
    "Vector3",
    "find_robot",
    "read_description",
]


def find_robot(name: str, folder: str | Path | None = None) -> RobotDescription:
    """Return the description called ``name``: a shipped robot, or a file relative to ``folder`` or of an installed
    package, as ``package://NAME/PATH``.

    The file is a description in YAML, or a URDF or MJCF file with a short YAML of the same name
    beside it for what these formats lack, or such a YAML that names its URDF or MJCF ``file``.

    Raises:
        LookupError: there is none; the message names those that exist.
        RobotError: the file cannot be read, or describes no robot; it carries every fault.
    """
    return find(name, Path(folder) if folder is not None else None)


def read_description(path: Path) -> RobotDescription:
    """Return the robot that a file describes, of the kinds that ``find_robot`` takes.

    Raises:
        RobotError: the file cannot be read, or describes no robot; it carries every fault.
    """
    return read(path).description
