"""Random numbers of a simulated robot: one independent stream for every purpose.

Because no two purposes share a stream, switching one disturbance off leaves all others exactly as
they were. Streams depend on the seed and the purpose's number only.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..runtime.language.random_stream import load_generator, save_generator


class Purpose(IntEnum):
    """The purpose of a stream. Numbers are never reused, because they decide what a seed gives."""

    FRICTION = 0
    CONTACT_STIFFNESS = 1
    MASS = 2
    BASE_COM = 3
    ATTITUDE = 4
    GYRO_BIAS = 5
    ACCELEROMETER_BIAS = 6
    ENCODER_OFFSET = 7
    SWITCH_THRESHOLD = 8
    START_PHASE = 9
    GYRO = 10
    ACCELEROMETER = 11
    JOINT_VELOCITY = 12
    JITTER = 13
    BOUNCE = 14
    IMU_POSITION = 15
    IMU_ROTATION = 16
    IMU_SCALE = 17
    IMU_SENSITIVITY = 18
    IMU_DELAY = 19
    TORQUE_CONSTANT = 20
    RIPPLE = 21
    JOINT_FRICTION = 22
    ROTOR_INERTIA = 23
    LINK_MASS = 24
    LINK_COM = 25
    LINK_INERTIA = 26
    ECCENTRICITY = 27
    FLOOR_TILT = 28
    CABLE = 29
    LINK_LENGTH = 30
    STATIC_FRICTION = 31
    COGGING = 32
    THRUST = 33


RUNNING = (
    Purpose.GYRO, Purpose.ACCELEROMETER, Purpose.JOINT_VELOCITY, Purpose.JITTER, Purpose.BOUNCE,
)  # fmt: skip
"""The streams that are drawn from during a run; the others are drawn once, before it."""
_MOUNTED = 100
"""Takes the place of a purpose in the streams of mounted sensors."""


def stream(seed: int, purpose: Purpose) -> np.random.Generator:
    """Return a new stream for a seed and a purpose."""
    sequence = np.random.SeedSequence(seed, spawn_key=(int(purpose),))
    return np.random.Generator(np.random.PCG64(sequence))


def sensor_stream(seed: int, sensor: str, number: int) -> np.random.Generator:
    """Return a new stream for one of the errors of a sensor that a robot's description mounts."""
    key = (_MOUNTED, zlib.crc32(sensor.encode()), number)
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))


class RandomStreams:
    """The streams of a run, whose state can be saved as integers and restored exactly.

    Args:
        seed: of all of them.
        fields: how many fields each mounted sensor has, by its name; each has a stream of noise.
    """

    def __init__(self, seed: int, fields: Mapping[str, int] | None = None) -> None:
        self._streams: dict[Purpose | tuple[str, int], np.random.Generator] = {
            purpose: stream(seed, purpose) for purpose in RUNNING
        }
        for name, count in (fields or {}).items():
            for k in range(count):
                self._streams[name, k] = sensor_stream(seed, name, 2 * k + 1)
        self.words = 3 * len(self._streams)
        """The number of integers in their state."""

    def __getitem__(self, purpose: Purpose) -> np.random.Generator:
        return self._streams[purpose]

    def of_field(self, sensor: str, number: int) -> np.random.Generator:
        """Return the noise of a field of a mounted sensor, by its number in the signal."""
        return self._streams[sensor, number]

    def save(self, out: NDArray[np.int64]) -> None:
        """Write the state of all streams into ``words`` integers."""
        for k, generator in enumerate(self._streams.values()):
            save_generator(generator.bit_generator, out[3 * k : 3 * k + 3])

    def load(self, words: NDArray[np.int64]) -> None:
        """Restore the state; the seed must be the one that the state was saved with."""
        for k, generator in enumerate(self._streams.values()):
            load_generator(generator.bit_generator, words[3 * k : 3 * k + 3])
