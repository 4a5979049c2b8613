"""Whatever is done to the files of a robot, reading ends with a robot or an exact report."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from tests.runtime.loading.test_mutations import mutated

from aloft.robots.description import RobotError, read

from .model_files import ARM, ONE_LEG

YAML = """\
file: arm.urdf
base_joint: fixed
joints: {elbow: {limits: [-1, 1]}}
links: {lower: {mass: 2}}
feet: [{name: tip, at: lower, ball: [0, 0, 0.4], radius: 0.02}]
profiles: {rated: {peak_torque: 30, rotor_inertia: 0.01, friction: 0.1, damping: 0.1}}
standing: {elbow: 0.5}
sensors: {imu: true, switches: true, wrist: {kind: force_torque, link: lower, position: [0, 0, 0.4]}}
"""
PIECES = (
    "<", ">", "/>", "</link>", '"', "=", "&lt;", "&", "<!--", "-->", " ", "\n", "0", "-1", "1e400", "nan", "inf",
    "1 2 3", "0 0 0", "1e-3", "lower", "upper", "base", "world", "elbow", "revolute", "fixed", "prismatic", "free",
    '<link name="a"/>', '<mimic joint="shoulder"/>', "<mass value=\"0\"/>", '<joint name="z" type="ball"/>',
    "<geom size=\".1\"/>", "<freejoint/>", "name", "{", "}", "[", "]", ": ", ", ", "- ", "null", "true", "é", "\x07",
)  # fmt: skip


@cache
def folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="aloft-robots-"))


def survives(name: str, **files: str) -> None:
    for stem, text in files.items():
        path = folder() / stem.replace("_", ".")
        path.write_text(text, encoding="utf-8")
    try:
        found = read(folder() / name)
    except RobotError as error:
        assert error.errors and all(fault.message for fault in error.errors)
        assert str(error).splitlines()[0].startswith(str(folder()))
    else:
        assert found.description.total_mass > 0.0


def test_the_files_are_good_before_they_are_mutated() -> None:
    survives("arm.yaml", arm_urdf=ARM, arm_yaml=YAML)
    assert read(folder() / "arm.yaml").description.joints[1].limits == (-1.0, 1.0)


@settings(max_examples=40, deadline=None)
@given(mutated(ARM, PIECES), mutated(YAML, PIECES))
def test_a_few_mutated_files(urdf: str, text: str) -> None:
    survives("arm.yaml", arm_urdf=urdf, arm_yaml=text)


@pytest.mark.long
@settings(max_examples=150, deadline=None)
@given(mutated(ARM, PIECES), mutated(YAML, PIECES))
def test_mutated_urdf_and_yaml(urdf: str, text: str) -> None:
    survives("arm.yaml", arm_urdf=urdf, arm_yaml=text)


@pytest.mark.long
@settings(max_examples=100, deadline=None)
@given(mutated(ONE_LEG, PIECES))
def test_mutated_mjcf(text: str) -> None:
    survives("leg.xml", leg_xml=text)
