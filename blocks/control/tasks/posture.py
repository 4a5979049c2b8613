"""The task for joint angles: arms, waist and other joints that no other task determines."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from ....mathematics.arrays import Array1D, Flags, Flags1D, Indices, Indices1D
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.kernel import kernel
from ....mathematics.whole_body_qp import TaskRows
from ....robots.description import RobotDescription
from ....runtime.language.parameters import Parameters, parameter
from .foot_joints import leg_joints
from .task import KernelTask, Situation


class PostureGains(Parameters):
    """Weights and gains of joints towards their angles."""

    posture_weight: float | dict[str, float] = parameter(
        1.0, text="weight of a joint's angle, per rad/s^2; one number, or by joint name or pattern"
    )
    posture_stiffness: float = parameter(
        100.0, unit="1/s^2", ge=0.0, text="position gain of the joints"
    )
    posture_damping: float = parameter(20.0, unit="1/s", ge=0.0, text="velocity gain of the joints")


class PostureChoice(PostureGains):
    """The gains, and which joints they are for."""

    joints: list[str] = parameter(
        [], text="names or patterns of the joints; none: all that belong to no leg"
    )


class Feedback(NamedTuple):
    """Weights by row (n,), and the two gains."""

    weight: Array1D
    stiffness: float
    damping: float


class JointTargets(NamedTuple):
    """Joint angles [rad], velocities and accelerations by row, (n,) each."""

    position: Array1D
    velocity: Array1D
    acceleration: Array1D


class Posture(KernelTask):
    """Joints accelerate by q_ref'' + K_p (q_ref - q) + K_d (q_ref' - q'), one row a joint.

    Joints that the robot's description holds stand still at their angle; others follow the
    target's joint angles. By default the task is for the joints that belong to no leg, so that the
    program does not swing the arms to balance. With ``joints: ["*"]`` and a small weight it chooses
    one of the many solutions of a redundant robot.
    """

    Gains = PostureChoice

    def __init__(self, situation: Situation, rows: TaskRows) -> None:
        super().__init__(situation, rows)
        self._joints: Indices = np.zeros(rows.desired.shape[0], dtype=np.int64)
        n = len(self._joints)
        self._reference = JointTargets(np.zeros(n), np.zeros(n), np.zeros(n))
        robot = situation.robot
        target = situation.target
        self._planned = JointTargets(
            target.joint_position, target.joint_velocity, target.joint_acceleration
        )
        self._is_held: Flags = np.array([joint.name in robot.held for joint in robot.joints])
        self._held = np.array([robot.held.get(joint.name, 0.0) for joint in robot.joints])

    @classmethod
    def row_count(cls, robot: RobotDescription, gains: PostureChoice) -> int:
        return len(chosen_joints(robot, gains))

    @classmethod
    def misfits(cls, robot: RobotDescription, gains: PostureChoice) -> Iterable[str]:
        names = [joint.name for joint in robot.joints]
        weights = gains.posture_weight
        for pattern in [*gains.joints, *(weights if isinstance(weights, dict) else ())]:
            if not any(fnmatchcase(name, pattern) for name in names):
                yield f"no joint of {robot.name} is called {pattern!r}; there are {', '.join(names)}"

    def prepare(self, gains: PostureChoice) -> KernelCall:
        robot = self.situation.robot
        chosen = chosen_joints(robot, gains)
        self._joints[:] = chosen
        weights = gains.posture_weight
        patterns = weights if isinstance(weights, dict) else {"*": weights}
        by_row = np.zeros(len(chosen))
        for row, joint in enumerate(chosen):
            for pattern, weight in patterns.items():
                if fnmatchcase(robot.joints[joint].name, pattern):
                    by_row[row] = weight
        feedback = Feedback(by_row, gains.posture_stiffness, gains.posture_damping)
        return KernelCall(
            posture_task, self._joints, self._is_held, self._held, self._planned,
            self.situation.joints.position, self.situation.terms.velocity, self._reference,
            feedback, self.rows,
        )  # fmt: skip


def chosen_joints(robot: RobotDescription, gains: PostureChoice) -> list[int]:
    """The joints of the task, in the order of the description."""
    names = [joint.name for joint in robot.joints]
    if gains.joints:
        return [k for k, n in enumerate(names) if any(fnmatchcase(n, p) for p in gains.joints)]
    legs = {joint for foot in range(len(robot.feet)) for joint in leg_joints(robot, foot)}
    return [k for k, name in enumerate(names) if k not in legs or name in robot.held]


@kernel
def posture_task(
    joints: Indices1D,
    is_held: Flags1D,
    held: Array1D,
    planned: JointTargets,
    position: Array1D,
    velocity: Array1D,
    reference: JointTargets,
    gains: Feedback,
    rows: TaskRows,
) -> None:
    """``posture_rows`` towards the plan, or for held joints towards their angle.

    Args:
        is_held, held: which joints are held, and at which angle [rad], (n_joints,) each.
        planned: the plan's joints, (n_joints,) each.
        reference: scratch, by row.
    """
    for row in range(joints.shape[0]):
        joint = joints[row]
        if is_held[joint]:
            reference.position[row] = held[joint]
            reference.velocity[row] = reference.acceleration[row] = 0.0
        else:
            reference.position[row] = planned.position[joint]
            reference.velocity[row] = planned.velocity[joint]
            reference.acceleration[row] = planned.acceleration[joint]
    posture_rows(joints, position, velocity, reference, gains, rows)


@kernel
def posture_rows(
    joints: Indices1D,
    position: Array1D,
    velocity: Array1D,
    reference: JointTargets,
    gains: Feedback,
    rows: TaskRows,
) -> None:
    """One row for each of the ``joints``: its own acceleration [rad/s^2].

    Args:
        position: measured joint angles, (n_joints,).
        velocity: generalised velocity, (n_velocities,).
    """
    first = velocity.shape[0] - position.shape[0]
    rows.jacobian[:, :] = 0.0
    for row in range(joints.shape[0]):
        joint = joints[row]
        rows.jacobian[row, first + joint] = 1.0
        rows.desired[row] = (
            float(reference.acceleration[row])
            + gains.stiffness * (float(reference.position[row]) - position[joint])
            + gains.damping * (float(reference.velocity[row]) - velocity[first + joint])
        )
        rows.weights[row] = gains.weight[row]
