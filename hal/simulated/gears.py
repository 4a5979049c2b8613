"""Gears that yield: rotor and joint are two bodies with a spring, a damper and play between them.

With ``A`` the transmission's ``joint_to_motor``, a motor's rotor has the angle ``theta`` at the output of
its gear, and the twist ``theta - A q`` beyond half the play is held by the spring::

    I theta'' = kappa - k twist - d twist'        tau = A^T (k twist + d twist')

``kappa`` is the motor's torque and ``tau`` what the joints get. The simulator's bodies then have no rotor
inertia of their own but that of the gear's output stage. Both sides are integrated with the physics' steps, semi-implicitly: a step must be
short beside the period of the fastest rotor against its link (``longest_step``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...robots.description import RobotDescription
from ...runtime.language.steps import signal_call
from .drives import MotorLimits
from .effect import Effect, StepViews
from .effects import GearParameters
from .state import PhysicsState


class GearTrain(NamedTuple):
    """The gears: maps between motors and joints, (n, n), the rotors' ``inertia`` (n,) [kg m^2],
    ``stiffness`` [N m/rad], ``damping`` [N m s/rad] and half the ``play`` [rad]; step [s]."""

    to_motor: Array2D
    torque_to_motor: Array2D
    to_joint: Array2D
    motion_to_joint: Array2D
    inertia: Array1D
    stiffness: float
    damping: float
    play: float
    timestep: float


class GearScratch(NamedTuple):
    """Of a physics step, (n,): motor torque, joint angle and speed at the motor, torque of the gear."""

    torque: Array1D
    angle: Array1D
    speed: Array1D
    passed: Array1D


@kernel
def turn_gears(
    position: Array1D, velocity: Array1D, train: GearTrain, scratch: GearScratch,
    memory: PhysicsState, torque: Array1D,
) -> None:  # fmt: skip
    """Change the joint ``torque`` [N m] from that of the motors to that behind the gears, and turn the rotors.

    Args:
        position, velocity: the true motion of the joints [rad, rad/s].
    """
    multiply_vector(train.torque_to_motor, torque, scratch.torque)
    multiply_vector(train.to_motor, position, scratch.angle)
    multiply_vector(train.to_motor, velocity, scratch.speed)
    for k in range(scratch.torque.shape[0]):
        twist = memory.rotor_angle[k] - scratch.angle[k]
        held = 0.0
        if twist > train.play:
            held = twist - train.play
        elif twist < -train.play:
            held = twist + train.play
        passed = train.stiffness * held
        if held != 0.0 or train.play == 0.0:
            passed += train.damping * (memory.rotor_speed[k] - scratch.speed[k])
        scratch.passed[k] = passed
        if train.inertia[k] > 0.0:
            turning = (scratch.torque[k] - passed) / train.inertia[k]
            memory.rotor_speed[k] += turning * train.timestep
            memory.rotor_angle[k] += memory.rotor_speed[k] * train.timestep
    multiply_vector(train.to_joint, scratch.passed, torque)


@kernel
def sense_rotors(
    train: GearTrain, memory: PhysicsState, position: Array1D, velocity: Array1D
) -> None:
    """Compute the joint angles and velocities that the rotors' encoders stand for [rad, rad/s]."""
    multiply_vector(train.motion_to_joint, memory.rotor_angle, position)
    multiply_vector(train.motion_to_joint, memory.rotor_speed, velocity)


class YieldingGears(Effect):
    """The gears of a simulated robot.

    Args:
        params: of the gears.
        robot: the description.
        inertia: of the rotors at the output [kg m^2], (n_motors,).
        timestep: of the physics [s].
        memory: keeps the rotors' motion.

    Attributes:
        position, velocity: what the encoders on the motors make of it, as joints [rad, rad/s].
    """

    def __init__(
        self, params: GearParameters, robot: RobotDescription, inertia: Array, timestep: float,
        memory: PhysicsState,
    ) -> None:  # fmt: skip
        n = len(robot.joints)
        self._memory = memory
        matrix = np.ascontiguousarray(robot.joint_to_motor)
        self._train = GearTrain(
            matrix, np.ascontiguousarray(robot.torque_to_motor), np.ascontiguousarray(matrix.T),
            np.ascontiguousarray(robot.torque_to_motor.T),
            (1.0 - params.output_share) * np.array(inertia), params.stiffness,
            params.damping, 0.5 * params.backlash, timestep,
        )  # fmt: skip
        self.position, self.velocity = np.zeros(n), np.zeros(n)

    def begin(self, position: Array) -> None:
        """Put the rotors where the joints are [rad], at rest."""
        self._memory.rotor_angle[:] = self._train.to_motor @ position
        self._memory.rotor_speed[:] = 0.0

    def seen(self, views: StepViews) -> StepViews:
        """Return the views with the rotors' motion for the encoders, which sit on them."""
        angle, speed = self.position, self.velocity
        return views._replace(angle=angle, speed=speed, turning=speed)

    def torque_calls(self, views: StepViews, limits: MotorLimits) -> list[Call]:
        """Turn the rotors, and pass on what the gears hold."""
        return [self.turn_call(views.position, views.velocity, views.torque)]

    def reading_calls(self, views: StepViews) -> list[Call]:
        """Bring ``position`` and ``velocity`` up to date."""
        return [self.sense_call()]

    def restore_calls(self) -> list[Call]:
        """Bring ``position`` and ``velocity`` up to date."""
        return [self.sense_call()]

    def turn_call(self, position: Array, velocity: Array, torque: Array) -> KernelCall:
        """Return the call that turns the rotors in a physics step; arguments as for ``turn_gears``."""
        scratch = GearScratch(*(np.zeros(len(self.position)) for _ in GearScratch._fields))
        return signal_call(
            turn_gears, position, velocity, self._train, scratch, self._memory, torque
        )

    def sense_call(self) -> KernelCall:
        """Return the call that brings ``position`` and ``velocity`` up to date."""
        return signal_call(sense_rotors, self._train, self._memory, self.position, self.velocity)
