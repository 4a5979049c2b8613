"""Imperfections of the drives of a simulated robot: encoders, gears, current loops and motors.

Between two physics steps a drive reads its encoder, closes its loop (``drives.py``), and asks its motor
for a torque. Here the encoder sits on the motor, behind a gear that yields under load and has play; its
reading is late, and the drive filters the velocity that it makes of it. The current follows the request
through its loop, and the motor gives of it what its iron, its torque constant, its ripple and the load
friction of the gear leave. Cogging, the pull of magnets on teeth, acts at rest and without current, too. The drive itself believes in the nominal torque constant, so that the torque
it reports is the one that it asked for.

The gear's yield is quasi-static: rotor and joint stay one body, and only the reading of the encoder moves,
across the play within some milliseconds. For the dynamics of such gears see ``gears.py``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D, Indices1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.elementary import expm1, sin, tanh
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...robots.description import RobotDescription
from ...robots.transmission import PLAY_TIME, PLAY_TORQUE, SLIDING_SPEED
from ...runtime.language.steps import signal_call
from ..random_streams import Purpose, stream
from ..sensors.noise import delay_sample
from .effects import EncoderEffects, MotorEffects, WindingParameters
from .state import PhysicsState
from .windings import Windings


class EncoderModel(NamedTuple):
    """The encoders of all joints: ``delay`` (n,) in physics steps, the ``share`` of a new velocity that
    passes the filter in a step, ``phase`` (n,) of the ``eccentricity`` [rad], ``compliance`` [rad/(N m)]
    and half the ``play`` (n,) [rad], of which a ``crossing`` share is made up in a step."""

    delay: Indices1D
    share: float
    eccentricity: float
    phase: Array1D
    compliance: float
    play: Array1D
    crossing: float


class EncoderScratch(NamedTuple):
    """The sample of a physics step, and the velocity as late as it is; each (n_joints,)."""

    position: Array1D
    late: Array1D
    counts: Indices1D


@kernel
def sense_joints(
    position: Array1D, velocity: Array1D, torque: Array1D, model: EncoderModel,
    scratch: EncoderScratch, memory: PhysicsState,
) -> None:  # fmt: skip
    """Write what the encoders read after a physics step to ``memory``.

    Args:
        position, velocity, torque: true motion and torque of the joints [rad, rad/s, N m], (n_joints,).
    """
    for k in range(position.shape[0]):
        reading = position[k] + model.compliance * torque[k]
        end = model.play[k] * tanh(torque[k] / PLAY_TORQUE)
        memory.encoder_play[k] += model.crossing * (end - memory.encoder_play[k])
        reading += memory.encoder_play[k]
        reading += model.eccentricity * sin(position[k] + model.phase[k])
        scratch.position[k] = reading
    scratch.counts[0] = memory.encoder_taken[0]
    delay_sample(
        velocity, memory.speed_samples, scratch.counts, model.delay, scratch.late
    )  # fmt: skip
    share = model.share if memory.encoder_taken[0] > 0 else 1.0
    delay_sample(
        scratch.position, memory.encoder_samples, memory.encoder_taken, model.delay,
        memory.encoder_position,
    )  # fmt: skip
    for k in range(position.shape[0]):
        memory.encoder_velocity[k] += share * (scratch.late[k] - memory.encoder_velocity[k])


class DrawnMotors(NamedTuple):
    """All motors: what maps their torques and speeds to joints and back, (n, n); ``constant`` (n,), the
    factor on their torque constants; ``saturation`` at the ``peak`` torque (n,) [N m]; the ``share`` of a new
    torque that passes the current loop in a step; ``limit`` (n,) [N m]; ``ripple`` (n,) [N m], ``periods`` in a
    turn and their ``phase`` (n,); ``friction``, the share that is lost under load; ``cogging`` (n,) [N m], its
    ``teeth`` in a turn and their phase ``at_tooth`` (n,)."""

    to_motor: Array2D
    to_joint: Array2D
    constant: Array1D
    saturation: float
    peak: Array1D
    share: float
    limit: Array1D
    ripple: Array1D
    periods: int
    phase: Array1D
    friction: float
    cogging: Array1D
    teeth: int
    at_tooth: Array1D


class ProducedTorque(NamedTuple):
    """Of the motors in a physics step: angle, speed, and the torque that is gained; of the joints the torque."""

    angle: Array1D
    speed: Array1D
    gained: Array1D
    joint: Array1D


@kernel
def produce_torque(
    position: Array1D, velocity: Array1D, requested: Array1D, model: DrawnMotors,
    scratch: ProducedTorque, memory: PhysicsState, torque: Array1D,
) -> None:  # fmt: skip
    """Change the joint ``torque`` [N m] from the commanded one to that of the motors.

    Args:
        position, velocity: the true motion of the joints [rad, rad/s].
        requested: the commanded torques of the motors [N m].
    """
    multiply_vector(model.to_motor, position, scratch.angle)
    multiply_vector(model.to_motor, velocity, scratch.speed)
    for k in range(requested.shape[0]):
        within = min(max(requested[k], -model.limit[k]), model.limit[k])
        memory.motor_torque[k] += model.share * (within - memory.motor_torque[k])
        given, load = memory.motor_torque[k], 0.0
        if model.peak[k] > 0.0:
            load = min(abs(given) / model.peak[k], 1.0)
        given *= model.constant[k] * (1.0 - model.saturation * load * load)
        given -= model.friction * abs(given) * tanh(scratch.speed[k] / SLIDING_SPEED)
        turned = model.periods * scratch.angle[k] + model.phase[k]
        given += model.ripple[k] * sin(turned)
        turned = model.teeth * scratch.angle[k] + model.at_tooth[k]
        given += model.cogging[k] * sin(turned)
        scratch.gained[k] = given - requested[k]
    multiply_vector(model.to_joint, scratch.gained, scratch.joint)
    torque[:] += scratch.joint


class DriveEffects:
    """The encoders and motors of a simulated robot.

    Args:
        robot: the description.
        encoders, motors: the sizes of the effects.
        seed: draws what differs from motor to motor.
        timestep: of the physics [s].
        memory: of late readings, filters, current loops and windings.
        windings: that warm; none: they do not.
    """

    def __init__(
        self, robot: RobotDescription, encoders: EncoderEffects, motors: MotorEffects, seed: int,
        timestep: float, memory: PhysicsState, windings: WindingParameters | None = None,
    ) -> None:  # fmt: skip
        n = len(robot.joints)
        self._memory, self._count = memory, n
        self.has_encoders = encoders != EncoderEffects()
        self.has_motors = motors != MotorEffects() or windings is not None
        time = encoders.velocity_filter
        turn = 2.0 * math.pi
        self._encoders = EncoderModel(
            np.full(n, round(encoders.delay / timestep)),
            -expm1(-timestep / time) if time > 0.0 else 1.0,
            encoders.eccentricity, turn * stream(seed, Purpose.ECCENTRICITY).random(n),
            encoders.compliance, 0.5 * encoders.backlash * robot.motors.gear_play, -expm1(-timestep / PLAY_TIME),
        )  # fmt: skip
        draws = stream(seed, Purpose.TORQUE_CONSTANT).uniform(-1.0, 1.0, n)
        self.torque_constant = motors.torque_constant * (
            1.0 + motors.torque_constant_spread * draws
        )
        """The factor on the torque constant of every motor at its nominal temperature, (n,)."""
        self.windings = None
        if windings is not None:
            self.windings = Windings(windings, robot, self.torque_constant, timestep, memory)
        constant = self.torque_constant if self.windings is None else self.windings.warm.constant
        band = motors.current_bandwidth
        self.lag = encoders.delay + time + (1.0 / (turn * band) if band is not None else 0.0)
        """By how much [s] a drive's loop is late beside that of an ideal drive."""
        limit = math.inf if motors.torque_limit is None else motors.torque_limit
        self._motors = DrawnMotors(
            np.ascontiguousarray(robot.joint_to_motor),
            np.ascontiguousarray(robot.joint_to_motor.T), constant,
            motors.saturation, np.array(robot.motors.peak_torque),
            -expm1(-turn * band * timestep) if band is not None else 1.0, np.full(n, limit),
            motors.ripple * robot.motors.peak_torque, motors.ripple_periods, turn * stream(seed, Purpose.RIPPLE).random(n),
            motors.load_friction, motors.cogging * robot.motors.peak_torque, motors.cogging_periods,
            turn * stream(seed, Purpose.COGGING).random(n),
        )  # fmt: skip

    @staticmethod
    def dimensions(
        robot: RobotDescription,
        encoders: EncoderEffects,
        motors: MotorEffects,
        timestep: float,
        windings: WindingParameters | None = None,
    ) -> Mapping[str, int]:
        """Return the sizes of what is kept in ``PhysicsState``."""
        n = len(robot.joints)
        sensed = encoders != EncoderEffects()
        return {
            "n_sensed_joints": n if sensed else 0,
            "n_encoder_slots": round(encoders.delay / timestep) + 1 if sensed else 0,
            "n_real_motors": n if motors != MotorEffects() or windings is not None else 0,
            "n_windings": n if windings is not None else 0,
        }

    def sensing(self, position: Array, velocity: Array, torque: Array) -> KernelCall:
        """Return the call that reads the encoders after a physics step; arguments as for ``sense_joints``."""
        n = self._count
        scratch = EncoderScratch(np.zeros(n), np.zeros(n), np.zeros(1, np.int64))
        return signal_call(
            sense_joints, position, velocity, torque, self._encoders, scratch, self._memory
        )

    def producing(
        self, position: Array, velocity: Array, requested: Array, torque: Array
    ) -> KernelCall:
        """Return the call that makes the motors' torque of the commanded one; arguments as for ``produce_torque``."""
        scratch = ProducedTorque(*(np.zeros(self._count) for _ in ProducedTorque._fields))
        return signal_call(
            produce_torque, position, velocity, requested, self._motors, scratch, self._memory,
            torque,
        )  # fmt: skip

    def metrics(self) -> Mapping[str, float]:
        """Return the weakest and the strongest motor."""
        return {
            "robot_least_torque_constant": float(self.torque_constant.min()),
            "robot_largest_torque_constant": float(self.torque_constant.max()),
        }
