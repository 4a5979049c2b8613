"""Every fault of a description is found and reported exactly: place, expected, found, fix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.validation import RobotError, errors, find_errors

from .wrong_robots import WRONG_BODIES, Change, hopper
from .wrong_stances import WRONG_STANCES

WRONG = [*WRONG_BODIES, *WRONG_STANCES]


def changed(changes: list[Change]) -> dict[str, Any]:
    data = hopper()
    for path, value in changes:
        place: Any = data
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
    return data


def report(data: object, folder: Path) -> RobotError:
    (folder / "hopper.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(RobotError) as error:
        find_robot("hopper.yaml", folder)
    return error.value


@pytest.mark.parametrize(("changes", "lines"), WRONG, ids=[str(w[0][0][0]) for w in WRONG])
def test_every_wrong_robot_has_its_report(
    changes: list[Change], lines: list[str], tmp_path: Path
) -> None:
    error = report(changed(changes), tmp_path)
    assert str(error).replace(f"{tmp_path}/", "").splitlines()[:-1] == lines
    assert error.file == str(tmp_path / "hopper.yaml")
    assert len(error.errors) == sum(not line.startswith(" ") for line in lines)


def test_joints_are_listed_branch_by_branch(tmp_path: Path) -> None:
    data = hopper()
    data["joints"].reverse()
    text = str(report(data, tmp_path)).replace(f"{tmp_path}/", "")
    assert text.splitlines()[:3] == [
        "hopper.yaml:26:3: joint knee is listed where joint hip belongs: joints are listed branch by branch, each behind the joint that carries its parent",
        "    expected   the order hip, knee",
        "    found      the order knee, hip",
    ]


@pytest.mark.parametrize("data", [None, 3, [1, 2], "robot"])
def test_a_file_that_holds_no_mapping(data: object, tmp_path: Path) -> None:
    assert "a robot's description is a mapping" in str(report(data, tmp_path))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"name: a\nname: b\n", "hopper.yaml:2:1: key 'name' is there twice"),
        (b"name: [a\n", "hopper.yaml:1:9: this is no YAML: "),
        (b"name: gr\xf6sse\n", "hopper.yaml is not UTF-8 text"),
    ],
)
def test_a_file_that_is_no_yaml(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "hopper.yaml").write_bytes(content)
    with pytest.raises(RobotError) as error:
        find_robot("hopper.yaml", tmp_path)
    assert message in str(error.value)


def test_the_headline_counts(tmp_path: Path) -> None:
    error = report(changed([(("links", 0, "mass"), 0), (("base",), "bodi")]), tmp_path)
    count = len(error.errors)
    assert str(error).endswith(f"hopper.yaml: {count} errors in the robot's description")


def test_what_has_no_fault_can_be_read() -> None:
    assert find_errors(hopper()) == ()
    assert RobotDescription.model_validate(hopper()).name == "hopper"


def test_parts_of_what_has_no_fault_are_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    # As parts of the whole: to read each by itself makes pydantic's validator of every kind of part.
    def read(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(errors, "_read", read)
    assert find_errors(with_mesh()) == ()
    with pytest.raises(AssertionError):
        find_errors({**hopper(), "name": 3})


@pytest.mark.parametrize(
    ("data", "found"), [(None, "nothing"), ([1, 2], "a list"), ("bruce", "a str"), (3.5, "a float")]
)
def test_what_is_no_mapping_describes_no_robot(data: object, found: str) -> None:
    (fault,) = find_errors(data)
    assert fault.message == "this describes no robot" and fault.found == found


def with_mesh(link: str = "body", **values: list[float]) -> dict[str, Any]:
    """The hopper, one link of which is drawn as a mesh."""
    return hopper() | {"looks": {link: {"meshes": [{"file": "body.stl", **values}]}}}


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_mesh_may_be_turned_by_any_quaternion_but_zero(place: int, sign: float) -> None:
    orientation = [0.0] * 4
    (fault,) = find_errors(with_mesh(orientation=orientation))
    assert fault.path == ("looks", "body", "meshes", 0, "orientation")
    assert fault.fix == "orientation: [0, 0, 0, 1]"
    orientation[place] = sign
    assert find_errors(with_mesh(orientation=orientation)) == ()


@pytest.mark.parametrize(("key", "size"), [("position", 3), ("orientation", 4), ("scale", 3)])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_the_numbers_of_a_mesh_are_finite(key: str, size: int, value: float) -> None:
    for place in range(size):
        numbers = [1.0] * size
        numbers[place] = value
        (fault,) = find_errors(with_mesh(**{key: numbers}))
        assert fault.path == ("looks", "body", "meshes", 0)


def test_the_link_of_a_look_is_one_of_the_links() -> None:
    (fault,) = find_errors(with_mesh("bodi"))
    assert fault.path == ("looks", "bodi")
    assert find_errors(with_mesh()) == ()
