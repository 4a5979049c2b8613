"""Where everything stands in a YAML file, and what is wrong with its YAML alone."""

from pathlib import Path

import pytest

from aloft.robots.placed_yaml import PlacedYaml
from aloft.robots.validation import RobotError, RobotFault

TEXT = """\
# a robot
name: hopper
links:
  - {name: body, mass: 2.0}
  - name: foot
    mass: 0.5
"""


def read(folder: Path, text: str) -> PlacedYaml:
    (folder / "robot.yaml").write_text(text)
    return PlacedYaml.read(folder / "robot.yaml")


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ((), (2, 1)), (("name",), (2, 7)), (("links",), (4, 3)), (("links", 0), (4, 5)),
        (("links", 0, "mass"), (4, 24)), (("links", 1, "mass"), (6, 11)), (("links", 1), (5, 5)),
        (("links", 2), (4, 3)), (("links", 1, "com"), (5, 5)), (("joints",), (0, 0)),
        (("name", "first"), (2, 7)),
    ],
)  # fmt: skip
def test_the_place_of_a_value_or_of_what_holds_it(
    tmp_path: Path, path: tuple[str | int, ...], place: tuple[int, int]
) -> None:
    placed = read(tmp_path, TEXT)
    assert placed.place(path) == place
    found = placed.placed(RobotFault(path, "wrong"))
    assert (found.line, found.column) == (place if place[0] else (2, 1))
    said = RobotFault(path, "wrong", line=9, column=3)
    assert placed.placed(said) is said


def test_what_a_file_holds(tmp_path: Path) -> None:
    placed = read(tmp_path, TEXT)
    assert placed.holds(()) and placed.holds(("links", 1, "mass"))
    for path in (("links", 2), ("joints",), ("name", "x"), ("links", "a")):
        assert not placed.holds(path)
    empty = read(tmp_path, "")
    assert empty.data is None and empty.place(()) == (0, 0)
    fault = empty.placed(RobotFault((), "nothing"))
    assert (fault.line, fault.column) == (0, 0)


def test_keys_that_stand_twice_are_faults_of_the_second(tmp_path: Path) -> None:
    placed = read(tmp_path, "name: a\nlinks:\n  - {mass: 1, mass: 2}\nname: b\n")
    assert [(fault.line, fault.column) for fault in placed.faults] == [(3, 15), (4, 1)]
    assert read(tmp_path, TEXT).faults == ()


def test_what_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(RobotError) as caught:
        read(tmp_path, "name: [1, 2\nlinks: {\n")
    (fault,) = caught.value.faults
    assert fault.message.startswith("this is no YAML: ") and fault.fix
    assert fault.line >= 2 and fault.column >= 1
    (tmp_path / "bytes.yaml").write_bytes(b"name: \xff\xfe")
    with pytest.raises(RobotError, match="is not UTF-8 text") as caught:
        PlacedYaml.read(tmp_path / "bytes.yaml")
    assert caught.value.faults[0].found.startswith("byte 0xff")
    with pytest.raises(RobotError, match=r"cannot read .*: No such file"):
        PlacedYaml.read(tmp_path / "nowhere.yaml")
