"""The path from the motion of a robot's base to the readings of its IMU: place, mount, filter, delay.

The unit sits at the description's place up to an error of place and angle, on a mount that may
ring. Its axes have scale errors, its gyroscope answers to acceleration a little, its own filter lets
nothing fast pass, and what it has measured arrives late. Noise, bias and range are added to what it
then reads (``sensors.py``). Everything is computed at the rate of the physics.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D, Indices1D, Vector3
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...mathematics.linear_systems import advance, second_order, settle
from ...mathematics.rotations import exponential, rotate_back
from ...runtime.language.steps import signal_call
from ..random_streams import Purpose, stream
from ..sensors.noise import delay_sample
from .effect import Effect, StepViews
from .effects import ImuEffects
from .state import PhysicsState

_AXES = 6
"""The axes of the gyroscope and of the accelerometer."""


class ImuPose(NamedTuple):
    """Pose of the unit: its ``position`` [m, base frame], and the rotation vector ``to_axes`` [rad] from the
    base's axes to its own."""

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    to_axes: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def quaternion(self) -> Array:
        """The rotation from the unit's axes to the base's: x, y, z, w."""
        out = np.empty(4)
        exponential(np.array(self.to_axes), out)
        return out


NOMINAL = ImuPose()
"""The base's origin, with the base's axes."""


def draw_imu_pose(effects: ImuEffects, seed: int) -> ImuPose:
    """Draw the pose of the unit, by the seed."""
    place = draw_spread(effects.position, effects.position_spread, seed, Purpose.IMU_POSITION)
    angle = draw_spread(effects.rotation, effects.rotation_spread, seed, Purpose.IMU_ROTATION)
    return ImuPose((place[0], place[1], place[2]), (angle[0], angle[1], angle[2]))


def draw_spread(
    nominal: tuple[float, ...], spread: float, seed: int, purpose: Purpose
) -> tuple[float, ...]:
    """Return the ``nominal`` numbers, each with a draw of up to the ``spread`` to either side."""
    draws = stream(seed, purpose).uniform(-1.0, 1.0, len(nominal))
    return tuple(float(a + spread * b) for a, b in zip(nominal, draws, strict=True))


class ImuChain(NamedTuple):
    """The stages of a reading.

    ``from_base`` (4,) is the quaternion from the unit's axes to the base's; ``scale`` (6,) the factors on
    the axes of gyroscope and accelerometer, ``sensitivity`` (3,) [rad s/m]; ``filters`` (n_filters, 5) the
    coefficients of one filter after the other; ``delay`` (6,) is in physics steps.
    """

    from_base: Array1D
    scale: Array1D
    sensitivity: Vector3
    filters: Array2D
    delay: Indices1D


class ImuScratch(NamedTuple):
    """A sample on its way: the rate in the unit's axes, then rate and force, (6,)."""

    turned: Vector3
    sample: Array1D


@kernel
def pass_imu(
    rate: Vector3, force: Vector3, chain: ImuChain, scratch: ImuScratch, memory: PhysicsState
) -> None:  # fmt: skip
    """Write what the unit reads after a physics step to ``memory.imu_reading``.

    Args:
        rate: the angular velocity [rad/s, body].
        force: the specific force where the unit is, in its axes [m/s^2].
        memory: of the filters, of the samples that are on their way, and of the reading.
    """
    rotate_back(chain.from_base, rate, scratch.turned)
    for k in range(3):
        felt = chain.sensitivity[k] * force[k]
        scratch.sample[k] = (scratch.turned[k] + felt) * chain.scale[k]
        scratch.sample[3 + k] = force[k] * chain.scale[3 + k]
    for k in range(chain.filters.shape[0]):
        own = memory.imu_filters[6 * k : 6 * k + 6]
        if memory.imu_taken[0] == 0:
            settle(chain.filters[k], scratch.sample, own)
        advance(chain.filters[k], scratch.sample, own, scratch.sample)
    delay_sample(
        scratch.sample, memory.imu_samples, memory.imu_taken, chain.delay, memory.imu_reading
    )


class ImuModel(Effect):
    """The stages between the motion of the base and an IMU's readings.

    Args:
        effects: the sizes of everything.
        seed: draws what has a spread.
        timestep: of the physics [s].
        memory: where filters and late samples are kept.

    Attributes:
        rate, force: what the unit reads after a physics step [rad/s, m/s^2, its axes], without noise,
            bias and range.
    """

    def __init__(
        self, effects: ImuEffects, seed: int, timestep: float, memory: PhysicsState
    ) -> None:
        self.rate, self.force = memory.imu_reading[:3], memory.imu_reading[3:]
        self._memory = memory
        scale = stream(seed, Purpose.IMU_SCALE).uniform(-1.0, 1.0, _AXES)
        scale[:3] *= effects.gyro_scale_spread
        scale[3:] *= effects.accelerometer_scale_spread
        sensitivity = stream(seed, Purpose.IMU_SENSITIVITY).uniform(-1.0, 1.0, 3)
        filters = np.zeros((effects.filters, 5))
        row = 0
        for frequency, damping in (
            (effects.mount_frequency, effects.mount_damping), (effects.bandwidth, math.sqrt(0.5))
        ):  # fmt: skip
            if frequency is not None:
                second_order(frequency, damping, timestep, False, filters[row])
                row += 1
        self.delays = draw_delays(effects, seed)
        self._chain = ImuChain(
            draw_imu_pose(effects, seed).quaternion, 1.0 + scale,
            effects.acceleration_sensitivity * sensitivity, filters,
            np.repeat([round(delay / timestep) for delay in self.delays], 3),
        )  # fmt: skip

    @staticmethod
    def dimensions(effects: ImuEffects, timestep: float) -> Mapping[str, int]:
        """Return the sizes of what is kept in ``PhysicsState``."""
        longest = max(effects.gyro_delay, effects.accelerometer_delay) + effects.delay_spread
        return {
            "n_imu_filters": _AXES * effects.filters,
            "n_imu_slots": 0 if effects.ideal else round(longest / timestep) + 1,
            "n_imu_axes": 0 if effects.ideal else _AXES,
        }

    def begin(self, position: Array) -> None:
        """Take the first sample anew."""
        self._memory.imu_taken[0] = 0

    def seen(self, views: StepViews) -> StepViews:
        """Return the views with what the unit reads."""
        return views._replace(rate=self.rate, force=self.force)

    def motion_calls(self, views: StepViews) -> list[Call]:
        """Read the unit after a physics step."""
        return [*views.base.refresh_calls(), self.read_call(views.rate, views.force)]

    def read_call(self, rate: Array, force: Array) -> KernelCall:
        """Return the call that reads the unit after a physics step; arguments as for ``pass_imu``."""
        scratch = ImuScratch(np.zeros(3), np.zeros(_AXES))
        return signal_call(pass_imu, rate, force, self._chain, scratch, self._memory)

    def metrics(self) -> Mapping[str, float]:
        """Return the drawn values."""
        gyroscope, accelerometer = (1e3 * delay for delay in self.delays)
        return {"robot_gyro_delay_ms": gyroscope, "robot_accelerometer_delay_ms": accelerometer}


def draw_delays(effects: ImuEffects, seed: int) -> tuple[float, float]:
    """Return the delays of gyroscope and accelerometer [s], by the seed."""
    more = effects.delay_spread * float(stream(seed, Purpose.IMU_DELAY).uniform(-1.0, 1.0))
    return max(0.0, effects.gyro_delay + more), max(0.0, effects.accelerometer_delay + more)
