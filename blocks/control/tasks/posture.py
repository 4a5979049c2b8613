"""The task for joint angles: arms, waist and other joints that no other task determines."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase

import numpy as np

from ....mathematics.arrays import Indices1D
from ....mathematics.kernel import kernel
from ....robots.description import RobotDescription
from ....robots.limb import chain_to
from ....runtime.language.parameters import Parameters, parameter
from ...signals import DynamicsTerms, JointState, WholeBodyTarget
from .task import FeedbackTask, TaskError, TaskJacobian


class PostureGains(Parameters):
    """Weights and gains of joints towards their angles."""

    posture_weight: float | dict[str, float] = parameter(
        1.0, text="weight of a joint's angle, per rad/s^2; one number, or by joint name or pattern"
    )
    posture_stiffness: float = parameter(
        100.0, unit="1/s^2", ge=0.0, text="position gain of the joints"
    )
    posture_damping: float = parameter(20.0, unit="1/s", ge=0.0, text="velocity gain of the joints")


class PostureParameters(PostureGains):
    """The gains, and which joints they are for."""

    joints: list[str] = parameter(
        [], text="names or patterns of the joints; none: all that belong to no leg"
    )


class Posture(FeedbackTask):
    """Joints accelerate by q_ref'' + K_p (q_ref - q) + K_d (q_ref' - q'), one row a joint.

    They follow the target's joint angles; a plan keeps those that the robot's description holds at their angle,
    unless its task lets them move. By default the task is for the joints that belong to no leg, so that the
    program does not swing the arms to balance. With ``joints: ["*"]`` and a small weight it chooses
    one of the many solutions of a redundant robot.
    """

    Gains = PostureGains
    Params = PostureParameters
    gains_prefix = "posture_"
    params: PostureParameters

    @classmethod
    def row_count(cls, params: PostureParameters, robot: RobotDescription) -> int:
        return len(chosen_joints(robot, params))

    @classmethod
    def unmet_requirements(
        cls, params: PostureParameters, robot: RobotDescription
    ) -> Iterable[str]:
        names = [joint.name for joint in robot.joints]
        weights = params.posture_weight
        for pattern in [*params.joints, *(weights if isinstance(weights, dict) else ())]:
            if not any(fnmatchcase(name, pattern) for name in names):
                yield f"no joint of {robot.name} is called {pattern!r}; there are {', '.join(names)}"

    def setup(self) -> None:
        n = len(self.rows.desired)
        self.chosen = np.zeros(n, np.int64)

    def prepare(self) -> None:
        params, joints = self.params, self.robot.joints
        weights = params.posture_weight
        patterns = weights if isinstance(weights, dict) else {"*": weights}
        self.weight[:] = 0.0
        self.stiffness[:], self.damping[:] = params.posture_stiffness, params.posture_damping
        for row, joint in enumerate(chosen_joints(self.robot, params)):
            name = joints[joint].name
            self.chosen[row] = joint
            for pattern, weight in patterns.items():
                if fnmatchcase(name, pattern):
                    self.weight[row] = weight

    @kernel
    @staticmethod
    def error(
        terms: DynamicsTerms,
        joints: JointState,
        target: WholeBodyTarget,
        chosen: Indices1D,
        e: TaskError,
    ) -> None:
        first = terms.velocity.shape[0] - joints.position.shape[0]
        for row in range(chosen.shape[0]):
            joint = chosen[row]
            e.value[row] = target.joint_position[joint] - joints.position[joint]
            e.rate[row] = target.joint_velocity[joint] - terms.velocity[first + joint]
            e.feedforward[row] = target.joint_acceleration[joint]

    @kernel
    @staticmethod
    def jacobian(joints: JointState, chosen: Indices1D, j: TaskJacobian) -> None:
        first = j.matrix.shape[1] - joints.position.shape[0]
        j.matrix[:, :] = 0.0
        for row in range(chosen.shape[0]):
            j.matrix[row, first + chosen[row]] = 1.0


def chosen_joints(robot: RobotDescription, params: PostureParameters) -> list[int]:
    """Return the joints of the task, in the order of the description."""
    names = [joint.name for joint in robot.joints]
    if params.joints:
        return [k for k, n in enumerate(names) if any(fnmatchcase(n, p) for p in params.joints)]
    legs = {joint for foot in robot.feet for joint in chain_to(robot, foot.link)}
    return [k for k, name in enumerate(names) if k not in legs or name in robot.held]
