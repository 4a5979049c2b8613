"""Lost joints and masses that differ left and right are told of when a file is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from aloft.robots.description import read

JOINT = '<joint name="{name}_{joint}" axis="0 1 0" range="-1 1"/>'
ARM = """<body name="{name}_upper" pos="0 {y} 0">{shoulder}<geom size=".03" pos="0 0 -.1" mass="1"/>
<body name="{name}_fore" pos="0 0 -.2">{elbow}<geom size=".03" pos="0 0 -.1" mass="{mass}"/></body></body>"""


def notes(folder: Path, *, lost: str = "", mass: float = 0.5, head: str = "") -> list[str]:
    """Of a robot with two arms, the left one without the joint ``lost``, or with another ``mass`` of its forearm."""
    arms = []
    for name, y in (("left", 0.1), ("right", -0.1)):
        gone = lost if name == "left" else ""
        shoulder, elbow = (
            "" if joint == gone else JOINT.format(name=name, joint=joint)
            for joint in ("shoulder", "elbow")
        )
        kilograms = mass if name == "left" else 0.5
        arms.append(ARM.format(name=name, y=y, shoulder=shoulder, elbow=elbow, mass=kilograms))
    path = folder / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="torso"><freejoint/><geom size=".1" mass="5"/>'
        f"{''.join(arms)}{head}</body></worldbody></mujoco>"
    )
    return [
        note for note in read(path).notes if "left and right" in note or "bodies without" in note
    ]


def test_nothing_is_said_of_equal_arms(tmp_path: Path) -> None:
    assert notes(tmp_path) == []
    assert notes(tmp_path, mass=0.53) == []


@pytest.mark.parametrize(("joint", "body", "carrier", "kilograms"), [
    ("shoulder", "upper", "torso", "1"), ("elbow", "fore", "left_upper", "0.5"),
])  # fmt: skip
def test_a_lost_joint_is_told_of(
    joint: str, body: str, carrier: str, kilograms: str, tmp_path: Path
) -> None:
    differ = f"left_{body} has no joint and right_{body}, its mirror image, moves by right_{joint}"
    assert notes(tmp_path, lost=joint) == [
        f"left and right differ: {differ}; is a joint missing, or fixed?",
        f"bodies without a joint are part of what carries them: left_{body} ({kilograms} kg, part of {carrier})",
    ]


def test_another_mass_than_the_mirror_images_is_told_of(tmp_path: Path) -> None:
    assert notes(tmp_path, mass=500.0) == [
        "left and right differ: left_fore has 500 kg and right_fore, its mirror image, 0.5 kg"
    ]


def test_a_body_without_a_joint_has_no_need_of_a_mirror_image(tmp_path: Path) -> None:
    head = '<body name="head" pos="0 0 .2"><geom size=".05" mass="0.8"/></body>'
    assert notes(tmp_path, head=head) == [
        "bodies without a joint are part of what carries them: head (0.8 kg, part of torso)"
    ]


def test_a_robot_with_two_limbs_and_no_free_joint_is_said_to_be_bolted(tmp_path: Path) -> None:
    assert notes(tmp_path) == []
    path = tmp_path / "robot.xml"
    path.write_text(path.read_text().replace("<freejoint/>", ""))
    assert "torso has no free joint, so it is bolted to the world" in read(path).notes
