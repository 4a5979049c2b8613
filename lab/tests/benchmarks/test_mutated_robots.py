"""Descriptions that are made wrong: each kind of mistake changes something, and the counts are those of the cases."""

import random
from pathlib import Path

import pytest

from aloft.lab.benchmarks import mutated_robots as module
from aloft.lab.benchmarks.mistakes import MJCF, URDF, Change
from aloft.lab.benchmarks.mistakes_yaml import YAML
from aloft.lab.benchmarks.mutated_robots import Format, mutated_robots
from aloft.robots.description import find_robot

GOOD = b"""<robot name="x"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="a.stl"/></geometry></visual></link>
<link name="arm"><inertial><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0.5 1"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="2" effort="3" velocity="4"/></joint></robot>
"""


def each_changes_something(mistakes: dict[str, Change], good: bytes) -> None:
    for kind, mistake in mistakes.items():
        found = [mistake(random.Random(seed), good) for seed in range(5)]
        assert all(data != good for data in found) and any(found), kind
        assert found == [mistake(random.Random(seed), good) for seed in range(5)], kind


def test_each_kind_of_mistake_changes_something_and_repeats(tmp_path: Path) -> None:
    each_changes_something(URDF, GOOD)
    each_changes_something(MJCF, module._as_mjcf(find_robot("bruce")))
    (tmp_path / "x.urdf").write_bytes(GOOD)
    each_changes_something(YAML, module._as_yaml(find_robot("x.urdf", tmp_path)))


def test_without_the_package_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_file", lambda name, folder: None)
    assert [row.note for row in mutated_robots(1)] == ["pip install example-robot-data"]


@pytest.mark.long
def test_what_no_reader_could_accept_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "x.urdf"
    file.write_bytes(GOOD)
    usual = module._usual(file)
    for kind in (
        "the file is cut",
        "a link is there twice",
        "an element is misspelt",
        "a negative mass",
    ):
        for seed in range(3):
            data = URDF[kind](random.Random(seed), GOOD)
            assert data is not None
            outcome, said = module._outcome(tmp_path / "y.urdf", data, usual)
            assert (outcome, bool(said)) == ("reported", True), (kind, seed, said)


def test_the_cases_of_a_format_are_counted_by_kind() -> None:
    wrong = {"a mass of zero": YAML["a mass of zero"], "nothing": lambda draw, text: text}
    tried = Format({"bruce.yaml": module._as_yaml(find_robot("bruce"))}, wrong)
    examples: dict[str, str] = {}
    found = module._tried("YAML", tried, 4, 7, examples)
    assert found == {"a mass of zero": {"reported": 2}, "nothing": {"the same robot": 2}}
    assert examples["YAML: a mass of zero: reported"].startswith("seed 7, bruce.yaml: ")


GOOD_ROBOTS = {"x.urdf: parent and child swapped", "x.xml: a joint is lost"}
"""What leaves a good robot of two links that may be swapped, and that is bolted to the world without its free joint."""


def outcomes(folder: Path, count: int) -> dict[str, str]:
    """What becomes of ``count`` kinds of mistakes in a small robot in all three formats."""
    urdf = GOOD.replace(b' filename="a.stl"', b"").replace(b"mesh", b'box size="1 1 1"')
    (folder / "x.urdf").write_bytes(urdf)
    robot = find_robot("x.urdf", folder)
    tried = {
        "x.urdf": (URDF, urdf), "x.xml": (MJCF, module._as_mjcf(robot)),
        "x.yaml": (YAML, module._as_yaml(robot)),
    }  # fmt: skip
    found = {}
    for name, (mistakes, good) in tried.items():
        path = folder / name[2:] / name
        path.parent.mkdir()
        path.write_bytes(good)
        usual = module._usual(path)
        step = -(-len(mistakes) // count)
        for k, kind in enumerate([*mistakes][::step]):
            data = mistakes[kind](random.Random(k), good)
            if data is not None:
                found[f"{name}: {kind}"] = module._outcome(path, data, usual)[0]
    return found


def silent(found: dict[str, str]) -> set[str]:
    return {kind for kind, what in found.items() if what in ("accepted", "crash")} - GOOD_ROBOTS


def test_a_few_mistakes_of_each_format_are_not_accepted_without_a_word(tmp_path: Path) -> None:
    found = outcomes(tmp_path, 8)
    assert len(found) > 15 and not silent(found)


@pytest.mark.long
def test_no_kind_of_mistake_is_accepted_without_a_word(tmp_path: Path) -> None:
    found = outcomes(tmp_path, 100)
    assert len(found) > 80 and not silent(found)
