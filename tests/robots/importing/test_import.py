"""URDF and MJCF files become descriptions: bases, joints, motors, shapes, poses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml

from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.robots.description import RobotDescription, find_robot, read
from aloft.robots.importing.new_yaml import new_yaml
from aloft.robots.importing.package_files import find_file

from ..example_robots import PACKAGE, needs_robots
from .model_files import ARM, CART_POLE, DRONE, INERTIAL, ONE_LEG, PLANAR, SPHERICAL_HIP


def robot_of(folder: Path, content: str, added: dict[str, Any] | None = None) -> RobotDescription:
    """The robot of a model file, with what a YAML beside it adds."""
    name = "robot.urdf" if "<robot" in content else "robot.xml"
    (folder / name).write_text(content)
    if added is not None:
        (folder / "robot.yaml").write_text(yaml.safe_dump(added))
    return find_robot(name, folder)


@pytest.mark.parametrize("content", [CART_POLE, ONE_LEG, PLANAR])
def test_dynamics_are_those_of_the_mjcf_file(content: str, tmp_path: Path) -> None:
    robot = robot_of(tmp_path, content)
    theirs, ours = mujoco.MjModel.from_xml_string(content), build_mujoco_model(robot)
    assert theirs.nv == ours.nv == robot.dimensions["n_velocities"]
    count, random = len(robot.joints), np.random.default_rng(0)
    for _ in range(3):
        datas = mujoco.MjData(theirs), mujoco.MjData(ours)
        position, velocity = random.normal(size=count), random.normal(size=ours.nv)
        masses = []
        for model, data in zip((theirs, ours), datas, strict=True):
            data.qpos[-count:], data.qvel[:] = position, velocity
            mujoco.mj_forward(model, data)
            masses.append(np.zeros((ours.nv, ours.nv)))
            mujoco.mj_fullM(model, data, masses[-1])
        np.testing.assert_allclose(masses[1], masses[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(datas[1].qfrc_bias, datas[0].qfrc_bias, rtol=0, atol=1e-9)


def test_a_cart_pole(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, CART_POLE)
    assert (robot.name, robot.base, robot.base_joint) == ("cartpole", "ground", "fixed")
    assert [(j.name, j.kind, j.limits) for j in robot.joints] == [
        ("slider", "slide", (-1.0, 1.0)),
        ("hinge", "hinge", None),
    ]
    assert robot.total_mass == pytest.approx(1.2)
    # The hinge has no motor.
    assert robot.motors.peak_torque.tolist() == [10.0, 0.0]
    assert robot.motors.damping.tolist() == [0.1, 0.0]
    assert not robot.sensors.imu and not robot.sensors.switches


def test_a_leg_with_motors_a_key_frame_and_a_reference(tmp_path: Path) -> None:
    foot = {"name": "foot", "at": "foot", "radius": 0.035}
    robot = robot_of(tmp_path, ONE_LEG, {"feet": [foot], "standing": {"hip": 0.2, "knee": 0.3}})
    assert robot.base_joint == "floating" and [link.name for link in robot.links] == [
        "torso", "leg", "shank",
    ]  # fmt: skip
    assert robot.motors.peak_torque.tolist() == [50.0, 40.0]
    assert robot.motors.rotor_inertia.tolist() == [0.01, 0.0]
    assert robot.motors.friction.tolist() == [0.0, 0.3]
    assert robot.joints[0].origin == pytest.approx((0.0, 0.0, -0.08))
    # The knee's zero is not where the file draws it; 20 degrees are taken off.
    assert robot.joints[1].limits == pytest.approx((0.0, np.radians(120.0)))
    centre = np.add(robot.contacts[0].position, (0.0, 0.0, 0.035))
    assert centre == pytest.approx((0.0, 0.0, -0.4))
    assert read(tmp_path / "robot.xml").description.standing == {"hip": 0.2, "knee": 0.3}


def test_the_key_frame_is_the_pose_where_nobody_says_another(tmp_path: Path) -> None:
    assert robot_of(tmp_path, ONE_LEG, {"feet": []}).standing == {"hip": 0.2, "knee": 0.3}


def test_a_planar_base(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, PLANAR)
    assert robot.base_joint == "planar" and [joint.name for joint in robot.joints] == ["hip"]


def test_several_joints_at_one_body_become_links_with_little_mass(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, SPHERICAL_HIP)
    assert [(j.parent, j.child) for j in robot.joints] == [("torso", "leg_1"), ("leg_1", "leg")]
    assert [link.mass for link in robot.links] == pytest.approx([5.0, 1e-6, 1.0 - 1e-6], rel=1e-9)


def test_an_arm_bolted_to_the_world(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, ARM)
    assert (robot.base, robot.base_joint, robot.links[0].mass) == ("ground", "fixed", 1.0)
    shoulder, elbow = robot.joints
    # The mount turns everything by a right angle, so the axis along y points along -x.
    assert shoulder.axis == (-1.0, 0.0, 0.0) and shoulder.origin == (0.0, 0.0, 1.0)
    assert shoulder.limits is None and elbow.limits == (-2.0, 2.0)
    assert robot.motors.peak_torque.tolist()[1] == 20.0
    assert robot.motors.no_load_speed.tolist()[1] == 5.0
    assert (robot.motors.friction[1], robot.motors.damping[1]) == (0.2, 0.1)
    capsule = robot.links[2].shapes[0]
    assert capsule.radius == 0.03
    assert sorted((capsule.start[2], capsule.end[2])) == pytest.approx([0.03, 0.37])
    notes = read(tmp_path / "robot.urdf").notes
    assert (
        "link upper: the mesh package://nowhere/upper.stl is not there, so it has no shape" in notes
    )
    assert "no effort limit of shoulder: 100 N m is assumed" in notes


def test_a_world_that_is_commented_out_holds_nothing(tmp_path: Path) -> None:
    mount = ARM[ARM.index('  <joint name="mount"') : ARM.index('  <link name="upper"')]
    free = ARM.replace('  <link name="world"/>\n', "").replace(mount, "")
    robot = robot_of(tmp_path, free.replace("<link", '<!-- <link name="world"/> -->\n  <link', 1))
    assert (robot.base, robot.base_joint) == ("base", "floating")


def test_welded_joints_and_a_floating_base_by_yaml(tmp_path: Path) -> None:
    robot = robot_of(tmp_path, ARM, {"weld": ["elb*"], "name": "stiff"})
    assert [joint.name for joint in robot.joints] == ["shoulder"] and robot.name == "stiff"
    assert robot.total_mass == pytest.approx(3.0)


def test_the_yaml_overrides_the_file(tmp_path: Path) -> None:
    added = {
        "links": {"lower": {"mass": 2.0, "shapes": []}},
        "joints": {"elbow": {"limits": [-1, 1]}},
        "profiles": {"strong": {"peak_torque": 50, "motors": {"elbow": {"friction": 1.0}}}},
        "points": {"tip": ["lower", [0, 0, 0.4]]},
        "sensors": {"imu": True},
    }
    robot = robot_of(tmp_path, ARM, added)
    assert robot.link("lower").mass == 2.0 and not robot.link("lower").shapes
    assert robot.joints[1].limits == (-1.0, 1.0)
    assert robot.motors.profile == "strong" and robot.motors.peak_torque.tolist() == [50.0, 50.0]
    assert robot.motors.no_load_speed.tolist()[1] == 5.0 and robot.motors.friction[1] == 1.0
    assert robot.points["tip"] == ("lower", (0.0, 0.0, 0.4)) and robot.sensors.imu


def test_a_yaml_that_names_its_file(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "arm.urdf").write_text(ARM)
    (tmp_path / "mine.yaml").write_text("file: models/arm.urdf\nname: mine\n")
    assert find_robot("mine.yaml", tmp_path).name == "mine"


def notes_of(folder: Path, content: str) -> tuple[RobotDescription, list[str]]:
    """The robot of a URDF, and what is said of joints and masses in it."""
    (folder / "robot.urdf").write_text(content)
    found = read(folder / "robot.urdf")
    others = ("mesh", "assumed", "rotor inertia")
    return found.description, [n for n in found.notes if not any(o in n for o in others)]


def test_a_link_without_mass_at_the_end_is_part_of_what_carries_it(tmp_path: Path) -> None:
    bare = ARM.replace(f'"lower">{INERTIAL}', '"lower">')
    robot, notes = notes_of(tmp_path, bare)
    assert [joint.name for joint in robot.joints] == ["shoulder"]
    assert notes == [
        "link lower has no mass and carries none: it is part of upper here, and joint elbow is fixed"
    ]


def test_a_link_without_mass_between_others_has_a_little_of_what_it_carries(tmp_path: Path) -> None:
    whole, _ = notes_of(tmp_path, ARM)
    bare = ARM.replace(f'"upper">{INERTIAL}', '"upper">')
    robot, notes = notes_of(tmp_path, bare)
    assert [joint.name for joint in robot.joints] == ["shoulder", "elbow"]
    lower = whole.link("lower").mass
    masses = [robot.link("upper").mass, robot.link("lower").mass]
    assert masses == pytest.approx([1e-3 * lower, 0.999 * lower])
    com = np.array(robot.joints[1].origin) + np.array(whole.link("lower").com)
    np.testing.assert_allclose(robot.link("upper").com, com, atol=1e-9)
    assert notes == ["link upper has no mass: it has a thousandth of lower here"]


def test_a_link_without_inertia_is_a_ball(tmp_path: Path) -> None:
    point = '<inertial><mass value="2"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
    robot, notes = notes_of(tmp_path, ARM.replace(f'"lower">{INERTIAL}', f'"lower">{point}'))
    radius = (3.0 * 2.0 / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0)
    assert robot.link("lower").inertia[:3] == pytest.approx([0.8 * radius**2] * 3)
    assert notes == [
        "link lower has no inertia: it is a ball of its mass and of water's density here"
    ]


def test_joints_without_a_range_are_free_or_fixed(tmp_path: Path) -> None:
    robot, notes = notes_of(tmp_path, ARM.replace('lower="-2" upper="2" ', ""))
    assert [joint.limits for joint in robot.joints] == [None, None]
    assert notes == ["joint elbow has no lower and upper limit in the URDF and turns freely here"]
    robot, notes = notes_of(tmp_path, ARM.replace('lower="-2" upper="2" ', 'lower="0" upper="0" '))
    assert [joint.name for joint in robot.joints] == ["shoulder"]
    assert notes == ["joint elbow has a range of 0 to 0 in the URDF and is fixed at 0 here"]


def test_rotors_are_estimated_from_torque_and_speed(tmp_path: Path) -> None:
    limits = '<limit lower="-1" upper="1" effort="{effort}" velocity="{speed}"/>'
    joints = "".join(
        f"""<link name="l{k}">{INERTIAL}</link><joint name="j{k}" type="revolute"><parent link="l{k - 1}"/>
        <child link="l{k}"/><axis xyz="0 1 0"/>{limits.format(effort=effort, speed=speed)}</joint>"""
        for k, (effort, speed) in enumerate(((24, 30), (48, 15), (10, 0)), start=1)
    )
    text = f'<robot name="r"><link name="l0">{INERTIAL}</link>{joints}</robot>'
    robot = robot_of(tmp_path, text)
    assert robot.motors.rotor_inertia == pytest.approx([0.0048, 0.0192, 0.0]), (
        "the last has no speed"
    )
    notes = read(tmp_path / "robot.urdf").notes
    assert (
        "rotor inertia is estimated from peak torque and no-load speed: 0.0048 to 0.0192 kg m^2, which may as "
        "well be 0.0028 to 0.064; write rotor_inertia under profiles"
    ) in notes
    for told in ({"rotor_inertia": 0.01}, {"motors": {"j1": {"rotor_inertia": 0.01}}}):
        robot = robot_of(tmp_path, text, {"profiles": {"rated": told}})
        assert robot.motors.rotor_inertia[0] == 0.01
        assert robot.motors.rotor_inertia[1] == told.get("rotor_inertia", 0.0)
        assert not [note for note in read(tmp_path / "robot.urdf").notes if "estimated" in note]


def test_actuators_of_sites_are_thrusters(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(DRONE)
    found = read(tmp_path / "robot.xml")
    a, b = found.description.thrusters.values()
    assert list(found.description.thrusters) == ["a", "b"]
    assert a.link == b.link == "frame" and a.position == (0.0, 0.2, 0.05)
    assert (a.max_thrust, a.torque_ratio, a.time_constant) == (12.0, -0.02, 0.0)
    assert b.position == pytest.approx((0.0, -0.2, 0.05)) and b.axis == pytest.approx((0, 0, 1))
    assert (b.max_thrust, b.torque_ratio, b.time_constant) == pytest.approx((6.0, -0.01, 0.03))
    assert [note for note in found.notes if note.startswith("actuator")] == [
        "actuator b pushes both ways in the file, and only forwards here",
        "actuator c is left out: it gives no force along a direction of its site; write it under thrusters",
        "actuator d is left out: its moment is not about its force; write it under thrusters",
    ]


def test_the_yaml_adds_to_the_thrusters_of_the_file(tmp_path: Path) -> None:
    added = {
        "thrusters": {"a": {"time_constant": 0.02}, "c": {"link": "arm", "max_thrust": 3.0}},
        "points": {"tip": ["arm", [0, 0, 0]]},
    }
    robot = robot_of(tmp_path, DRONE, added)
    assert robot.thrusters["a"].time_constant == 0.02 and robot.thrusters["a"].max_thrust == 12.0
    assert robot.thrusters["c"].link == "frame" and robot.thrusters["c"].position == (
        0.0,
        -0.2,
        0.0,
    )


@needs_robots
def test_a_robot_that_stands_in_no_pose_found_is_written_and_read(tmp_path: Path) -> None:
    arm = find_file(PACKAGE + "borinot_description/urdf/borinot_flying_arm_2.urdf", Path())
    assert arm is not None
    target = tmp_path / "arm.yaml"
    target.write_text(new_yaml(arm, target)[0])
    assert "# NOT FOUND: a pose in which it stands." in target.read_text()
    assert len(read(target).description.feet) == 1


def test_a_name_that_climbs_stays_in_the_file(tmp_path: Path) -> None:
    """A URDF may call its robot by a path; what is made of it is called as its own file."""
    urdf, target = tmp_path / "arm.urdf", tmp_path / "new.yaml"
    urdf.write_text(ARM.replace('<robot name="arm"', '<robot name="../../arm"'))
    assert "../../arm" in urdf.read_text()
    target.write_text(new_yaml(urdf, target).text)
    assert read(target).description.name == "new"
    assert {path.name for path in tmp_path.iterdir()} == {"arm.urdf", "new.yaml"}
