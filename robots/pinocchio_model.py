"""The controller's model, built from the robot's description with Pinocchio.

The same links, joints and rotors as the simulator's model, so that the two agree to rounding.
Joints and velocities are in the description's order after the free-flyer. Frames: every contact
point under its own name, every sole centre as ``<foot>_sole``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .description import RobotDescription


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
    """The model of the robot on a free-flyer, with the rotors of its actuator profile in use, or of
    the one named.

    Raises:
        LookupError: the robot has no actuator profile of that name.
        ValueError: a joint is listed before the one that carries it.
    """
    import pinocchio as pin

    model = pin.Model()
    model.name = robot.name
    carrier = {robot.base: model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")}
    kinds = {
        (1.0, 0.0, 0.0): pin.JointModelRX,
        (0.0, 1.0, 0.0): pin.JointModelRY,
        (0.0, 0.0, 1.0): pin.JointModelRZ,
    }
    for joint in robot.joints:
        if joint.parent not in carrier:
            raise ValueError(f"{robot.name}: joint {joint.name} is listed before its parent link")
        kind = kinds.get(joint.axis)
        revolute = pin.JointModelRevoluteUnaligned(np.array(joint.axis)) if kind is None else kind()
        place = pin.SE3(np.eye(3), np.array(joint.origin))
        carrier[joint.child] = model.addJoint(carrier[joint.parent], revolute, place, joint.name)
        lower, upper = joint.limits or (-np.inf, np.inf)
        model.lowerPositionLimit[-1], model.upperPositionLimit[-1] = lower, upper
    for link in robot.links:
        xx, yy, zz, xy, xz, yz = link.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        inertia = pin.Inertia(link.mass, np.array(link.com), tensor)
        model.appendBodyToJoint(carrier[link.name], inertia, pin.SE3.Identity())
    link_of_foot = {foot.name: foot.link for foot in robot.feet}

    def add_frame(name: str, link: str, position: tuple[float, float, float]) -> int:
        place = pin.SE3(np.eye(3), np.array(position))
        frame = pin.Frame(name, carrier[link], 0, place, pin.FrameType.OP_FRAME)
        return int(model.addFrame(frame))

    contacts = tuple(add_frame(c.name, link_of_foot[c.foot], c.position) for c in robot.contacts)
    soles = tuple(add_frame(f"{f.name}_sole", f.link, f.sole) for f in robot.feet)
    rotors = (robot if profile is None else robot.with_profile(profile)).rotor_matrix
    coupling = np.zeros((model.nv, model.nv))
    coupling[6:, 6:] = rotors - np.diag(np.diag(rotors))
    armature = np.zeros(model.nv)
    armature[6:] = np.diag(rotors)
    model.armature = armature
    return PinocchioModel(model, coupling, contacts, soles)
