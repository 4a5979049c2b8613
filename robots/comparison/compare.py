"""Compares an import with MuJoCo's own compile of the file and, of a URDF, with Pinocchio's reading.

What is compared is what the importer made of the file alone; what a short YAML changes is wanted. A difference is an error,
or of one of the kinds that are named here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..pinocchio_model import build_pinocchio_model
from ..robot_description import RobotDescription
from .differences import Differences
from .file_robot import FileRobot
from .mujoco_reading import compare_with_mujoco
from .pinocchio_reading import compare_with_pinocchio

if TYPE_CHECKING:
    from ..importing.build import LinkTree
    from ..importing.raw_model import RawModel


def compare_with_file(model: RawModel, built: LinkTree) -> list[Differences]:
    """Return the comparisons: with MuJoCo, and of a URDF with Pinocchio."""
    joints = [joint["name"] for joint in built.joints]
    size = range(len(joints))
    motor = dict.fromkeys(
        ("peak_torque", "corner_speed", "no_load_speed", "continuous_torque", "rotor_inertia",
         "friction", "damping"), 1.0,
    )  # fmt: skip
    robot = RobotDescription.model_validate({
        "name": "compared", "base": built.base, "base_joint": built.base_joint,
        "links": [{**link, "shapes": []} for link in built.links], "joints": built.joints,
        "transmission": {
            "motors": joints,
            "joint_to_motor": [[float(row == column) for column in size] for row in size],
        },
        "profiles": {"rated": motor},
    })  # fmt: skip
    dynamics = build_pinocchio_model(robot).model
    rotors = [built.raw_joints[name].rotor_inertia for name in joints]
    dynamics.armature = np.concatenate([np.zeros(dynamics.nv - len(joints)), rotors])
    still = {
        joint.name: model.held.get(joint.name, 0.0)
        for body in model.bodies.values()
        for joint in body.joints
        if joint.name not in joints
        and joint.kind in ("hinge", "slide")
        and body.name in built.frames
        and body.name != built.base
    }
    ours = FileRobot(model, built, dynamics, still)
    found = []
    if model.reference is not None:
        found.append(compare_with_mujoco(ours, model.reference))
    if model.is_urdf:
        found.append(compare_with_pinocchio(ours))
    return found
