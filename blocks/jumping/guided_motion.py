"""Motions of the whole body that follow from what its feet, centre and rotation are to do.

Two line feet leave a body with five-joint legs exactly six freedoms in stance: where its centre
of mass is, and how it turns. So the velocity of all joints follows from ten rows that say what
the feet do and six that say how the centre of mass moves and, axis by axis, either how the torso
turns or what angular momentum there is::

    [ A_l / m          ]       [ com velocity                ]
    [ A_k  or  base    ]  v  = [ k  or  torso rate           ]
    [ J of every sole  ]       [ its velocity; no pitch, yaw ]
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ...robots.pinocchio_model import PinocchioModel
from ...runtime.language.errors import BlockError

Array = NDArray[np.float64]

_STEP = 0.002
"""Longest step of the integration [s]."""


@dataclass
class Motion:
    """What the body is to do at one instant.

    ``rotation`` is, axis by axis, the angular momentum about the centre of mass [N m s, world]
    where ``by_momentum`` says so, else the torso's rate [rad/s, body frame].
    """

    com: Array
    com_velocity: Array
    com_acceleration: Array
    rotation: Array
    rotation_rate: Array
    by_momentum: tuple[bool, bool, bool]
    foot_velocity: Array


class GuidedBody:
    """The robot's model, asked for the velocity that a motion needs."""

    def __init__(self, built: PinocchioModel, robot: RobotDescription) -> None:
        import pinocchio

        self.pinocchio: Any = pinocchio
        self.model = built.model
        self.data = built.model.createData()
        self.soles = built.sole_frames
        self.mass = robot.total_mass
        n = built.model.nv
        if n != 6 + 5 * len(self.soles):
            raise BlockError(
                f"{robot.name}: a squat jump is planned for legs of five joints each; expected "
                f"{5 * len(self.soles)} joints for {len(self.soles)} feet, found {n - 6}"
            )
        self._matrix = np.zeros((n, n))
        self._right = np.zeros(n)

    def standing(self, joints: Array) -> Array:
        """The configuration with these joint angles, upright, the soles' middle at the origin."""
        q = np.array(self.pinocchio.neutral(self.model))
        q[7:] = joints
        q[0:3] -= self.feet(q).mean(axis=0)
        return q

    def feet(self, q: Array) -> Array:
        """The sole centres (n_feet, 3)."""
        self.pinocchio.framesForwardKinematics(self.model, self.data, q)
        return np.array([self.data.oMf[frame].translation for frame in self.soles])

    def com(self, q: Array) -> Array:
        """The centre of mass (3,)."""
        return np.array(self.pinocchio.centerOfMass(self.model, self.data, q))

    def pitch(self, q: Array) -> float:
        """The forward pitch of the torso [rad]."""
        return 2.0 * math.atan2(float(q[4]), float(q[6]))

    def angular_momentum(self, q: Array, v: Array) -> Array:
        """About the centre of mass (3,)."""
        self.pinocchio.computeCentroidalMomentum(self.model, self.data, q, v)
        return np.array(self.data.hg.angular)

    def velocity(self, q: Array, motion: Motion) -> Array:
        """The generalised velocity of the motion."""
        pin, matrix, right = self.pinocchio, self._matrix, self._right
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        centroidal = pin.computeCentroidalMap(self.model, self.data, q)
        matrix[:] = 0.0
        matrix[0:3] = centroidal[0:3] / self.mass
        right[0:3] = motion.com_velocity
        for axis in range(3):
            if motion.by_momentum[axis]:
                matrix[3 + axis] = centroidal[3 + axis]
            else:
                matrix[3 + axis, 3 + axis] = 1.0
        right[3:6] = motion.rotation
        for foot, frame in enumerate(self.soles):
            row = 6 + 5 * foot
            jacobian = pin.getFrameJacobian(
                self.model, self.data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            matrix[row : row + 3] = jacobian[0:3]
            matrix[row + 3 : row + 5] = jacobian[4:6]
            right[row : row + 3] = motion.foot_velocity[foot]
            right[row + 3 : row + 5] = 0.0
        return np.linalg.solve(matrix, right)

    def integrate(self, q: Array, v: Array) -> Array:
        """The configuration after moving by ``v``."""
        return np.array(self.pinocchio.integrate(self.model, q, v))


class MotionRecorder:
    """Rows of the plan as they are found."""

    def __init__(self, body: GuidedBody, q: Array) -> None:
        self.body = body
        self.q = q
        self.now = 0.0
        self.time: list[float] = []
        self.rows: dict[str, list[Array]] = {}

    def run(self, duration: float, motion: Callable[[float], Motion], keep: bool = True) -> None:
        """Follow a motion for a while, by Runge and Kutta's method of order four."""
        body, count = self.body, max(2, math.ceil(duration / _STEP))
        h = duration / count
        for i in range(count + 1):
            t = i * h
            first = motion(t)
            k1 = body.velocity(self.q, first)
            if keep:
                self._keep(self.now + t, first, k1)
            if i == count:
                break
            middle = motion(t + 0.5 * h)
            k2 = body.velocity(body.integrate(self.q, 0.5 * h * k1), middle)
            k3 = body.velocity(body.integrate(self.q, 0.5 * h * k2), middle)
            k4 = body.velocity(body.integrate(self.q, h * k3), motion(t + h))
            self.q = body.integrate(self.q, h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
        self.now += duration

    def _keep(self, time: float, motion: Motion, v: Array) -> None:
        body, q = self.body, self.q
        prescribed = np.array(motion.by_momentum)
        momentum = np.where(prescribed, motion.rotation, body.angular_momentum(q, v))
        rate = np.where(prescribed, motion.rotation_rate, 0.0)
        values = {
            "com": motion.com, "com_velocity": motion.com_velocity,
            "com_acceleration": motion.com_acceleration, "orientation": q[3:7],
            "angular_velocity": v[3:6], "angular_momentum": momentum,
            "angular_momentum_rate": rate, "foot_position": body.feet(q),
            "foot_velocity": motion.foot_velocity, "foot_yaw": np.zeros(len(body.soles)),
            "joint_position": q[7:], "joint_velocity": v[6:],
            "joint_torque": np.zeros(len(v) - 6), "joint_acceleration": np.zeros(len(v) - 6),
            "foot_pitch": np.zeros(len(body.soles)),
        }  # fmt: skip
        self.time.append(time)
        for name, value in values.items():
            self.rows.setdefault(name, []).append(np.array(value))
