"""Compares the import of a URDF with Pinocchio's reading of it: joints, limits, and dynamics at random states."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from ...files.problems import listing
from ..importing.inertials import one_line
from ..importing.urdf_text import XmlFile
from .differences import STATES, Differences

if TYPE_CHECKING:
    from .file_robot import FileRobot

MADE_UP = 0.02
"""Share by which dynamics may differ of robots with links that have a little of another one's mass or inertia."""


def compare_with_pinocchio(ours: FileRobot) -> Differences:
    """Return the comparison. Where Pinocchio does not read the file, it says so and holds nothing else."""
    import pinocchio as pin

    found, built = Differences("Pinocchio"), ours.built
    text = _with_limits(XmlFile(ours.model.path))
    floats = built.base_joint == "floating"
    try:
        # A planar or fixed base by the user's wish is fixed in both.
        theirs = (
            pin.buildModelFromXML(text, pin.JointModelFreeFlyer()) if floats else pin.buildModelFromXML(text)
        )  # fmt: skip
    except (ValueError, RuntimeError) as error:
        found.why = one_line(error)
        return found
    if built.base_joint == "planar":
        found.why = "it has no planar base"
        return found
    missing = [j["name"] for j in built.joints if not theirs.existJointName(j["name"])]
    if missing:
        found.why = f"it has no joint {listing(missing)}"
        return found
    ids = [theirs.getJointId(joint["name"]) for joint in built.joints]
    _compare_joints(ours, theirs, ids, found)
    if ours.model.compiled:
        found.name("a URDF tells MuJoCo's compiler of masses, which Pinocchio does not know")
        return found
    _compare_dynamics(ours, theirs, ids, found)
    return found


def _with_limits(file: XmlFile) -> str:
    """Return the file with a ``<limit>`` for joints that lack one. Pinocchio's parser refuses the whole file without, and prints
    why on its own."""
    bare = [
        joint
        for joint in file.root.findall("joint")
        if joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is None
    ]
    for joint in bare:
        ElementTree.SubElement(joint, "limit", effort="0", velocity="0")
    return ElementTree.tostring(file.root, encoding="unicode") if bare else file.content


def _compare_joints(ours: FileRobot, theirs: Any, ids: list[int], found: Differences) -> None:
    for joint, number in zip(ours.built.joints, ids, strict=True):
        name, raw, their = (
            joint["name"],
            ours.built.raw_joints[joint["name"]],
            theirs.joints[number],
        )
        q, v = their.idx_q, their.idx_v
        if their.nq == 1 and joint["limits"] is not None:
            limits = [theirs.lowerPositionLimit[q], theirs.upperPositionLimit[q]]
            found.compare(f"range of joint {name}", joint["limits"], limits)
        elif (their.nq == 1) != (joint["limits"] is not None):
            found.name("a joint of a URDF without lower and upper limit turns freely")
        for what, value, other in (
            ("effort limit", raw.effort, theirs.upperEffortLimit[v]),
            ("velocity limit", raw.speed, theirs.upperVelocityLimit[v]),
        ):
            if math.isfinite(value) and value > 0.0:
                found.compare(f"{what} of joint {name}", value, float(other))
        found.compare(f"damping of joint {name}", raw.damping, float(theirs.damping[v]))
        found.compare(
            f"friction of joint {name}", raw.friction, float(theirs.upperDryFrictionLimit[v])
        )


def _compare_dynamics(ours: FileRobot, theirs: Any, ids: list[int], found: Differences) -> None:
    import pinocchio as pin

    robot, random = ours.dynamics, np.random.default_rng(1)
    first = robot.nv - len(ids)
    robot.armature, theirs.armature = np.zeros(robot.nv), np.zeros(theirs.nv)
    robot.gravity.linear = theirs.gravity.linear
    memory, their_memory = robot.createData(), theirs.createData()
    select = np.zeros((theirs.nv, robot.nv))
    select[:first, :first] = np.eye(first)
    for k, number in enumerate(ids):
        select[theirs.joints[number].idx_v, first + k] = 1.0
    share = {}
    if ours.built.notes:
        found.name("a link without mass or inertia has a little of another one's, or water's")
        share = {"share": MADE_UP}
    if ours.fixed_at:
        found.name("joints that the file holds or ties are fixed")
    for _ in range(STATES):
        their_q, base = pin.neutral(theirs), random.normal(size=7)
        base[3:] /= np.linalg.norm(base[3:])
        angles, velocity = random.normal(size=len(ids)), random.normal(size=robot.nv)
        q = angles
        if first:
            their_q[:7], q = base, np.concatenate([base, angles])
        positions = dict(zip(ids, angles.tolist(), strict=True))
        for name, angle in ours.fixed_at.items():
            if theirs.existJointName(name):
                positions[theirs.getJointId(name)] = angle
        for number, angle in positions.items():
            their = theirs.joints[number]
            value = [angle] if their.nq == 1 else [math.cos(angle), math.sin(angle)]
            if their.nq <= 2:
                their_q[their.idx_q : their.idx_q + their.nq] = value
        masses = []
        for model, data, at in ((robot, memory, q), (theirs, their_memory, their_q)):
            mass = pin.crba(model, data, at)
            masses.append(np.triu(mass) + np.triu(mass, 1).T)
        found.compare(
            "mass matrix at a random state", masses[0], select.T @ masses[1] @ select, **share
        )
        bias = pin.nonLinearEffects(robot, memory, q, velocity)
        their_bias = pin.nonLinearEffects(theirs, their_memory, their_q, select @ velocity)
        found.compare("bias forces at a random state", bias, select.T @ their_bias, **share)
