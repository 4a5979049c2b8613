"""What looks wrong with a description is named, each by its own rule, and a sound one has no remarks."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from aloft.robots.description import find_robot
from aloft.robots.robot_description import RobotDescription
from aloft.studies.check_up import (
    check_up,
    obstacles_to_jumping,
    standing_rows,
    with_stronger_motors,
)

from ..cli.conftest import run_for_json, run_here

BRUCE = find_robot("bruce")


def with_part(kind: str, name: str, **changes: Any) -> RobotDescription:
    """BRUCE with one link or joint that differs."""
    parts = [
        part.model_copy(update=changes) if part.name == name else part
        for part in getattr(BRUCE, kind)
    ]
    return BRUCE.changed(**{kind: tuple(parts)})


def calf(name: str) -> Any:
    return next(link for link in BRUCE.links if link.name == name)


def knee_from_its_limit(angle: float) -> RobotDescription:
    names = [joint.name for joint in BRUCE.joints]
    standing = float(BRUCE.standing_position[names.index("left_knee")])
    return with_part("joints", "left_knee", limits=(-2.1, standing + angle))


WRONG: dict[str, tuple[Callable[[], RobotDescription], str, str]] = {
    "a heavy link": (
        lambda: with_part("links", "left_calf", mass=20.0), "link left_calf", "% of the mass"),
    "a centre of mass outside": (
        lambda: with_part("links", "left_calf", com=(0.0, 0.5, 0.0)),
        "link left_calf", "centre of mass is 0.5"),
    "grams for kilograms": (
        lambda: with_part("links", "left_calf", inertia=(0.3, 0.4, 0.1, 0.0, 0.0, 0.0)),
        "link left_calf", "radius of gyration"),
    "an inertia about the joint": (
        lambda: with_part(
            "links", "left_calf", shapes=(), com=(0.0, 0.0, -0.1), mass=0.2, inertia=(0.0031, 0.0031, 0.0001, 0.0, 0.0, 0.0)
        ),
        "link left_calf", "radius of gyration 0.124 m about its centre of mass, which is 0.1 m from its joint"),
    "an axis that was measured": (
        lambda: with_part("joints", "left_knee", axis=(math.sin(0.02), -math.cos(0.02), 0.0)),
        "joint left_knee", "1.1 deg off a coordinate axis"),
    "no limits": (lambda: with_part("joints", "left_knee", limits=None), "joint left_knee", "no limits"),
    "more than a turn": (
        lambda: with_part("joints", "left_knee", limits=(-7.0, 7.0)), "joint left_knee", "range of 802 deg"),
    "a pose at a limit": (
        lambda: knee_from_its_limit(0.01), "joint left_knee", "stands 0.01 rad from its limit"),
    "feet that hang": (
        lambda: with_part("joints", "left_knee", axis=(0.0, 1.0, 0.0)),
        "the standing pose", "above the lowest one: left_toe by 174 mm"),
    "legs that differ": (
        lambda: with_part("links", "left_calf", mass=2.0 * calf("left_calf").mass),
        "the legs", "no mirror images"),
    "weak motors": (
        lambda: with_stronger_motors(BRUCE, 0.05), "motor left_knee_motor", "times its peak torque"),
    "slow motors": (
        lambda: with_stronger_motors(BRUCE, 1e-3), "motor left_knee_motor", "a bandwidth of"),
}  # fmt: skip


def test_a_sound_robot_has_no_remarks() -> None:
    assert check_up(BRUCE)["remarks"] == []
    assert obstacles_to_jumping(BRUCE) == []


@pytest.mark.parametrize("what", WRONG)
def test_each_rule_names_the_part_and_what_was_found(what: str) -> None:
    make, part, found = WRONG[what]
    remarks = check_up(make())["remarks"]
    assert any(r["part"] == part and found in r["found"] for r in remarks), remarks
    assert all(remark["usual"] for remark in remarks)


def test_standing_takes_what_half_the_weight_on_each_leg_does() -> None:
    rows = {row["motor"]: row for row in standing_rows(BRUCE)}
    left, right = rows["left_knee_motor"], rows["right_knee_motor"]
    assert left["standing_torque"] == pytest.approx(right["standing_torque"], rel=0.02)
    stronger = {row["motor"]: row for row in standing_rows(with_stronger_motors(BRUCE, 2.0))}
    doubled = stronger["left_knee_motor"]
    assert doubled["peak_torque"] == pytest.approx(2.0 * left["peak_torque"])
    assert doubled["standing_share"] == pytest.approx(0.5 * left["standing_share"])
    assert doubled["bandwidth_hz"] == pytest.approx(math.sqrt(2.0) * left["bandwidth_hz"])


@pytest.mark.parametrize(
    ("robot", "text"),
    [
        (lambda: BRUCE.changed(base_joint="fixed"), "its base is fixed: write base_joint: floating"),
        (lambda: BRUCE.changed(feet=(), contacts=()), "it has no feet: write them under feet"),
        (lambda: with_stronger_motors(BRUCE, 0.05), "it is too weak by a factor of"),
    ],
)  # fmt: skip
def test_what_keeps_a_robot_from_jumping_is_said(
    robot: Callable[[], RobotDescription], text: str
) -> None:
    assert any(text in each for each in obstacles_to_jumping(robot()))


def test_the_verb_prints_motors_and_what_it_found() -> None:
    text = run_here("robot", "check-up", "bruce").stdout
    assert "bruce, 5.118 kg" in text and "nothing looks wrong" in text
    found = run_for_json("robot", "check-up", "bruce")
    assert found["success"] and len(found["motors"]) == 10 and found["remarks"] == []
