"""Motions of the whole body that follow from those of its feet, centre of mass and base.

``GuidedReference`` is the base of the blocks that play back such a motion.

In stance the feet stand still as far as their contact points can hold them: a point foot keeps its
position, a line foot its position and the direction of its line, a flat foot its whole pose. Given
as well are the velocity of the centre of mass and, for each axis, either the base's angular
velocity or the angular momentum. So the velocities v of all joints and the base follow from::

    [ A_l / m          ]       [ velocity of the centre of mass              ]
    [ A_k  or  base    ]  v  = [ angular momentum  or  turning rate          ]
    [ J of every foot  ]       [ its velocity; nothing it holds of its pose turns ]
    [ held joints      ]       [ 0                                           ]

For a biped with two line feet and five joints a leg, two flat feet and six joints, or four point
feet and three joints these are exactly as many rows as velocities. A body with more joints has a
choice; it takes the velocities nearest to those that lead back to its standing joints.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.elementary import atan2
from ...mathematics.kernel import kernel
from ...planner.library.jump_table import JumpTable, TableRows, table_rows
from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet
from ...robots.limb import FootKind, foot_shape
from ...robots.pinocchio_model import PinocchioModel
from ...runtime.language.block import Block, Input, Output, UnmetRequirement
from ...runtime.language.context import Clock, Context
from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, parameter
from ..signals import DelayEstimate, JumpReference
from .table_reading import read_table

_STEP = 0.002
"""Longest step of the integration [s]."""
_RETURN_RATE = 2.0
"""The rate at which redundant joints return to their standing position [1/s]."""
NEVER = 1e6
"""The time [s] of a lift-off that is not planned."""
ROWS_OF_FOOT = {FootKind.POINT: 3, FootKind.LINE: 5, FootKind.FLAT: 6}
"""The number of velocities that a foot on the ground constrains."""


@dataclass
class GuidedMotion:
    """The desired motion of the body at one instant.

    ``rotation`` is, axis by axis, the angular momentum about the centre of mass [N m s, world]
    where ``by_momentum`` is true, otherwise the base's angular velocity [rad/s, body frame].
    ``foot_velocity`` is the velocity of the feet on the ground, zero for feet that stand, or of the
    sole centres when ``flying``.
    """

    com: Array
    com_velocity: Array
    com_acceleration: Array
    rotation: Array
    rotation_rate: Array
    by_momentum: tuple[bool, bool, bool]
    foot_velocity: Array
    flying: bool = False


def missing_joints(robot: RobotDescription) -> int:
    """Count the joints that a robot lacks to control its centre of mass and its base."""
    rows = sum(ROWS_OF_FOOT[foot_shape(robot, foot)[0]] for foot in range(len(robot.feet)))
    return max(0, rows - (len(robot.joints) - len(robot.held)))


def too_few_joints(robot: RobotDescription | None) -> Iterator[UnmetRequirement]:
    """Report a robot that lacks joints to move its centre of mass and base while it stands."""
    assert robot is not None
    missing = missing_joints(robot)
    if missing:
        yield UnmetRequirement(
            f"{robot.name} lacks {missing} joints to move its centre of mass and its base with "
            "all feet on the ground",
            expected=f"{len(robot.joints) + missing} joints that are not held",
            found=f"{len(robot.joints) - len(robot.held)}",
        )


class GuidedBody:
    """The robot's model, which computes the generalised velocity of a motion."""

    def __init__(self, built: PinocchioModel, robot: RobotDescription) -> None:
        import pinocchio

        missing = missing_joints(robot)
        if missing:
            raise BlockError(
                f"{robot.name}: its feet on the ground fix {missing} velocities more than its "
                f"joints have, so its centre of mass and base cannot be guided"
            )
        self.pinocchio: Any = pinocchio
        self.model = built.model
        self.data = built.model.createData()
        self.soles, self.contacts = built.sole_frames, built.contact_frames
        self.name, self.mass = robot.name, robot.total_mass
        self._shapes = [foot_shape(robot, foot) for foot in range(len(robot.feet))]
        self._first = np.cumsum([6, *(ROWS_OF_FOOT[kind] for kind, _ in self._shapes)]).tolist()
        joints = [joint.name for joint in robot.joints]
        self._held = {joints.index(name): angle for name, angle in robot.held.items()}
        rows, n = self._first[-1] + len(self._held), built.model.nv
        self._matrix, self._wanted = np.zeros((rows, n)), np.zeros(rows)
        for row, joint in enumerate(self._held):
            self._matrix[self._first[-1] + row, 6 + joint] = 1.0
        self._stance = robot.standing_position.copy()
        self._stance[list(self._held)] = list(self._held.values())
        self._choice = np.zeros(n)
        self._balls = {ball.foot: ball for ball in ball_feet(robot)}

    def standing(self, joints: Array) -> Array:
        """Return the configuration with these joint angles, upright, the soles' middle at the origin.

        Joints that the description holds have their held angle.
        """
        q = np.array(self.pinocchio.neutral(self.model))
        q[7:] = joints
        for joint, angle in self._held.items():
            q[7 + joint] = angle
        q[0:3] -= self.feet(q).mean(axis=0)
        return q

    def feet(self, q: Array) -> Array:
        """Return the sole centres (n_feet, 3) [m]; for a ball foot its lowest point."""
        self.pinocchio.framesForwardKinematics(self.model, self.data, q)
        return np.array([self._sole(foot) for foot in range(len(self.soles))])

    def _sole(self, foot: int) -> Array:
        ball, place = self._balls.get(foot), self.data.oMf[self.soles[foot]]
        if ball is None:
            return np.array(place.translation)
        joint = self.data.oMi[self.model.frames[self.soles[foot]].parentJoint]
        return np.asarray(joint.act(ball.centre) - [0.0, 0.0, ball.radius])

    def contact_points(self, q: Array) -> Array:
        """Return the places of all contact points (n_contacts, 3) [m]."""
        self.pinocchio.framesForwardKinematics(self.model, self.data, q)
        return np.array([self.data.oMf[frame].translation for frame in self.contacts])

    def com(self, q: Array) -> Array:
        """Return the centre of mass (3,) [m]."""
        return np.array(self.pinocchio.centerOfMass(self.model, self.data, q))

    def radii_of_inertia(self, q: Array) -> Array:
        """Return the radii of inertia of the whole body about three axes through its centre of mass [m], (3,)."""
        self.pinocchio.ccrba(self.model, self.data, q, np.zeros(self.model.nv))
        return np.sqrt(np.diag(self.data.Ig.inertia) / self.mass)

    def pitch(self, q: Array) -> float:
        """Return the forward pitch of the torso [rad]."""
        return 2.0 * atan2(float(q[4]), float(q[6]))

    def angular_momentum(self, q: Array, v: Array) -> Array:
        """Return the angular momentum about the centre of mass [N m s, world], (3,)."""
        self.pinocchio.computeCentroidalMomentum(self.model, self.data, q, v)
        return np.array(self.data.hg.angular)

    def velocity(self, q: Array, motion: GuidedMotion) -> Array:
        """Return the generalised velocity of the motion."""
        pin, matrix, wanted = self.pinocchio, self._matrix, self._wanted
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        centroidal = pin.computeCentroidalMap(self.model, self.data, q)
        matrix[: self._first[-1]] = 0.0
        matrix[0:3] = centroidal[0:3] / self.mass
        wanted[0:3] = motion.com_velocity
        for axis in range(3):
            if motion.by_momentum[axis]:
                matrix[3 + axis] = centroidal[3 + axis]
            else:
                matrix[3 + axis, 3 + axis] = 1.0
        wanted[3:6] = motion.rotation
        for foot, frame in enumerate(self.soles):
            row, end = self._first[foot], self._first[foot + 1]
            jacobian = pin.getFrameJacobian(
                self.model, self.data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            matrix[row : row + 3] = self._place_rows(foot, jacobian, motion.flying)
            matrix[row + 3 : end] = self._turning_rows(foot, jacobian[3:6])
            wanted[row : row + 3] = motion.foot_velocity[foot]
            wanted[row + 3 : end] = 0.0
        if matrix.shape[0] == matrix.shape[1]:
            try:
                return np.linalg.solve(matrix, wanted)
            except np.linalg.LinAlgError:
                raise BlockError(
                    f"{self.name}: in this pose its legs cannot move its centre of mass and base in all "
                    "directions; give it another standing pose, with no leg stretched"
                ) from None
        choice = self._choice
        choice[6:] = _RETURN_RATE * (self._stance - q[7:])
        found = np.linalg.lstsq(matrix, wanted - matrix @ choice)[0]
        return np.asarray(choice + found)

    def _place_rows(self, foot: int, jacobian: Array, flying: bool) -> Array:
        """Return the rows (3, n) of a foot's velocity, from the Jacobian (6, n) of its sole's frame."""
        ball = self._balls.get(foot)
        if ball is None:
            return jacobian[0:3]
        # A ball rolls: on the ground the material at its lowest point stands still, while that
        # point moves along with the ball's centre, whose velocity is prescribed in flight.
        place = self.data.oMf[self.soles[foot]].translation
        lever = self._sole(foot) - place
        if flying:
            lever[2] += ball.radius
        x, y, z = lever
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.asarray(jacobian[0:3] - skew @ jacobian[3:6])

    def _turning_rows(self, foot: int, turning: Array) -> Array:
        """Return the rows of a foot's angular velocity (3, n) in the world that contacts constrain."""
        kind, line = self._shapes[foot]
        if kind == FootKind.POINT:
            return turning[:0]
        if kind == FootKind.FLAT:
            return turning
        ahead: Array = self.data.oMf[self.soles[foot]].rotation @ line
        if abs(float(ahead[0])) > 1.0 - 1e-9:
            return turning[1:]
        # The two directions at right angles to the line, about which the foot cannot rotate.
        first = np.cross(ahead, np.eye(3)[int(np.abs(ahead).argmin())])
        first /= np.linalg.norm(first)
        return np.asarray(np.stack([first, np.cross(ahead, first)]) @ turning)

    def integrate(self, q: Array, v: Array) -> Array:
        """Return the configuration after moving by ``v``."""
        return np.array(self.pinocchio.integrate(self.model, q, v))


class MotionRecorder:
    """Integrates a motion and records the rows of the plan."""

    def __init__(self, body: GuidedBody, q: Array) -> None:
        self.body = body
        self.q = q
        self.now = 0.0
        self.time: list[float] = []
        self.rows: dict[str, list[Array]] = {}

    def run(
        self, duration: float, motion: Callable[[float], GuidedMotion], keep: bool = True
    ) -> None:
        """Integrate a motion over ``duration`` [s], by the Runge-Kutta method of order four."""
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

    def _keep(self, time: float, motion: GuidedMotion, v: Array) -> None:
        body, q = self.body, self.q
        prescribed = np.array(motion.by_momentum)
        momentum = np.where(prescribed, motion.rotation, body.angular_momentum(q, v))
        rate = np.where(prescribed, motion.rotation_rate, 0.0)
        values = {
            "com": motion.com, "com_velocity": motion.com_velocity,
            "com_acceleration": motion.com_acceleration, "orientation": q[3:7],
            "angular_velocity": v[3:6], "angular_acceleration": np.zeros(3), "angular_momentum": momentum,
            "angular_momentum_rate": rate, "foot_position": body.feet(q),
            "foot_velocity": motion.foot_velocity, "foot_yaw": np.zeros(len(body.soles)),
            "joint_position": q[7:], "joint_velocity": v[6:],
            "joint_torque": np.zeros(len(v) - 6), "joint_acceleration": np.zeros(len(v) - 6),
            "foot_pitch": np.zeros(len(body.soles)),
        }  # fmt: skip
        self.time.append(time)
        for name, value in values.items():
            self.rows.setdefault(name, []).append(np.array(value))


def check_limits(robot: RobotDescription, columns: dict[str, Array]) -> None:
    """Refuse a motion that exceeds the robot's limits.

    Args:
        robot: the robot with its joint limits and motor speeds.
        columns: from ``MotionRecorder.rows``, as arrays.

    Raises:
        BlockError: a joint passes its limit or a motor its speed.
    """
    hint = "ask for less: a smaller rise, distance, lean or squat_depth"
    angles, limits = columns["joint_position"], robot.joint_limits
    excess = np.maximum(angles - limits[:, 1], limits[:, 0] - angles).max(axis=0)
    worst = int(excess.argmax())
    if excess[worst] > 0.0:
        joint = robot.joints[worst]
        raise BlockError(
            f"this motion takes {joint.name} {excess[worst]:.3f} {joint.unit('rad')} past its limit; "
            + hint
        )
    speeds = np.abs(columns["joint_velocity"] @ robot.joint_to_motor.T).max(axis=0)
    most = robot.motors.no_load_speed
    worst = int((speeds - most).argmax())
    if speeds[worst] > most[worst]:
        unit = robot.motor_unit(worst, "rad/s")
        raise BlockError(
            f"this motion turns {robot.transmission.motors[worst]} at {speeds[worst]:.1f} {unit}, "
            f"but {robot.motors.profile} reaches {most[worst]:.1f} {unit}; {hint}"
        )


class GuidedParameters(Parameters):
    """The parameter of all references that guide the whole body from a few numbers."""

    lead: float = parameter(
        0.002, unit="s", ge=0.0, le=0.02, text="delay from sensing to torque that is compensated"
    )


class GuidedReference(Block):
    """A table made at load, of which each tick publishes its instant, or the one ``delay.ahead`` later."""

    Params = GuidedParameters
    needs = ("floating base", "feet")
    params: GuidedParameters
    delay = Input(DelayEstimate, default={}, text="lead time of the controller")
    reference = Output(JumpReference, text="the plan at the present instant")
    hold = 0.0
    """Time [s] over which the feedforward is averaged."""

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report too few joints to move the centre of mass and the base with all feet standing."""
        return too_few_joints(context.robot)

    @abstractmethod
    def make_table(self) -> JumpTable:
        """Compute the motion of the block's robot."""

    def setup(self) -> None:
        self.table = table_rows(self.make_table())

    @kernel
    @staticmethod
    def step(
        delay: DelayEstimate,
        reference: JumpReference,
        table: TableRows,
        hold: float,
        params: GuidedParameters,
        clock: Clock,
    ) -> None:
        time = clock.base_period * clock.tick + delay.ahead
        read_table(table, time, params.lead, hold, reference)
