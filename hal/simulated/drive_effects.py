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
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.elementary import expm1, sin, tanh
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...robots.description import RobotDescription
from ...robots.transmission import PLAY_TIME, PLAY_TORQUE, SLIDING_SPEED
from ...runtime.language.steps import signal_call
from ..random_streams import Purpose, stream
from ..sensors.noise import delay_sample
from .drives import MotorLimits
from .effect import Effect, StepViews
from .effects import EncoderEffects, MotorEffects
from .state import PhysicsState


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


class EncoderDelays(Effect):
    """The encoders of a simulated robot.

    Args:
        robot: the description.
        effects: the sizes of the effects.
        seed: draws what differs from joint to joint.
        timestep: of the physics [s].
        memory: of late readings and filters.
    """

    def __init__(
        self, robot: RobotDescription, effects: EncoderEffects, seed: int, timestep: float,
        memory: PhysicsState,
    ) -> None:  # fmt: skip
        n = len(robot.joints)
        self._memory, self._count = memory, n
        time = effects.velocity_filter
        self._model = EncoderModel(
            np.full(n, round(effects.delay / timestep)),
            -expm1(-timestep / time) if time > 0.0 else 1.0,
            effects.eccentricity, 2.0 * math.pi * stream(seed, Purpose.ECCENTRICITY).random(n),
            effects.compliance, 0.5 * effects.backlash * robot.motors.gear_play, -expm1(-timestep / PLAY_TIME),
        )  # fmt: skip

    @staticmethod
    def dimensions(
        robot: RobotDescription, effects: EncoderEffects, timestep: float
    ) -> Mapping[str, int]:
        """Return the sizes of what is kept in ``PhysicsState``."""
        late = effects != EncoderEffects()
        return {
            "n_sensed_joints": len(robot.joints) if late else 0,
            "n_encoder_slots": round(effects.delay / timestep) + 1 if late else 0,
        }

    def begin(self, position: Array) -> None:
        """Take the first samples anew, without play."""
        self._memory.encoder_taken[0] = 0
        self._memory.encoder_play.fill(0.0)

    def seen(self, views: StepViews) -> StepViews:
        """Return the views with what the encoders read."""
        memory = self._memory
        return views._replace(angle=memory.encoder_position, speed=memory.encoder_velocity)

    def reading_calls(self, views: StepViews) -> list[Call]:
        """Read the encoders."""
        return [self.sense_call(views.angle, views.speed, views.torque)]

    def sense_call(self, position: Array, velocity: Array, torque: Array) -> KernelCall:
        """Return the call that reads the encoders after a physics step; arguments as for ``sense_joints``."""
        n = self._count
        scratch = EncoderScratch(np.zeros(n), np.zeros(n), np.zeros(1, np.int64))
        return signal_call(
            sense_joints, position, velocity, torque, self._model, scratch, self._memory
        )


def drawn_constants(robot: RobotDescription, effects: MotorEffects, seed: int) -> Array:
    """Draw the factor on the torque constant of every motor at its nominal temperature, (n_motors,)."""
    draws = stream(seed, Purpose.TORQUE_CONSTANT).uniform(-1.0, 1.0, len(robot.joints))
    return effects.torque_constant * (1.0 + effects.torque_constant_spread * draws)


def drive_lag(encoders: EncoderEffects, motors: MotorEffects) -> float:
    """Return by how much [s] a drive's loop is late beside that of an ideal drive."""
    band = motors.current_bandwidth
    loop = 1.0 / (2.0 * math.pi * band) if band is not None else 0.0
    return encoders.delay + encoders.velocity_filter + loop


class MotorLosses(Effect):
    """The motors of a simulated robot.

    Args:
        robot: the description.
        effects: the sizes of the effects.
        seed: draws what differs from motor to motor.
        timestep: of the physics [s].
        memory: of the current loops.
        constant: the factors on the torque constants as they are at any time, (n_joints,); by default those of
            the nominal temperature.

    Attributes:
        torque_constant: these factors at the nominal temperature, (n_joints,).
    """

    def __init__(
        self, robot: RobotDescription, effects: MotorEffects, seed: int, timestep: float,
        memory: PhysicsState, constant: Array | None = None,
    ) -> None:  # fmt: skip
        n = len(robot.joints)
        self._memory, self._count = memory, n
        turn = 2.0 * math.pi
        self.torque_constant = drawn_constants(robot, effects, seed)
        band = effects.current_bandwidth
        limit = math.inf if effects.torque_limit is None else effects.torque_limit
        self._motors = DrawnMotors(
            np.ascontiguousarray(robot.joint_to_motor),
            np.ascontiguousarray(robot.joint_to_motor.T), self.torque_constant if constant is None else constant,
            effects.saturation, np.array(robot.motors.peak_torque),
            -expm1(-turn * band * timestep) if band is not None else 1.0, np.full(n, limit),
            effects.ripple * robot.motors.peak_torque, effects.ripple_periods, turn * stream(seed, Purpose.RIPPLE).random(n),
            effects.load_friction, effects.cogging * robot.motors.peak_torque, effects.cogging_periods,
            turn * stream(seed, Purpose.COGGING).random(n),
        )  # fmt: skip

    def torque_calls(self, views: StepViews, limits: MotorLimits) -> list[Call]:
        """Make of what is asked of the motors what they give."""
        requested = limits.motor_torque
        return [self.produce_call(views.position, views.turning, requested, views.torque)]

    def produce_call(
        self, position: Array, velocity: Array, requested: Array, torque: Array
    ) -> KernelCall:
        """Return the call that makes of what is asked of the motors what they give; arguments as for ``produce_torque``."""
        scratch = ProducedTorque(*(np.zeros(self._count) for _ in ProducedTorque._fields))
        return signal_call(
            produce_torque, position, velocity, requested, self._motors, scratch, self._memory,
            torque,
        )  # fmt: skip

    def metrics(self) -> Mapping[str, float]:
        """Return the factors of the weakest and the strongest motor."""
        return {
            "robot_least_torque_constant": float(self.torque_constant.min()),
            "robot_largest_torque_constant": float(self.torque_constant.max()),
        }
