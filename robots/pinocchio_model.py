"""The controller's model, built from the robot's description with Pinocchio.

It has the same links, joints and rotors as the simulator's model, so that both agree to rounding.
Joints and velocities are in the description's order after those of the base: none for a fixed base,
a planar joint in the x-z plane for a planar one, a free-flyer for a floating one. Frames: every
contact point under its own name, every sole centre as ``<foot>_sole``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kinematics import inertia_tensor
from .robot_description import Joint, RobotDescription


@dataclass(frozen=True)
class PinocchioModel:
    """The Pinocchio ``model`` and what it cannot hold: ``rotor_coupling`` (n_velocities square),
    the off-diagonal inertia of rotors geared to two joints. It is constant and is to be added to
    every joint-space inertia matrix; the diagonal is in the model's ``armature``.

    Frame indices: ``contact_frames`` and ``sole_frames`` in the description's order.
    """

    model: Any
    rotor_coupling: NDArray[np.float64]
    contact_frames: tuple[int, ...]
    sole_frames: tuple[int, ...]


def build_pinocchio_model(robot: RobotDescription, profile: str | None = None) -> PinocchioModel:
    """Return the model of the robot on its base, with the rotors of the actuator profile in use.

    The velocity of a floating base is that of its origin in the base's own frame, first linear,
    then angular (6). A planar base has the positions x, z and the turn about y that takes z to x,
    and the velocities of the same, in the world (3).

    Args:
        robot: the description.
        profile: another actuator profile than the one in use.

    Raises:
        LookupError: the robot has no actuator profile of that name.
    """
    import pinocchio as pin

    robot = robot if profile is None else robot.with_profile(profile)
    model = pin.Model()
    model.name = robot.name
    carrier = {robot.base: _add_base(model, robot.base_joint)}
    for joint in robot.joints:
        place = pin.SE3(np.eye(3), np.array(joint.origin))
        parent = carrier[joint.parent]
        carrier[joint.child] = model.addJoint(parent, _joint_model(joint), place, joint.name)
        lower, upper = joint.limits or (-np.inf, np.inf)
        model.lowerPositionLimit[-1], model.upperPositionLimit[-1] = lower, upper
    for link in robot.links:
        inertia = pin.Inertia(link.mass, np.array(link.com), inertia_tensor(link.inertia))
        model.appendBodyToJoint(carrier[link.name], inertia, pin.SE3.Identity())
    link_of_foot = {foot.name: foot.link for foot in robot.feet}

    def add_frame(name: str, link: str, position: tuple[float, float, float]) -> int:
        place = pin.SE3(np.eye(3), np.array(position))
        frame = pin.Frame(name, carrier[link], 0, place, pin.FrameType.OP_FRAME)
        return int(model.addFrame(frame))

    contacts = tuple(add_frame(c.name, link_of_foot[c.foot], c.position) for c in robot.contacts)
    soles = tuple(add_frame(f"{f.name}_sole", f.link, f.sole) for f in robot.feet)
    rotors, first = robot.rotor_matrix, robot.base_velocities
    coupling = np.zeros((model.nv, model.nv))
    coupling[first:, first:] = rotors - np.diag(np.diag(rotors))
    armature = np.zeros(model.nv)
    armature[first:] = np.diag(rotors)
    model.armature = armature
    return PinocchioModel(model, coupling, contacts, soles)


def _add_base(model: Any, base_joint: str) -> int:
    """Add what holds the base; the index of the joint that carries it."""
    import pinocchio as pin

    if base_joint == "fixed":
        return 0
    nothing = pin.SE3.Identity()
    if base_joint == "floating":
        return int(model.addJoint(0, pin.JointModelFreeFlyer(), nothing, "base"))
    # Three joints after one another, so that positions and velocities are plain numbers.
    along_x = model.addJoint(0, pin.JointModelPX(), nothing, "base_x")
    along_z = model.addJoint(along_x, pin.JointModelPZ(), nothing, "base_z")
    return int(model.addJoint(along_z, pin.JointModelRY(), nothing, "base_pitch"))


def _joint_model(joint: Joint) -> Any:
    """Return Pinocchio's joint, its special one where the axis is a coordinate axis."""
    import pinocchio as pin

    straight = {(1.0, 0.0, 0.0): "X", (0.0, 1.0, 0.0): "Y", (0.0, 0.0, 1.0): "Z"}.get(joint.axis)
    letter = "P" if joint.kind == "slide" else "R"
    if straight:
        return getattr(pin, f"JointModel{letter}{straight}")()
    name = "PrismaticUnaligned" if joint.kind == "slide" else "RevoluteUnaligned"
    return getattr(pin, f"JointModel{name}")(np.array(joint.axis))
