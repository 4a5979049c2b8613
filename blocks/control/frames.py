"""Frames of the robot: where a link or a named point is, how it moves, and its Jacobian."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array1D, Array2D
from ...mathematics.body_dynamics import (
    BodyMotion,
    BodyTree,
    acceleration_at,
    body_motion,
    move_bodies,
    point_jacobian,
    point_position,
    rotation_jacobian,
    set_body_poses,
    velocity_at,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...robots.kinematics import body_tree
from ...runtime.language.steps import signal_call
from ..signals import DynamicsTerms, JointState

Vector = tuple[float, float, float]


class Frame(NamedTuple):
    """A frame that is fixed to a link, in the present tick.

    ``position`` (3,) [m, world] is its origin and ``rotation`` (3, 3) takes its vectors to the world.
    ``velocity``, ``jacobian`` and ``drift`` have three rows of the origin and then three of the
    rotation, in the world's axes: velocity = jacobian v (6,), and the acceleration is
    jacobian v' + drift, with the generalised velocity v.
    """

    position: Array1D
    rotation: Array2D
    velocity: Array1D
    jacobian: Array2D
    drift: Array1D


class FrameModel:
    """The frames that tasks use. Where none is used, nothing is computed."""

    def __init__(self, robot: RobotDescription, terms: DynamicsTerms, joints: JointState) -> None:
        self._robot, self._terms, self._joints = robot, terms, joints
        self._tree, self._motion = body_tree(robot), body_motion(len(robot.joints))
        self._frames: dict[tuple[str, Vector], Frame] = {}
        self.calls: list[KernelCall] = []
        """Calls that update all frames in a tick, in their order."""

    def frame(self, name: str, offset: Vector = (0.0, 0.0, 0.0)) -> Frame:
        """Return the frame called ``name``, moved by ``offset`` [m] in its own axes.

        Raises:
            KeyError: the robot has no such frame.
        """
        if (name, offset) not in self._frames:
            self._frames[name, offset] = self._make(name, offset)
        return self._frames[name, offset]

    def _make(self, name: str, offset: Vector) -> Frame:
        link, place = frames_of(self._robot)[name]
        n = 6 + len(self._robot.joints)
        frame = Frame(np.zeros(3), np.eye(3), np.zeros(6), np.zeros((6, n)), np.zeros(6))
        bodies = [self._robot.base, *(joint.child for joint in self._robot.joints)]
        terms, tree, motion = self._terms, self._tree, self._motion
        if not self.calls:
            self.calls.append(signal_call(move_model, terms, self._joints, tree, motion))
        local = np.add(place, offset)
        self.calls.append(
            signal_call(update_frame, terms, tree, motion, bodies.index(link), local, frame)
        )
        return frame


def frames_of(robot: RobotDescription) -> dict[str, tuple[str, Vector]]:
    """Return the robot's frames by name, each with its link and its origin in the link's frame [m].

    They are the links, the named points and the contact points of the description; where two have
    one name the link counts, then the named point.
    """
    feet = {foot.name: foot.link for foot in robot.feet}
    contacts = {each.name: (feet[each.foot], each.position) for each in robot.contacts}
    bodies = (robot.base, *(joint.child for joint in robot.joints))
    return {**contacts, **robot.points, **{name: (name, (0.0, 0.0, 0.0)) for name in bodies}}


@kernel
def move_model(
    terms: DynamicsTerms, joints: JointState, tree: BodyTree, motion: BodyMotion
) -> None:
    """Compute the places, velocities and accelerations of all bodies, with constant generalised velocity."""
    for row in range(3):
        linear, angular = 0.0, 0.0
        for column in range(3):
            turn = terms.base_rotation[row, column]
            motion.rotation[0, row, column] = turn
            linear += turn * terms.velocity[column]
            angular += turn * terms.velocity[3 + column]
        motion.velocity[0, row], motion.velocity[0, 3 + row] = linear, angular
    set_body_poses(tree, joints.position, motion)
    move_bodies(tree, terms.velocity[6:], motion)


@kernel
def update_frame(
    terms: DynamicsTerms,
    tree: BodyTree,
    motion: BodyMotion,
    body: int,
    local: Array1D,
    frame: Frame,
) -> None:
    """Update the motion and the Jacobian of the point ``local`` [m] of a body that ``move_model`` has moved."""
    place = frame.position
    point_position(motion, body, local, place)
    velocity_at(motion, body, place, frame.velocity[0:3])
    acceleration_at(motion, body, place, frame.drift[0:3])
    point_jacobian(tree, motion, body, place, frame.jacobian[0:3, :])
    rotation_jacobian(tree, motion, body, frame.jacobian[3:6, :])
    for row in range(3):
        frame.velocity[3 + row] = motion.velocity[body, 3 + row]
        frame.drift[3 + row] = motion.acceleration[body, 3 + row]
        place[row] = place[row] + terms.base_position[row]
        for column in range(3):
            frame.rotation[row, column] = motion.rotation[body, row, column]
