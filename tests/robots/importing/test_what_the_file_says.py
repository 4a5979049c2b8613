"""What runs is what MuJoCo makes of the file: the compiler's masses, held joints, actuators with several controls, key frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from aloft.robots.description import ReadRobot, read
from aloft.robots.importing.new_yaml import new_yaml
from aloft.robots.pinocchio_model import build_pinocchio_model

LEG = """<mujoco model="leg"><compiler angle="radian" {compiler}/><worldbody>
  <body name="trunk" pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass="5" diaginertia="0.05 0.05 0.05"/>
    <geom type="box" size="0.1 0.1 0.05"/>
    <body name="thigh" pos="0 0 -0.05"><joint name="hip" axis="0 1 0" range="-1 1"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03"/>
      <body name="shin" pos="0 0 -0.3"><joint name="knee" axis="0 1 0" range="-2 0"/>
        <inertial pos="0 0.01 -0.15" mass="0.2" diaginertia="0.001 0.002 0.0025" euler="0.3 0 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02"/></body></body></body></worldbody>
  <actuator><motor joint="hip" ctrlrange="-50 50"/><motor joint="knee" ctrlrange="-50 50"/></actuator></mujoco>"""
LINK = '<link name="{name}"><inertial><origin xyz="0.05 0 0"/><mass value="{mass}"/><inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>{more}</link>'
JOINT = '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="10"/>{more}</joint>'


def read_text(folder: Path, text: str) -> ReadRobot:
    path = folder / ("robot.urdf" if "<robot" in text else "robot.xml")
    path.write_text(text)
    return read(path)


@pytest.mark.parametrize("compiler", [
    'settotalmass="14"', 'boundmass="0.5"', 'boundinertia="0.01"', 'inertiafromgeom="true"', 'inertiafromgeom="false"',
    'boundmass="0.5" settotalmass="14" boundinertia="0.003"',
])  # fmt: skip
def test_masses_are_those_that_the_compiler_sets(compiler: str, tmp_path: Path) -> None:
    text = LEG.format(compiler=compiler)
    if compiler == 'inertiafromgeom="false"':  # the thigh needs one then
        text = text.replace(
            '-1 1"/>\n', '-1 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>\n'
        )
    theirs = mujoco.MjModel.from_xml_string(text)
    found = read_text(tmp_path, text)
    for link in found.description.links:
        k = theirs.body(link.name).id
        assert link.mass == pytest.approx(float(theirs.body_mass[k]), rel=1e-9)
        moments = np.linalg.eigvalsh([[link.inertia[0], *link.inertia[3:5]],
                                      [link.inertia[3], link.inertia[1], link.inertia[5]],
                                      [link.inertia[4], link.inertia[5], link.inertia[2]]])  # fmt: skip
        np.testing.assert_allclose(moments, np.sort(theirs.body_inertia[k]), rtol=1e-8)
    said = any("that MuJoCo's compiler sets, not the written ones" in note for note in found.notes)
    assert said == (compiler not in ('inertiafromgeom="true"', 'inertiafromgeom="false"'))


def test_the_case_of_settotalmass(tmp_path: Path) -> None:
    links = read_text(tmp_path, LEG.format(compiler='settotalmass="14"')).description.links
    assert sum(link.mass for link in links) == pytest.approx(14.0, rel=1e-9)


def test_a_urdf_tells_mujocos_compiler_too(tmp_path: Path) -> None:
    box = '<collision><geometry><box size="0.1 0.2 0.1"/></geometry></collision>'
    links = "".join(
        LINK.format(name=name, mass=mass, more=box) for name, mass in (("trunk", 5), ("thigh", 1))
    )
    text = (
        '<robot name="r"><mujoco><compiler {}/></mujoco>'
        + links + JOINT.format(name="hip", parent="trunk", child="thigh", more="") + "</robot>"
    )  # fmt: skip
    from_shapes = read_text(tmp_path, text.replace("{}", 'inertiafromgeom="true"')).description
    assert [link.mass for link in from_shapes.links] == pytest.approx([2.0, 2.0])
    total = read_text(tmp_path, text.replace("{}", 'settotalmass="12"')).description
    assert [link.mass for link in total.links] == pytest.approx([10.0, 2.0])


HELD = """<mujoco model="held"><compiler angle="radian"/><worldbody>
  <body name="trunk" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.05" mass="5"/>
    <body name="waist" pos="0 0 0.05"><joint name="waist" axis="0 1 0" range="-1 1"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.03" mass="1"/></body>
    <body name="thigh" pos="0 0 -0.05"><joint name="hip" axis="0 1 0" range="-1 1"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1"/>
      <body name="shin" pos="0 0 -0.3"><joint name="knee" axis="0 1 0" range="-2 2"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/></body></body></body></worldbody>
  <equality><joint joint1="waist" polycoef="0.6 0 0 0 0"/>
    <joint joint1="knee" joint2="hip" polycoef="0.5 -2 0 0 0"/></equality></mujoco>"""


def com_at_zero(found: ReadRobot) -> np.ndarray:
    model = build_pinocchio_model(found.description).model
    return np.asarray(pin.centerOfMass(model, model.createData(), pin.neutral(model)))


def test_held_joints_are_where_the_file_holds_them(tmp_path: Path) -> None:
    found = read_text(tmp_path, HELD)
    theirs = mujoco.MjModel.from_xml_string(HELD)
    data = mujoco.MjData(theirs)
    data.qpos[:] = [0, 0, 0, 1, 0, 0, 0, 0.6, 0.0, 0.5]
    mujoco.mj_forward(theirs, data)
    np.testing.assert_allclose(com_at_zero(found), data.subtree_com[0], atol=1e-9)
    assert {"joint waist is held in the file and is fixed at 0.6 here",
            "joint knee follows hip in the file and is fixed at 0.5 here"} <= {*found.notes}  # fmt: skip


def test_a_joint_that_follows_one_that_cannot_be_at_zero(tmp_path: Path) -> None:
    text = HELD.replace('"hip" axis="0 1 0" range="-1 1"', '"hip" axis="0 1 0" range="0.1 1"')
    assert (
        "joint knee follows hip in the file and is fixed at 0.3 here"
        in read_text(tmp_path, text).notes
    )
    key = '<keyframe><key qpos="0 0 1 1 0 0 0 0.6 0.2 0.1"/></keyframe></mujoco>'
    posed = read_text(tmp_path, text.replace("</mujoco>", key))
    assert "joint knee follows hip in the file and is fixed at 0.1 here" in posed.notes


def test_a_mimic_joint_is_at_its_offset(tmp_path: Path) -> None:
    links = "".join(
        LINK.format(name=n, mass=m, more="")
        for n, m in (("trunk", 5), ("thigh", 0.3), ("shin", 0.3))
    )
    knee = JOINT.format(
        name="knee",
        parent="thigh",
        child="shin",
        more='<mimic joint="hip" multiplier="-2" offset="0.3"/>',
    )
    text = f'<robot name="r">{links}{JOINT.format(name="hip", parent="trunk", child="thigh", more="")}{knee}</robot>'
    found = read_text(tmp_path, text)
    assert "joint knee mimics hip in the URDF and is fixed at 0.3 here" in found.notes
    theirs = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    q = pin.neutral(theirs)
    q[theirs.joints[theirs.getJointId("knee")].idx_q] = 0.3
    np.testing.assert_allclose(
        com_at_zero(found), pin.centerOfMass(theirs, theirs.createData(), q), atol=1e-9
    )


TWO = """<mujoco model="two"><compiler angle="radian"/><worldbody><site name="ref"/>
<body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" range="-1 1" {shoulder}/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass="1"/>
<body name="lower" pos="0 0 -.3"><joint name="elbow" axis="0 1 0" range="-1 1" {elbow}/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass="1"/>
<site name="tip"/></body></body></worldbody><actuator>{actuators}</actuator></mujoco>"""
PID = '<pid joint="shoulder" kp="50" kv="2" forcerange="-40 40" {}/><motor joint="elbow" ctrlrange="-7 7"/>'


@pytest.mark.parametrize(("actuators", "torques"), [
    ('<motor joint="elbow" ctrlrange="-7 7"/><motor joint="shoulder" ctrlrange="-40 40"/>', [40.0, 7.0]),
    (PID.format(""), [40.0, 7.0]),
    (PID.format('posrange="-1 1" velrange="-3 3"'), [40.0, 7.0]),
    ('<orientation site="tip" refsite="ref" kp="1"/><motor joint="shoulder" ctrlrange="-40 40"/><motor joint="elbow" ctrlrange="-1 1" gear="7"/>',
     [40.0, 7.0]),
    ('<motor joint="shoulder" ctrlrange="-60 60" forcerange="-40 40"/><motor joint="elbow" ctrlrange="-7 7" forcerange="-9 9"/>',
     [40.0, 7.0]),
])  # fmt: skip
def test_limits_are_those_of_the_joints_own_actuator(
    actuators: str, torques: list[float], tmp_path: Path
) -> None:
    found = read_text(tmp_path, TWO.format(actuators=actuators, shoulder="", elbow=""))
    assert found.description.motors.peak_torque.tolist() == torques
    assert not any("effort limit" in note for note in found.notes)


def test_the_velocity_range_of_a_pid_is_its_joints_speed(tmp_path: Path) -> None:
    text = TWO.format(
        actuators=PID.format('posrange="-1 1" velrange="-3 3"'), shoulder="", elbow=""
    )
    assert read_text(tmp_path, text).description.motors.no_load_speed[0] == 3.0


def test_the_written_yaml_keeps_each_joints_own_properties(tmp_path: Path) -> None:
    text = TWO.format(
        actuators='<motor joint="elbow" ctrlrange="-7 7"/><motor joint="shoulder" ctrlrange="-40 40"/>',
        shoulder='armature=".2" damping="1" frictionloss=".5"',
        elbow='armature=".01" damping=".1" frictionloss=".05"',
    )
    bare = read_text(tmp_path, text).description.motors
    (tmp_path / "robot.yaml").write_text(
        new_yaml(tmp_path / "robot.xml", tmp_path / "robot.yaml")[0]
    )
    written = read(tmp_path / "robot.yaml").description.motors
    for key in ("rotor_inertia", "damping", "friction", "peak_torque"):
        assert getattr(written, key).tolist() == getattr(bare, key).tolist()
    assert written.damping.tolist() == [1.0, 0.1] and written.friction.tolist() == [0.5, 0.05]


SITE = """<mujoco model="site">
  <asset><material name="marker" rgba="1 0 0 1"/><material name="cord" rgba="0 1 0 1"/></asset><worldbody>
    <body name="trunk" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.05" mass="5"/>
      <site name="a" material="marker" size="0.01"/>
      <body name="thigh" pos="0 0 -0.05"><joint name="hip" axis="0 1 0" range="-60 60"/><site name="b" pos="0 0 -0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1"/></body></body></worldbody>
  <tendon><spatial name="rope" material="cord"><site site="a"/><site site="b"/></spatial></tendon></mujoco>"""


def test_sites_and_tendons_may_have_a_material(tmp_path: Path) -> None:
    assert read_text(tmp_path, SITE).description.total_mass == pytest.approx(6.0)


def legs(more: str, size: str = "") -> str:
    leg = """<body name="thigh_{s}" pos="0 {y} -0.05"><joint name="hip_{s}" axis="0 1 0" range="-90 90"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1"/>
      <body name="shin_{s}" pos="0 0 -0.3"><joint name="knee_{s}" axis="0 1 0" range="2 160"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/></body></body>"""
    both = leg.format(s="l", y=0.1) + leg.format(s="r", y=-0.1)
    return f"""<mujoco model="legs"><compiler angle="degree"/>{size}<worldbody><body name="trunk" pos="0 0 1"><freejoint/>
      <geom type="box" size="0.1 0.15 0.05" mass="5"/>{both}</body></worldbody>{more}</mujoco>"""


@pytest.mark.parametrize(("more", "size"), [
    ("", '<size nkey="1"/>'),
    ('<keyframe><key ctrl=""/></keyframe>', ""),
    ('<keyframe><key name="home" qpos="0 0 1 1 0 0 0 -0.5 0.0349 -0.5 0.0349"/></keyframe>', ""),
    ('<keyframe><key qpos="0 0 1 1 0 0 0 0 0 0 0"/></keyframe>', ""),
])  # fmt: skip
def test_key_frames_of_nothing_or_rounded_are_no_faults(
    more: str, size: str, tmp_path: Path
) -> None:
    found = read_text(tmp_path, legs(more, size))
    standing = found.description.standing
    assert all(standing[f"knee_{side}"] >= np.radians(2.0) - 1e-9 for side in "lr")
    outside = [note for note in found.notes if note.startswith("the key frame is outside")]
    zeros = '0 0 0 0"' in more
    assert outside == (
        ["the key frame is outside joint limits, and the pose ends at them: knee_l at 0 for 0.0349066, knee_r at 0 for 0.0349066"]
        if zeros else []
    )  # fmt: skip


def test_a_thing_beside_the_robot_is_no_second_robot(tmp_path: Path) -> None:
    ball = '<body name="ball" pos="1 0 1"><freejoint/><geom size="0.1"/></body></worldbody>'
    found = read_text(tmp_path, HELD.replace("</worldbody>", ball))
    assert found.description.base == "trunk"
    assert "left out: bodies beside the robot: ball" in found.notes


def test_parts_whose_inertia_no_body_has_are_named(tmp_path: Path) -> None:
    links = "".join(
        LINK.format(name=name, mass=1, more="") for name in ("trunk", "thigh", "camera")
    )
    fixed = '<joint name="mount" type="fixed"><parent link="thigh"/><child link="camera"/></joint>'
    hip = JOINT.format(name="hip", parent="trunk", child="thigh", more="")
    text = f'<robot name="r">{links}{hip}{fixed}</robot>'
    assert not any("none that a body has" in note for note in read_text(tmp_path, text).notes)
    camera = text.index('name="camera"')
    odd = text[:camera] + text[camera:].replace('ixx="0.002"', 'ixx="0.005"', 1)
    assert (
        "inertias of camera, which no joint moves, are none that a body has; they count as they are written"
        in read_text(tmp_path, odd).notes
    )


def test_shapes_of_a_link_without_an_inertial_weigh_nothing_and_it_is_said(tmp_path: Path) -> None:
    box = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    links = "".join(LINK.format(name=name, mass=1, more=box) for name in ("trunk", "thigh"))
    fixed = '<joint name="mount" type="fixed"><parent link="thigh"/><child link="camera"/></joint>'
    hip = JOINT.format(name="hip", parent="trunk", child="thigh", more="")
    text = f'<robot name="r">{links}<link name="camera">{box}</link>{hip}{fixed}</robot>'
    found = read_text(tmp_path, text)
    assert found.description.total_mass == pytest.approx(2.0)
    assert (
        "links camera have shapes for collisions and no <inertial>: they weigh nothing here, and MuJoCo would weigh the shapes"
        in found.notes
    )


def test_a_joint_with_one_limit_has_zero_as_the_other(tmp_path: Path) -> None:
    links = "".join(LINK.format(name=name, mass=1, more="") for name in ("trunk", "thigh"))
    hip = JOINT.format(name="hip", parent="trunk", child="thigh", more="")
    hip = hip.replace('lower="-1" ', "")
    text = f'<robot name="r">{links}{hip}</robot>'
    found = read_text(tmp_path, text)
    assert found.description.joints[0].limits == (0.0, 1.0)
    assert (
        "joint hip has one limit in the URDF; the other is zero, as in the format: 0 to 1"
        in found.notes
    )


@pytest.mark.parametrize("declared", ["", '<link name="world"/>'])
def test_a_robot_that_hangs_from_the_world_is_fixed_declared_or_not(
    declared: str, tmp_path: Path
) -> None:
    links = "".join(LINK.format(name=name, mass=1, more="") for name in ("base", "arm"))
    weld = '<joint name="weld" type="fixed"><parent link="world"/><child link="base"/></joint>'
    hinge = JOINT.format(name="hinge", parent="base", child="arm", more="")
    found = read_text(tmp_path, f'<robot name="r">{declared}{links}{weld}{hinge}</robot>')
    assert found.description.base_joint == "fixed"
    assert [joint.name for joint in found.description.joints] == ["hinge"]
    said = any("which the URDF does not declare: it is the ground" in note for note in found.notes)
    assert said == (not declared)


def test_feet_are_guessed_on_the_same_place_of_both_legs(tmp_path: Path) -> None:
    def leg(side: str, y: float, parts: tuple[str, str]) -> str:
        links = "".join(
            LINK.format(name=f"{side}_{name}", mass=1, more="") for name in ("thigh", "shin")
        )
        hip = JOINT.format(name=f"{side}_hip", parent="trunk", child=f"{side}_thigh", more="")
        knee = JOINT.format(
            name=f"{side}_knee", parent=f"{side}_thigh", child=f"{side}_shin", more=""
        )
        text = links + hip.replace("0.1 0 0", f"0 {y} 0") + knee.replace("0.1 0 0", "0 0 -0.3")
        for part, x in ((part, {"front": 0.1, "rear": -0.05}[part]) for part in parts):
            text += LINK.format(name=f"{side}_foot_{part}", mass=0.1, more="")
            text += f'<joint name="{side}_{part}" type="fixed"><parent link="{side}_shin"/><child link="{side}_foot_{part}"/>'
            text += f'<origin xyz="{x} 0 -0.3"/></joint>'
        return text

    legs = leg("l", 0.1, ("front", "rear")) + leg("r", -0.1, ("rear", "front"))
    trunk = LINK.format(name="trunk", mass=5, more="")
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{trunk}{legs}</robot>')
    feet = {foot["at"] for foot in guessed_feet(path)}
    assert feet == {"l_foot_front", "r_foot_front"}


def guessed_feet(path: Path) -> list[dict[str, Any]]:
    import yaml

    return list(yaml.safe_load(new_yaml(path, path.with_suffix(".yaml")).text)["feet"])
