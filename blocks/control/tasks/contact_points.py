"""The task for the contact points: at rest in stance, otherwise going down or lifting off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....mathematics.arrays import (
    Array1D,
    Array3D,
    Flags1D,
    Indices0D,
    Indices1D,
    Rows3,
)
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.kernel import kernel
from ....mathematics.whole_body_qp import TaskRows
from ....robots.description import RobotDescription
from ....runtime.language.parameters import Parameters, parameter
from ...signals import Phase
from .foot_joints import rolling_joint
from .task import KernelTask, Situation

_THRUST = int(Phase.THRUST)


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


class PointGains(NamedTuple):
    """``ContactGains`` as a kernel takes them."""

    stance_weight: float
    stance_damping: float
    swing_weight: float
    swing_stiffness: float
    swing_damping: float
    step_weight: float
    rolling_weight: float
    rolling_stiffness: float
    rolling_damping: float


class Points(NamedTuple):
    """The contact points: (n, 3, n_velocities), then (n, 3) each [m, m/s, m/s^2, world]."""

    jacobian: Array3D
    drift: Rows3
    position: Rows3
    velocity: Rows3


class Steps(NamedTuple):
    """The points of a foot that takes a step, (n,), and their acceleration [m/s^2, world] (n, 3)."""

    stepping: Flags1D
    acceleration: Rows3


class Ankles(NamedTuple):
    """The joint that each foot rolls with: its index in the generalised velocity, -1 for none, and
    its desired acceleration [rad/s^2], (n_feet,) each."""

    place: Indices1D
    acceleration: Array1D


class JointMotion(NamedTuple):
    """Joint angles [rad], velocities and accelerations, (n_joints,) each."""

    position: Array1D
    velocity: Array1D
    acceleration: Array1D


class ContactPoints(KernelTask):
    """Points in stance do not accelerate (paper, V, task 1): J a + drift = -damping velocity.

    Points that are not in stance while others are go to the ground, at the mean height of the
    points in stance: a task of zero acceleration would never close a gap, and the program would
    rely on the force of a heel that hovers. In THRUST such points are lifting off. Those of a foot
    with an ankle are free to rise, as the heels do while the toes still push, and are damped across
    their foot, while the ankle follows the plan with feedforward and feedback. The points of a foot
    without an ankle (see ``foot_joints.rolling_joint``) only have their velocity damped.

    Points of a foot that takes a step have the acceleration that ``PhaseState`` gives them.
    """

    Gains = ContactGains

    def __init__(self, situation: Situation, rows: TaskRows) -> None:
        super().__init__(situation, rows)
        robot, terms, target = situation.robot, situation.terms, situation.target
        self._points = Points(
            terms.contact_jacobian, terms.contact_drift, terms.contact_position,
            terms.contact_velocity,
        )  # fmt: skip
        self._steps = Steps(situation.phase.stepping, situation.phase.step_acceleration)
        self._foot = np.array(robot.foot_of_contact(), dtype=np.int64)
        joints = [rolling_joint(robot, foot) for foot in range(len(robot.feet))]
        first = robot.base_velocities
        places = [-1 if joint is None else first + joint for joint in joints]
        self._ankles = Ankles(np.array(places, dtype=np.int64), np.zeros(len(joints)))
        self._planned = JointMotion(
            target.joint_position, target.joint_velocity, target.joint_acceleration
        )

    @classmethod
    def row_count(cls, robot: RobotDescription, gains: ContactGains) -> int:
        return 3 * len(robot.contacts)

    def prepare(self, gains: ContactGains) -> KernelCall:
        now = self.situation
        numbers = {name: float(getattr(gains, name)) for name in PointGains._fields}
        return KernelCall(
            contact_task, self._points, now.phase.stance, self._steps, now.phase.phase, self._foot,
            now.terms.foot_rotation, self._planned, now.joints.position, now.terms.velocity,
            self._ankles, PointGains(**numbers), self.rows,
        )  # fmt: skip


@kernel
def contact_task(
    points: Points,
    stance: Flags1D,
    steps: Steps,
    phase: Indices0D,
    foot: Indices1D,
    foot_rotation: Array3D,
    planned: JointMotion,
    position: Array1D,
    velocity: Array1D,
    ankles: Ankles,
    gains: PointGains,
    rows: TaskRows,
) -> None:
    """All rows of the task.

    Args:
        phase: the phase of the jump, of shape ().
        foot, foot_rotation: as for ``lifting_rows``.
        position, velocity: as for ``follow_plan``.
    """
    contact_rows(
        points, stance, gains.stance_weight, gains.stance_damping, gains.swing_weight,
        gains.swing_stiffness, gains.swing_damping, rows,
    )  # fmt: skip
    step_rows(points, steps, gains.step_weight, rows)
    if phase[()] == _THRUST:
        follow_plan(
            planned, position, velocity, gains.rolling_stiffness, gains.rolling_damping, ankles
        )
        lifting_rows(
            points, stance, foot, foot_rotation, ankles, gains.swing_weight,
            gains.swing_damping, gains.rolling_weight, rows,
        )  # fmt: skip


@kernel
def contact_rows(
    points: Points,
    stance: Flags1D,
    stance_weight: float,
    stance_damping: float,
    swing_weight: float,
    swing_stiffness: float,
    swing_damping: float,
    rows: TaskRows,
) -> None:
    """Three rows for each contact point: zero acceleration in stance, else a pull to the ground.

    A spring and a damper bring the height of a point that is not in stance to the mean height of
    the points in stance, and its horizontal velocity is damped.
    """
    count = stance.shape[0]
    ground, loaded = 0.0, 0
    for i in range(count):
        if stance[i]:
            ground += float(points.position[i, 2])
            loaded += 1
    ground = ground / loaded if loaded else 0.0
    for i in range(count):
        for k in range(3):
            row = 3 * i + k
            for j in range(rows.jacobian.shape[1]):
                rows.jacobian[row, j] = points.jacobian[i, k, j]
            speed, drift = float(points.velocity[i, k]), float(points.drift[i, k])
            if stance[i]:
                rows.weights[row] = stance_weight
                rows.desired[row] = -stance_damping * speed - drift
            else:
                rows.weights[row] = swing_weight
                wanted = -swing_damping * speed
                if k == 2:
                    wanted += swing_stiffness * (ground - float(points.position[i, 2]))
                rows.desired[row] = wanted - drift


@kernel
def step_rows(points: Points, steps: Steps, weight: float, rows: TaskRows) -> None:
    """Give the points of a foot that takes a step their acceleration."""
    for i in range(steps.stepping.shape[0]):
        if not steps.stepping[i]:
            continue
        for k in range(3):
            row = 3 * i + k
            rows.weights[row] = weight
            rows.desired[row] = float(steps.acceleration[i, k]) - float(points.drift[i, k])


@kernel
def follow_plan(
    planned: JointMotion,
    position: Array1D,
    velocity: Array1D,
    stiffness: float,
    damping: float,
    ankles: Ankles,
) -> None:
    """Compute the acceleration that keeps every ankle on the plan: feedforward and feedback.

    Args:
        position: measured joint angles, (n_joints,).
        velocity: generalised velocity, (n_velocities,).
    """
    first = velocity.shape[0] - position.shape[0]
    for foot in range(ankles.place.shape[0]):
        place = int(ankles.place[foot])
        if place >= 0:
            joint = place - first
            ankles.acceleration[foot] = (
                float(planned.acceleration[joint])
                + stiffness * (float(planned.position[joint]) - position[joint])
                + damping * (float(planned.velocity[joint]) - velocity[place])
            )


@kernel
def lifting_rows(
    points: Points,
    stance: Flags1D,
    foot: Indices1D,
    foot_rotation: Array3D,
    ankles: Ankles,
    weight: float,
    damping: float,
    ankle_weight: float,
    rows: TaskRows,
) -> None:
    """Replace the rows of ``contact_rows`` for points that leave the ground before lift-off.

    These points are free to rise. Their velocity across the foot is damped, so that the foot rolls
    over its other points and does not rotate about the vertical. A row for the ankle controls how
    fast it rolls, because the motion of the centre of mass and the torso does not determine that.
    Points of a foot without an ankle have all of their velocity damped.

    Args:
        foot: the foot of every point, (n_contacts,).
        foot_rotation: rotations from foot to world, (n_feet, 3, 3).
    """
    for i in range(stance.shape[0]):
        if stance[i]:
            continue
        row, wanted, ankle = 3 * i, 0.0, int(ankles.place[foot[i]])
        if ankle < 0:
            rows.desired[row + 2] = -damping * float(points.velocity[i, 2]) - float(
                points.drift[i, 2]
            )
            continue
        rows.jacobian[row, :] = 0.0
        for k in range(3):
            across = foot_rotation[foot[i], k, 1]
            wanted -= across * (damping * float(points.velocity[i, k]) + float(points.drift[i, k]))
            for j in range(rows.jacobian.shape[1]):
                rows.jacobian[row, j] += across * float(points.jacobian[i, k, j])
        rows.desired[row] = wanted
        rows.jacobian[row + 1, :] = 0.0
        rows.jacobian[row + 1, ankle] = 1.0
        rows.desired[row + 1] = ankles.acceleration[foot[i]]
        rows.weights[row], rows.weights[row + 1], rows.weights[row + 2] = weight, ankle_weight, 0.0
