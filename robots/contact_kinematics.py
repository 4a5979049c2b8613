"""Positions and velocities of the contact points relative to the base."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mathematics.rotations import cross, rotate_back, skew
from .ball_feet import ball_feet
from .link_poses import contact_centres, joints_above, link_poses
from .pinocchio_model import build_pinocchio_model
from .robot_description import RobotDescription

Array = NDArray[np.float64]

_DOWN = np.array([0.0, 0.0, -1.0])


class ContactKinematics:
    """The robot with its base held in place but turning, evaluated by Pinocchio.

    The rubber of a contact point is round: what touches the ground is its lowest point, however
    the foot is turned, and that part of the foot is what stands still while the foot rolls.

    Attributes:
        points: the lowest point of each contact [m, body], (n_contacts, 3).
        rates: their velocities with the joints' and the base's turning [m/s, body].
        soles: the sole centres [m, body], (n_feet, 3).
        forward: the sum of the feet's forward directions [body], (3,); of feet that are balls
            the direction in which their pattern points, x where they stand as in the standing pose.
        com_velocity: of the centre of mass relative to the base's origin [m/s, body], (3,).
        centres: the centres of the contacts' round rubber [m, body], (n_contacts, 3).
        jacobians: of the centres by the joints [m, body], (n_contacts, 3, n_joints).
        heading_levers: horizontal positions of the contact points relative to a middle, which
            rotate with the feet's heading [m], (n_contacts, 2): the middle of each foot, or of the
            pattern that feet of one point make. They are constant, and zero where the points have
            no heading.

    ``centres`` and ``jacobians`` are updated by ``differentiate`` only.
    """

    def __init__(self, robot: RobotDescription) -> None:
        import pinocchio

        built = build_pinocchio_model(robot)
        data: Any = built.model.createData()
        self._evaluate: Any = pinocchio.computeCentroidalMomentum
        self._model: Any = built.model
        self._data: Any = data
        self._position = np.array(pinocchio.neutral(built.model))
        self._velocity = np.zeros(built.model.nv)
        frames = built.model.frames
        # Views of Pinocchio's own memory; the base's frame is its world here.
        self._feet = [
            (data.oMi[joint].rotation, data.oMi[joint].translation,
             data.v[joint].linear, data.v[joint].angular)
            for joint in (frames[sole].parentJoint for sole in built.sole_frames)
        ]  # fmt: skip
        self._momentum = data.hg.linear
        self._mass = robot.total_mass
        self._foot_of_point = robot.foot_of_contact()
        self._radii = [contact.radius for contact in robot.contacts]
        self._centres = list(contact_centres(robot))
        self._balls = ball_feet(robot)
        self._pattern = _pattern(robot) if len(self._balls) == len(robot.feet) > 1 else None
        self._sole_offsets = [np.array(foot.sole) for foot in robot.feet]
        self._down, self._arm, self._spare = np.zeros(3), np.zeros(3), np.zeros(3)
        self.points, self.rates = np.zeros((len(self._radii), 3)), np.zeros((len(self._radii), 3))
        self.soles = np.zeros((len(self._feet), 3))
        self.forward, self.com_velocity = np.zeros(3), np.zeros(3)
        n_joints = len(robot.joints)
        self._differentiate: Any = pinocchio.computeAllTerms
        self._joint_jacobians = data.J[:, 6:]
        self._linear, self._angular = np.zeros((3, n_joints)), np.zeros((3, n_joints))
        self._lever = np.zeros((3, 3))
        self._of_leg = np.array([joints_above(robot, foot.link) for foot in robot.feet], float)
        self.centres = np.zeros((len(self._radii), 3))
        self.jacobians = np.zeros((len(self._radii), 3, n_joints))
        self.heading_levers = self._find_heading_levers()

    def _find_heading_levers(self) -> Array:
        levers = np.zeros((len(self._radii), 2))
        if self._pattern is not None:
            levers[...] = self._pattern.T
            return levers
        for point, foot in enumerate(self._foot_of_point):
            ahead = [
                float(centre[0])
                for centre, other in zip(self._centres, self._foot_of_point, strict=True)
                if other == foot
            ]
            levers[point, 0] = float(self._centres[point][0]) - sum(ahead) / len(ahead)
        return levers

    def evaluate(
        self, orientation: Array, angular_velocity: Array, position: Array, velocity: Array
    ) -> None:
        """Update all attributes but ``centres`` and ``jacobians``.

        Args:
            orientation: the base's quaternion x, y, z, w, which gives the vertical.
            angular_velocity: of the base [rad/s, body], (3,).
            position, velocity: of the joints [rad, rad/s], (n_joints,).
        """
        self._position[7:] = position
        self._velocity[3:6] = angular_velocity
        self._velocity[6:] = velocity
        self._evaluate(self._model, self._data, self._position, self._velocity)
        rotate_back(orientation, _DOWN, self._down)
        for i, foot in enumerate(self._foot_of_point):
            turn, place, linear, angular = self._feet[foot]
            point, arm = self.points[i], self._arm
            np.dot(self._down, turn, arm)
            arm *= self._radii[i]
            arm += self._centres[i]
            cross(angular, arm, self._spare)
            self._spare += linear
            np.dot(turn, self._spare, self.rates[i])
            np.dot(turn, arm, point)
            point += place
        self.forward.fill(0.0)
        for foot, (turn, place, _, _) in enumerate(self._feet):
            self.forward += turn[:, 0]
            np.dot(turn, self._sole_offsets[foot], self.soles[foot])
            self.soles[foot] += place
        for ball in self._balls:
            self.soles[ball.foot] = self.points[ball.point]
        if self._pattern is not None:
            np.dot(self._pattern[0], self.points, out=self.forward)
            np.dot(self._pattern[1], self.points, out=self._spare)
            cross(self._down, self._spare, self._arm)
            self.forward += self._arm
        np.divide(self._momentum, self._mass, out=self.com_velocity)

    def differentiate(self) -> None:
        """Update ``centres`` and ``jacobians`` for the joints of the last ``evaluate``.

        The centre of the rubber is its radius above the ground, whatever the base's orientation.
        """
        # The function for Jacobians alone returns them, as a new array.
        self._differentiate(self._model, self._data, self._position, self._velocity)
        self._linear[...] = self._joint_jacobians[:3]
        self._angular[...] = self._joint_jacobians[3:]
        for i, foot in enumerate(self._foot_of_point):
            centre = self.centres[i]
            np.dot(self._feet[foot][0], self._centres[i], centre)
            centre += self._feet[foot][1]
            skew(centre, self._lever)
            jacobian = self.jacobians[i]
            np.dot(self._lever, self._angular, jacobian)
            np.subtract(self._linear, jacobian, out=jacobian)
            jacobian *= self._of_leg[foot]


def _pattern(robot: RobotDescription) -> Array:
    """How far every contact point is ahead and to the left of their middle in the standing pose
    [m], (2, n_contacts).

    Where the points p_i stand so, turned by a heading, the sum over x_i p_i + y_i (p_i x up)
    points ahead, as far as the pattern is symmetric.
    """
    poses = link_poses(robot, robot.standing_position)
    places = np.zeros((len(robot.contacts), 3))
    for ball in ball_feet(robot):
        turn, place = poses[robot.feet[ball.foot].link]
        places[ball.point] = place + turn @ ball.centre
    return np.ascontiguousarray((places - places.mean(axis=0))[:, :2].T)
