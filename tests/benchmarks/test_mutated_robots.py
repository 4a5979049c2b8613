"""Descriptions that are made wrong: each kind of mistake changes something, and the counts are those of the cases."""

import random
from pathlib import Path

import pytest

from aloft.benchmarks import mutated_robots as module
from aloft.benchmarks.mutated_robots import KINDS, mutated_robots

URDF = b"""<robot name="x"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="a.stl"/></geometry></visual></link>
<link name="arm"><inertial><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0.5 1"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="2" effort="3" velocity="4"/></joint></robot>
"""


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_mistake_changes_something_and_repeats(kind: str) -> None:
    found = [KINDS[kind](random.Random(seed), URDF) for seed in range(5)]
    assert all(data != URDF for data in found) and any(found)
    assert found == [KINDS[kind](random.Random(seed), URDF) for seed in range(5)]


def test_without_the_package_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_file", lambda name, folder: None)
    assert [row.note for row in mutated_robots(1)] == ["pip install example-robot-data"]


@pytest.mark.long
def test_what_no_reader_could_accept_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "x.urdf"
    file.write_bytes(URDF)
    usual = module._said(file)
    for kind in (
        "the file is cut",
        "a link is there twice",
        "an element is misspelt",
        "a negative mass",
    ):
        for seed in range(3):
            data = KINDS[kind](random.Random(seed), URDF)
            assert data is not None
            outcome, said = module._outcome(tmp_path / "y.urdf", data, usual)
            assert (outcome, bool(said)) == ("reported", True), (kind, seed, said)
