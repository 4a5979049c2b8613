"""Files that are no robots, and YAMLs that do not fit their file: exact reports."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from aloft.robots.description import RobotError, find_robot, read
from aloft.robots.importing.new_yaml import new_yaml

from .model_files import ARM, INERTIAL

TWO_FREE = """<mujoco><worldbody>
<body name="a"><freejoint/><geom size=".1" mass="1"/></body>
<body name="b" pos="1 0 0"><freejoint/><geom size=".1" mass="1"/></body></worldbody></mujoco>"""
BALL = """<mujoco><worldbody><body name="a"><joint name="b" type="ball"/>
<geom size=".1" mass="1"/></body></worldbody></mujoco>"""
CLOSED = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/><geom size=".1" mass="1"/>
<body name="b" pos="0 0 .3"><joint name="k" axis="0 1 0"/><geom size=".1" mass="1"/></body></body>
</worldbody><equality><connect name="rod" body1="a" body2="b" anchor="0 0 0"/>
<connect body1="b" body2="a" anchor="0 0 0"/></equality></mujoco>"""
UNKNOWN_LINK = """<robot name="x">
<link name="a"/><link name="b"/>
<joint name="j" type="hinge"><parent link="a"/><child link="c"/><axis xyz="0 0 0"/></joint></robot>"""
TWO_ROOTS = '<robot name="x">\n<link name="a"/>\n<link name="b"/>\n</robot>'
MISSPELT = """<robot name="x">
<gazebo/><ros2_control/>
<link name="a"><inertila/><self_filter/></link>
<link name="b"><inertial><mass value="-2"/>
<inertia ixx="nan" ixy="0" ixz="0" iyy="1" iyz="0" izz="-1"/></inertial></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<limit loewr="-1" upper="1" effort="1" velocity="1" gear_velocity="3"/></joint></robot>"""
RING = """<robot name="x"><link name="a"/><link name="b"/>
<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>"""
BAD_JOINT = f"""<robot name="x">
<link name="a">{INERTIAL}</link>
<link name="b">{INERTIAL}</link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 0"/>
<limit lower="1" upper="-1" effort="1" velocity="1"/></joint></robot>"""

MODELS = [
    ("x.urdf", "<foo/>", [
        "x.urdf: this is neither a URDF nor an MJCF file",
        "    expected   the root element <robot> of a URDF or <mujoco> of an MJCF file",
        "    found      <foo>",
    ]),
    ("x.xml", '<?xml version="1.0" encoding="utf-16"?>\n<mujoco/>', [
        "x.xml: the file declares the encoding utf-16 and is in UTF-8", '    expected   encoding="utf-8"',
        "    found      utf-16",
    ]),
    ("x.xml", "hello", ["x.xml:1:1: this is no XML: syntax error"]),
    ("x.urdf", '<robot name="x"/>', [
        "x.urdf: the URDF has no links", "    expected   at least one <link>", "    found      none",
    ]),
    ("x.xml", TWO_FREE, [
        "x.xml: bodies a, b move freely: that is more than one robot", "    expected   one",
        "    found      a, b",
    ]),
    ("x.xml", BALL, [
        "x.xml: joints b are no hinges or slides, which a robot's are", "    expected   one axis each",
    ]),
    ("x.xml", "<mujoco><worldbody/></mujoco>", [
        "x.xml: the file holds no body besides the world", "    expected   at least one",
        "    found      none",
    ]),
    ("x.xml", "<mujoco><worldbdy/></mujoco>", [
        ("x.xml: MuJoCo cannot read this: XML Error: Schema violation: unrecognized element Element "
        "'worldbdy', line 1"),
    ]),
    ("x.urdf", UNKNOWN_LINK, [
        "x.urdf:3:1: joint j has no type that a URDF knows",
        "    expected   revolute, continuous, prismatic, fixed, floating, planar",
        "    found      'hinge'",
        "x.urdf:3:1: the child of joint j is 'c', and there is no such link",
        "    expected   a, b",
        "    found      'c'",
    ]),
    ("x.urdf", TWO_ROOTS, [
        "x.urdf:2:1: the links make no single tree: 2 have no parent",
        "    expected   one link that no joint carries",
        "    found      a, b",
    ]),
    ("x.urdf", MISSPELT, [
        "x.urdf:3:1: link a has <inertila>, which a URDF does not know",
        "    expected   <inertial>",
        "    found      <inertila>",
        "x.urdf:4:1: link b has a mass or an inertia that no body has",
        "    expected   finite numbers, none negative but ixy, ixz and iyz",
        "    found      ixx nan, izz -1, mass -2",
        "x.urdf:6:1: joint j has loewr= in <limit>, which a URDF does not know",
        "    expected   lower=",
        "    found      loewr= in <limit>",
    ]),
    ("x.urdf", RING, [
        "x.urdf:1:17: the links make no single tree: 0 have no parent",
        "    expected   one link that no joint carries",
        "    found      none",
    ]),
    ("x.urdf", BAD_JOINT, [
        "x.urdf:6:1: the axis of joint j is no direction",
        "    expected   three numbers that are not all zero",
        "    found      '0 0 0'",
        "x.urdf:6:1: the limits of joint j leave it no room or are reversed",
        "    expected   lower < upper",
        "    found      lower 1, upper -1",
    ]),
    ("x.urdf", ARM.replace('<mass value="1"/>', '<mass value="-1"/>'), [
        "x.urdf:3:3: link base has a mass or an inertia that no body has",
        "    expected   finite numbers, none negative but ixy, ixz and iyz",
        "    found      mass -1",
        "x.urdf:8:3: link upper has a mass or an inertia that no body has",
        "    expected   finite numbers, none negative but ixy, ixz and iyz",
        "    found      mass -1",
        "x.urdf:15:3: link lower has a mass or an inertia that no body has",
        "    expected   finite numbers, none negative but ixy, ixz and iyz",
        "    found      mass -1",
    ]),
    ("x.sdf", "<sdf/>", [
        "x.sdf: files in SDF are not read",
        "    expected   a URDF, MJCF or YAML file",
        "    found      .sdf",
        "    fix        gz sdf has no way back to a URDF: export one from where this file came from",
    ]),
    ("x.urdf", "", ["x.urdf: the file is empty", "    expected   a URDF or MJCF file"]),
    ("x.xml", CLOSED, [
        ("x.xml: the file closes loops, which a tree of links has not: rod (a and b), connect (b and "
        "a)"),
        "    expected   no equality of the kinds connect and weld",
        "    found      rod (a and b), connect (b and a)",
        "    fix        describe the mechanism by its transmission: transmission: {motors, joint_to_motor}",
    ]),
]  # fmt: skip

YAMLS = [
    ("feets: []", [
        "x.yaml:1:8: the robot has no key 'feets'",
        ("    expected   file, weld, name, text, base, base_joint, links, joints, feet, contacts, "
        "transmission, profiles, profile, sensors, standing, held, points, thrusters, supply, looks"),
        "    found      'feets'",
        "    fix        feet: []",
    ]),
    ("links: {loer: {mass: 1}}", [
        "x.yaml:1:15: the file has no link loer",
        "    expected   ground, upper, lower",
        "    found      loer",
        "    fix        lower",
    ]),
    ("joints: [elbow]", [
        "x.yaml:1:9: joints cannot be ['elbow']",
        "    expected   a mapping from the names in the file to what differs: joints: {NAME: ...}",
        "    found      ['elbow']",
    ]),
    ("joints: {elbow: {limits: [2, 1]}}", [
        "x.yaml:1:26: the limits of joint elbow are reversed",
        "    expected   [lower, upper] with lower < upper",
        "    found      [2, 1]",
        "    fix        limits: [1, 2]",
    ]),
    ("links: {lower: {inertia: [1, 0.1, 0.1, 0, 0, 0]}}", [
        ("x.yaml:1:26: link lower has an inertia that no body has: a principal moment is larger than "
        "the sum of the others"),
        "    expected   principal moments of which each is at most the sum of the others",
        "    found      [1, 0.1, 0.1, 0, 0, 0], with principal moments [0.1, 0.1, 1]",
    ]),
    ("weld: [wrist]", [
        "x.yaml:1:8: weld: the file has no joint wrist",
        "    expected   shoulder, elbow",
        "    found      wrist",
    ]),
    ("feet: [{name: tip, at: lowr, radius: 0.01}]", [
        "x.yaml:1:24: the file has no link 'lowr'",
        "    expected   ground, base, upper, lower",
        "    found      'lowr'",
        "    fix        lower",
    ]),
    ("feet: [{name: tip, at: lower, ball: [0, 0], radius: 0.01}]", [
        "x.yaml:1:37: a point cannot be [0, 0]",
        "    expected   [x, y, z] in m",
        "    found      [0, 0]",
    ]),
    ("feet: [{name: tip, at: lower, radius: -0.01}]", [
        "x.yaml:1:8: contact tip has a radius of -0.01 m",
        "    expected   a positive number of m: the rubber there is round",
        "    found      -0.01",
        "    fix        radius: 0.005",
    ]),
    ("standing: {elbow: 3}", [
        "x.yaml:1:19: standing: joint elbow is outside its limits",
        "    expected   a value in [-2, 2]",
        "    found      3",
        "    fix        elbow: 2",
    ]),
    ("base_joint: hanging", [
        "x.yaml:1:13: the robot: base_joint cannot be 'hanging'",
        "    expected   'floating', 'planar' or 'fixed'",
        "    found      'hanging'",
    ]),
    ("- elbow", [
        "x.yaml:1:1: a robot's description is a mapping",
        "    expected   keys such as name, base, links, joints",
        "    found      a list",
    ]),
]  # fmt: skip


def report(folder: Path, name: str) -> list[str]:
    with pytest.raises(RobotError) as error:
        find_robot(name, folder)
    return str(error.value).replace(f"{folder}/", "").splitlines()[:-1]


@pytest.mark.parametrize(("name", "content", "lines"), MODELS)
def test_a_model_file_that_is_wrong(
    name: str, content: str, lines: list[str], tmp_path: Path
) -> None:
    (tmp_path / name).write_text(content)
    assert report(tmp_path, name) == lines


@pytest.mark.parametrize(("content", "lines"), YAMLS)
def test_a_yaml_that_does_not_fit(content: str, lines: list[str], tmp_path: Path) -> None:
    (tmp_path / "x.urdf").write_text(ARM)
    (tmp_path / "x.yaml").write_text(content)
    assert report(tmp_path, "x.urdf") == lines


def test_a_package_that_is_not_installed(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text("file: package://some-robots/x.urdf\n")
    assert report(tmp_path, "x.yaml") == [
        (
            "x.yaml:1:7: there is no file package://some-robots/x.urdf: no folder some-robots is above "
            "this file, and no installed Python package brings it"
        ),
        (
            "    expected   the path of a URDF, xacro or MJCF file, from this file's folder or as "
            "package://NAME/PATH"
        ),
        "    found      package://some-robots/x.urdf",
        "    fix        pip install some-robots",
    ]


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text("file: nowhere.urdf\n")
    assert report(tmp_path, "x.yaml")[0] == "x.yaml:1:7: there is no file nowhere.urdf"
    with pytest.raises(LookupError, match=r"no robot description at .*nowhere\.urdf"):
        find_robot("nowhere.urdf", tmp_path)


LINKS = "".join(f'<link name="{name}">{INERTIAL}</link>' for name in ("foot", "trunk", "leg"))
HIP = (
    '<joint name="hip" type="revolute"><parent link="trunk"/><child link="leg"/><origin rpy="{rpy}"/><axis xyz="0 1 0"/>'
    '<limit lower="{lower}" upper="{upper}" effort="9" velocity="9"/></joint>'
)
FREE = '<joint name="free" type="floating"><parent link="foot"/><child link="trunk"/></joint>'
FIXED = '<joint name="free" type="fixed"><parent link="foot"/><child link="trunk"/></joint>'


def refusal(folder: Path, text: str, name: str = "robot.urdf") -> str:
    (folder / name).write_text(text)
    with pytest.raises(RobotError) as refused:
        read(folder / name)
    return str(refused.value)


def test_a_floating_joint_below_another_body(tmp_path: Path) -> None:
    said = refusal(
        tmp_path,
        f'<robot name="r">{LINKS}{FREE}{HIP.format(rpy="0 0 0", lower=-1, upper=1)}</robot>',
    )
    assert "a floating joint holds a body to another body: free of trunk on foot" in said
    assert '<link name="world"/> as the parent of free in place of foot' in said
    inner = '<mujoco><worldbody><body name="a"><geom size="1"/><body name="b"><freejoint/><geom size="1"/></body></body></worldbody></mujoco>'
    assert "b_joint of b on a" in refusal(tmp_path, inner, "robot.xml")


def test_angles_that_look_like_degrees(tmp_path: Path) -> None:
    said = refusal(
        tmp_path,
        f'<robot name="r">{LINKS}{FIXED}{HIP.format(rpy="0 90 0", lower=-1, upper=1)}</robot>',
    )
    assert "joint hip has angles that look like degrees, and a URDF's are radians" in said
    assert 'rpy="0 1.57079633 0"' in said
    (tmp_path / "robot.urdf").write_text(
        f'<robot name="r">{LINKS}{FIXED}{HIP.format(rpy="0 3.14159 0", lower=-90, upper=90)}</robot>'
    )
    assert any(
        'limits of joint hip look like degrees, lower="-90" upper="90"' in note and 'lower="-1.57079633" upper="1.57079633"' in note
        for note in read(tmp_path / "robot.urdf").notes
    )  # fmt: skip


def test_a_graph_that_is_called_as_the_robots_file(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("rate: 500 Hz\nrobot: robot.urdf\nblocks: {}\n")
    said = refusal(
        tmp_path,
        f'<robot name="r">{LINKS}{FIXED}{HIP.format(rpy="0 0 0", lower=-1, upper=1)}</robot>',
    )
    assert (
        "robot.yaml beside robot.urdf is a graph" in said
        and "rename the graph, such as to run_robot.yaml" in said
    )


def test_links_and_joints_may_be_called_by_numbers(tmp_path: Path) -> None:
    numbered = f'<robot name="7">{LINKS}{FIXED}{HIP.format(rpy="0 0 0", lower=-1, upper=1)}</robot>'
    for name, number in (("trunk", "1"), ("leg", "02"), ("hip", "3")):
        numbered = numbered.replace(f'"{name}"', f'"{number}"')
    (tmp_path / "robot.urdf").write_text(numbered)
    added = {
        "weld": [3], "feet": [{"name": "tip", "at": "02", "radius": 0.02}], "points": {"top": [1, [0, 0, 0]]},
        "thrusters": {"fan": {"link": 1, "max_thrust": 3}},
    }  # fmt: skip
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump({"file": "robot.urdf", **added}))
    robot = read(tmp_path / "mine.yaml").description
    assert not robot.joints and robot.feet[0].name == "tip"
    written = new_yaml(tmp_path / "robot.urdf", tmp_path / "robot.yaml").text
    (tmp_path / "robot.yaml").write_text(written)
    assert [joint.name for joint in read(tmp_path / "robot.yaml").description.joints] == ["3"]


@pytest.mark.parametrize("value", ["nan", "inf"])
def test_an_inertia_that_is_no_number_in_mjcf(value: str, tmp_path: Path) -> None:
    joints = '<joint name="a" axis="0 1 0"/><joint name="b" axis="1 0 0"/>'
    inertial = f'<inertial pos="0 0 0" mass="1" diaginertia="{value} 1 1"/>'
    text = f'<mujoco><worldbody><body name="x">{joints}{inertial}</body></worldbody></mujoco>'
    refusal(tmp_path, text, "robot.xml")
