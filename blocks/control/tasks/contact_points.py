"""The task for the contact points: at rest in stance, otherwise going down or lifting off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....mathematics.arrays import Indices1D
from ....mathematics.kernel import kernel
from ....mathematics.stance_feet import has_contact
from ....mathematics.whole_body_qp import TaskRows
from ....robots.description import RobotDescription
from ....robots.limb import chain_to
from ....runtime.language.parameters import Parameters, parameter
from ...signals import DynamicsTerms, JointState, Phase, PhaseState, WholeBodyTarget
from .task import Task


class ContactGains(Parameters):
    """Weights and gains of the contact points."""

    stance_weight: float = parameter(
        1e3, ge=0.0, text="weight of the zero acceleration of points in stance, per m/s^2"
    )
    stance_damping: float = parameter(
        0.0, unit="1/s", ge=0.0, text="damping of the velocity of points in stance"
    )
    swing_weight: float = parameter(
        10.0,
        ge=0.0,
        text="weight of points without load, per m/s^2: they are pulled to the ground; in the "
        "thrust they are damped across the foot",
    )
    swing_stiffness: float = parameter(
        3000.0, unit="1/s^2", ge=0.0, text="stiffness that pulls points without load to the ground"
    )
    swing_damping: float = parameter(
        110.0, unit="1/s", ge=0.0, text="damping of the velocity of points without load"
    )
    step_weight: float = parameter(
        1000.0, ge=0.0, text="weight of the acceleration of points that take a step, per m/s^2"
    )
    rolling_weight: float = parameter(
        0.1, ge=0.0, text="weight of the ankle of a foot that rolls over its toes, per rad/s^2"
    )
    rolling_stiffness: float = parameter(
        1000.0, unit="1/s^2", ge=0.0, text="position gain of that ankle towards the plan"
    )
    rolling_damping: float = parameter(
        60.0, unit="1/s", ge=0.0, text="velocity gain of that ankle towards the plan"
    )
    raised_weight: float = parameter(
        10.0,
        ge=0.0,
        text="weight of the joints of a leg whose foot has left the ground, per rad/s^2",
    )


class LiftingLegs(NamedTuple):
    """The joints that move feet, or parts of them, that leave the ground before lift-off.

    ``foot`` (n_contacts,) is the foot of each point. ``ankle`` (n_feet,) is the index in the generalised
    velocity of the joint with which each foot rolls over its toes, -1 for none. ``joint`` (3 n_contacts,) is
    that of a joint of the leg for each row of the task, -1 for none.
    """

    foot: Indices1D
    ankle: Indices1D
    joint: Indices1D


class ContactPoints(Task):
    """Points in stance do not accelerate (paper, V, task 1): J a + drift = -damping velocity.

    Points that are not in stance while others are go to the ground, at the mean height of the
    points in stance: a task of zero acceleration would never close a gap, and the program would
    rely on the force of a heel that hovers. In THRUST such points are lifting off. While others of their foot
    still push, as toes do while the heels rise, they are free to rise and are damped across their foot, and the
    ankle (see ``rolling_joint``) follows the plan with feedforward and feedback; the points of a foot
    without one have their velocity damped. Where no point of a foot is in stance
    any more, the joints of its leg do, as many of the last ones as the foot's points have rows.

    Points of a foot that takes a step have the acceleration that ``PhaseState`` gives them.
    """

    Gains = Params = ContactGains

    @classmethod
    def row_count(cls, params: ContactGains, robot: RobotDescription) -> int:
        return 3 * len(robot.contacts)

    def setup(self) -> None:
        robot, owners = self.robot, np.array(self.robot.foot_of_contact(), np.int64)
        ankles, joints = np.full(len(robot.feet), -1), np.full(3 * len(owners), -1)
        for foot in range(len(robot.feet)):
            ankle = rolling_joint(robot, foot)
            if ankle is not None:
                ankles[foot] = robot.base_velocities + ankle
            rows = np.flatnonzero(np.repeat(owners == foot, 3))
            chain = chain_to(robot, robot.feet[foot].link)
            moving = [k for k in chain if robot.joints[k].name not in robot.held][-len(rows) :]
            joints[rows[: len(moving)]] = robot.base_velocities + np.array(moving, np.int64)
        self.legs = LiftingLegs(owners, ankles.astype(np.int64), joints.astype(np.int64))

    @kernel
    @staticmethod
    def step(
        terms: DynamicsTerms,
        target: WholeBodyTarget,
        phase: PhaseState,
        joints: JointState,
        legs: LiftingLegs,
        params: ContactGains,
        rows: TaskRows,
    ) -> None:
        contact_rows(terms, phase, params, rows)
        step_rows(terms, phase, params, rows)
        if phase.phase == Phase.THRUST:
            lifting_rows(terms, target, joints, phase, legs, params, rows)


def rolling_joint(robot: RobotDescription, foot: int) -> int | None:
    """Return the joint that turns a foot about its lateral axis while the foot rolls over its toes.

    It is the leg's last hinge whose axis is nearly across the robot (within 45 degrees of y, at the
    zero pose). A point foot has none: it does not roll, and its leg's last hinge is the knee.
    """
    name = robot.feet[foot].name
    if sum(contact.foot == name for contact in robot.contacts) < 2:
        return None
    for index in reversed(chain_to(robot, robot.feet[foot].link)):
        joint = robot.joints[index]
        x, y, z = joint.axis
        if joint.kind == "hinge" and y * y > x * x + z * z:
            return index
    return None


@kernel
def contact_rows(
    terms: DynamicsTerms, phase: PhaseState, params: ContactGains, rows: TaskRows
) -> None:
    """Three rows for each contact point: zero acceleration in stance, else a pull to the ground.

    A spring and a damper bring the height of a point that is not in stance to the mean height of
    the points in stance, and its horizontal velocity is damped.
    """
    count = phase.stance.shape[0]
    ground, loaded = 0.0, 0
    for i in range(count):
        if phase.stance[i]:
            ground += terms.contact_position[i, 2]
            loaded += 1
    ground = ground / loaded if loaded else 0.0
    for i in range(count):
        for k in range(3):
            row = 3 * i + k
            for j in range(rows.jacobian.shape[1]):
                rows.jacobian[row, j] = terms.contact_jacobian[i, k, j]
            speed, drift = terms.contact_velocity[i, k], terms.contact_drift[i, k]
            if phase.stance[i]:
                rows.weights[row] = params.stance_weight
                rows.desired[row] = -params.stance_damping * speed - drift
            else:
                rows.weights[row] = params.swing_weight
                desired = -params.swing_damping * speed
                if k == 2:
                    desired += params.swing_stiffness * (ground - terms.contact_position[i, 2])
                rows.desired[row] = desired - drift


@kernel
def step_rows(
    terms: DynamicsTerms, phase: PhaseState, params: ContactGains, rows: TaskRows
) -> None:
    """Give the points of a foot that takes a step their acceleration."""
    for i in range(phase.stepping.shape[0]):
        if not phase.stepping[i]:
            continue
        for k in range(3):
            row = 3 * i + k
            rows.weights[row] = params.step_weight
            rows.desired[row] = phase.step_acceleration[i, k] - terms.contact_drift[i, k]


@kernel
def planned_acceleration(
    velocity: int,
    terms: DynamicsTerms,
    target: WholeBodyTarget,
    joints: JointState,
    params: ContactGains,
) -> float:
    """Return the acceleration that keeps a joint, by its index in the generalised ``velocity``, on the plan:
    feedforward and feedback."""
    joint = velocity - (terms.velocity.shape[0] - joints.position.shape[0])
    found: float = (
        target.joint_acceleration[joint]
        + params.rolling_stiffness * (target.joint_position[joint] - joints.position[joint])
        + params.rolling_damping * (target.joint_velocity[joint] - terms.velocity[velocity])
    )
    return found


@kernel
def lifting_rows(
    terms: DynamicsTerms,
    target: WholeBodyTarget,
    joints: JointState,
    phase: PhaseState,
    legs: LiftingLegs,
    params: ContactGains,
    rows: TaskRows,
) -> None:
    """Replace the rows of ``contact_rows`` for points that leave the ground before lift-off.

    While another point of their foot is in stance these points are free to rise. Their velocity across the foot is
    damped, so that the foot rolls over its other points and does not rotate about the vertical. A row for the ankle
    controls how fast it rolls, because the motion of the centre of mass and the torso does not determine that. Where
    no point of the foot is in stance, all joints of the leg follow the plan.
    """
    damping = params.swing_damping
    for i in range(phase.stance.shape[0]):
        if phase.stance[i]:
            continue
        foot = legs.foot[i]
        row, desired, ankle = 3 * i, 0.0, legs.ankle[foot]
        if not has_contact(phase.stance, legs.foot, foot):
            for k in range(3):
                joint = legs.joint[row + k]
                rows.jacobian[row + k, :] = 0.0
                rows.weights[row + k] = 0.0
                if joint >= 0:
                    rows.jacobian[row + k, joint] = 1.0
                    rows.weights[row + k] = params.raised_weight
                    rows.desired[row + k] = planned_acceleration(
                        joint, terms, target, joints, params
                    )
            continue
        if ankle < 0:
            rows.desired[row + 2] = (
                -damping * terms.contact_velocity[i, 2] - terms.contact_drift[i, 2]
            )
            continue
        rows.jacobian[row, :] = 0.0
        for k in range(3):
            across = terms.foot_rotation[foot, k, 1]
            desired -= across * (damping * terms.contact_velocity[i, k] + terms.contact_drift[i, k])
            for j in range(rows.jacobian.shape[1]):
                rows.jacobian[row, j] += across * terms.contact_jacobian[i, k, j]
        rows.desired[row] = desired
        rows.jacobian[row + 1, :] = 0.0
        rows.jacobian[row + 1, ankle] = 1.0
        rows.desired[row + 1] = planned_acceleration(ankle, terms, target, joints, params)
        rows.weights[row] = params.swing_weight
        rows.weights[row + 1] = params.rolling_weight
        rows.weights[row + 2] = 0.0
