"""A robot written as a URDF has the same dynamics in Pinocchio's own reader and comes back whole."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from aloft.robots.description import Hull, RobotDescription, find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.robots.urdf_export import hull_meshes, urdf_of

from .example_robots import needs_robots
from .validation.wrong_robots import hopper

NAMES = ["bruce", *(pytest.param(name, marks=needs_robots) for name in ("go2", "talos"))]


@pytest.mark.parametrize("name", NAMES)
def test_dynamics_are_equal_in_pinocchio(name: str) -> None:
    robot = find_robot(name)
    ours = build_pinocchio_model(robot).model
    theirs = pin.buildModelFromXML(urdf_of(robot), pin.JointModelFreeFlyer())
    ours.armature = theirs.armature = np.zeros(ours.nv)
    order = [ours.getJointId(joint) for joint in theirs.names[2:]]
    columns = [*range(6), *(ours.joints[k].idx_v for k in order)]
    random = np.random.default_rng(3)
    for _ in range(5):
        base = random.normal(size=7)
        base[3:] /= np.linalg.norm(base[3:])
        angles, v = random.normal(size=len(order)), random.normal(size=ours.nv)
        q = np.concatenate([base, angles])
        their_q = np.concatenate([base, q[[column + 1 for column in columns[6:]]]])
        mine, data = ours.createData(), theirs.createData()
        mass = pin.crba(ours, mine, q)[np.ix_(columns, columns)]
        np.testing.assert_allclose(mass, pin.crba(theirs, data, their_q), rtol=0, atol=1e-12)
        bias = pin.nonLinearEffects(ours, mine, q, v)[columns]
        their_bias = pin.nonLinearEffects(theirs, data, their_q, v[columns])
        np.testing.assert_allclose(bias, their_bias, rtol=0, atol=1e-10)
        pin.framesForwardKinematics(ours, mine, q)
        pin.framesForwardKinematics(theirs, data, their_q)
        for contact in robot.contacts:
            point = mine.oMf[ours.getFrameId(contact.name, pin.FrameType.OP_FRAME)].translation
            their = data.oMf[theirs.getFrameId(contact.name, pin.FrameType.BODY)].translation
            np.testing.assert_allclose(point, their, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_it_comes_back_through_our_own_reader(name: str, tmp_path: Path) -> None:
    robot = find_robot(name)
    (tmp_path / "back.urdf").write_text(urdf_of(robot))
    back = find_robot("back.urdf", tmp_path)
    assert [joint.name for joint in back.joints] == [joint.name for joint in robot.joints]
    for mine, theirs in zip(robot.joints, back.joints, strict=True):
        assert (mine.parent, mine.child, mine.kind) == (theirs.parent, theirs.child, theirs.kind)
        assert theirs.axis == pytest.approx(mine.axis, abs=1e-12)
        assert theirs.origin == pytest.approx(mine.origin, abs=1e-11)
        assert theirs.limits == pytest.approx(mine.limits)
    for mine, theirs in zip(robot.links, back.links, strict=True):
        assert theirs.mass == mine.mass
        assert theirs.inertia == pytest.approx(mine.inertia, abs=1e-14)


def test_limits_of_coupled_motors() -> None:
    robot = find_robot("bruce")
    root = ElementTree.fromstring(urdf_of(robot))
    limits = {joint.get("name"): joint.find("limit") for joint in root.findall("joint")}
    hip, knee = limits["right_hip_pitch"], limits["right_knee"]
    assert hip is not None and knee is not None
    assert (hip.get("effort"), hip.get("velocity")) == ("21.0", "30.0")  # two motors
    assert (knee.get("lower"), knee.get("upper")) == ("-2.1", "-0.02")


@pytest.mark.parametrize(("base", "velocities"), [("fixed", 0), ("planar", 3)])
def test_other_bases_and_joints(base: str, velocities: int) -> None:
    data = hopper() | {"base_joint": base}
    data["joints"][0] |= {"kind": "slide", "axis": [0.6, 0.0, 0.8], "limits": None}
    data["joints"][1]["limits"] = None
    robot = RobotDescription.model_validate(data)
    ours = build_pinocchio_model(robot).model
    theirs = pin.buildModelFromXML(urdf_of(robot))
    assert ours.nv == theirs.nv == velocities + 2
    ours.armature = np.zeros(ours.nv)
    random = np.random.default_rng(0)
    q = random.normal(size=ours.nq)
    full = np.zeros(theirs.nq)
    for k in range(1, theirs.njoints):
        joint, value = theirs.joints[k], q[theirs.joints[k].idx_v]
        full[joint.idx_q : joint.idx_q + joint.nq] = (
            [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        )
    mass = pin.crba(ours, ours.createData(), q)
    np.testing.assert_allclose(mass, pin.crba(theirs, theirs.createData(), full), atol=1e-12)
    gravity = pin.computeGeneralizedGravity(ours, ours.createData(), q)
    their = pin.computeGeneralizedGravity(theirs, theirs.createData(), full)
    np.testing.assert_allclose(gravity, their, atol=1e-12)


def test_hulls_become_meshes_beside_the_file(tmp_path: Path) -> None:
    wedge = ((-0.1, 0.0), (0.1, 0.0), (0.0, 0.2))
    corners = tuple((x, y, z) for x, z in wedge for y in (-0.15, 0.15))
    links = tuple(
        link.model_copy(update={"shapes": (Hull(corners=corners),)})
        if link.name == "torso"
        else link
        for link in find_robot("bruce").links
    )
    robot = find_robot("bruce").changed(links=links)
    meshes = hull_meshes(robot)
    assert list(meshes) == ["torso_0.stl"]
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "torso_0.stl").write_bytes(meshes["torso_0.stl"])
    (tmp_path / "back.urdf").write_text(urdf_of(robot, "parts"))
    (shape,) = find_robot("back.urdf", tmp_path).link("torso").shapes
    assert isinstance(shape, Hull)
    np.testing.assert_allclose(sorted(shape.corners), sorted(corners), atol=1e-4)


def page_code(word: str) -> str:
    """The code of the page on robots that imports a program."""
    page = (Path(__file__).parents[2] / "docs" / "robots.md").read_text(encoding="utf-8")
    (code,) = [
        c
        for c in re.findall(r"```python\n(.*?)```", page, re.DOTALL)
        if word in c and "bruce.urdf" in c
    ]
    return code


def loaded(word: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the page's code makes of BRUCE's URDF."""
    (folder / "bruce.urdf").write_text(urdf_of(find_robot("bruce")))
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    exec(page_code(word), names)  # noqa: S102  # what readers of the page run
    return names


def judge_mass(columns: Any, angles: Any) -> Any:
    """Pinocchio's mass matrix of our model with the base at the origin, its joints in these columns."""
    robot = find_robot("bruce")
    ours = build_pinocchio_model(robot).model
    ours.armature = np.zeros(ours.nv)
    q = np.concatenate([np.zeros(6), [1.0], angles])
    mass = pin.crba(ours, ours.createData(), q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    order = np.argsort([columns[joint.name] for joint in robot.joints])
    at = [*range(6), *(6 + order)]
    return mass[np.ix_(at, at)]


@pytest.mark.parametrize("word", ["import pinocchio", "import mujoco"])
def test_other_programs_have_its_dynamics_as_the_page_loads_it(
    word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, names = find_robot("bruce"), loaded(word, tmp_path, monkeypatch)
    model, columns = names["model"], names["columns"]
    assert {*columns} == {joint.name for joint in robot.joints} and model.nv == 16
    angles = np.random.default_rng(5).normal(size=10)
    if word == "import mujoco":
        data = mujoco.MjData(model)
        for joint, angle in zip(robot.joints, angles, strict=True):
            data.qpos[model.joint(joint.name).qposadr[0]] = angle
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        mujoco.mj_forward(model, data)
        mass = np.zeros((16, 16))
        mujoco.mj_fullM(model, data, mass)
    else:
        q = pin.neutral(model)
        for joint, angle in zip(robot.joints, angles, strict=True):
            q[model.joints[model.getJointId(joint.name)].idx_q] = angle
        mass = pin.crba(model, model.createData(), q)
        mass = np.triu(mass) + np.triu(mass, 1).T
    np.testing.assert_allclose(mass, judge_mass(columns, angles), rtol=0, atol=1e-9)


def test_drake_has_its_dynamics_as_the_page_loads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pydrake", reason="pip install drake, of the extra `peers`")
    robot, names = find_robot("bruce"), loaded("from pydrake", tmp_path, monkeypatch)
    plant, columns = names["plant"], names["columns"]
    assert {*columns} == {joint.name for joint in robot.joints}
    angles = np.random.default_rng(5).normal(size=10)
    context = plant.CreateDefaultContext()
    for joint, angle in zip(robot.joints, angles, strict=True):
        plant.GetJointByName(joint.name).set_angle(context, angle)
    theirs = plant.CalcMassMatrix(context)
    ours = judge_mass(columns, angles)
    swap = [3, 4, 5, 0, 1, 2, *range(6, 16)]  # Drake has turning before moving
    np.testing.assert_allclose(theirs, ours[np.ix_(swap, swap)], rtol=0, atol=1e-9)
