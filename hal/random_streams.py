"""Random numbers of a simulated robot: one independent stream for every purpose.

Because no two purposes share a stream, switching one disturbance off leaves all others exactly as
they were. Streams depend on the seed and the purpose's number only.
"""

from __future__ import annotations

import ctypes
import zlib
from collections.abc import Mapping
from enum import IntEnum
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from ..mathematics.arrays import Array, Counts
from ..mathematics.compiling.library_call import LibraryCall, address_of
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


RUNNING = (
    Purpose.GYRO, Purpose.ACCELEROMETER, Purpose.JOINT_VELOCITY, Purpose.JITTER, Purpose.BOUNCE,
)  # fmt: skip
"""The streams that are drawn from during a run; the others are drawn once, before it."""
_MOUNTED = 100
"""Takes the place of a purpose in the streams of mounted sensors."""


def stream(seed: int, purpose: Purpose) -> np.random.Generator:
    """A new stream for a seed and a purpose."""
    sequence = np.random.SeedSequence(seed, spawn_key=(int(purpose),))
    return np.random.Generator(np.random.PCG64(sequence))


def sensor_stream(seed: int, sensor: str, number: int) -> np.random.Generator:
    """A new stream for one of the errors of a sensor that a robot's description mounts."""
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
        """The noise of a field of a mounted sensor, by its number in the signal."""
        return self._streams[sensor, number]

    def save(self, out: NDArray[np.int64]) -> None:
        """Write the state of all streams into ``words`` integers."""
        for k, generator in enumerate(self._streams.values()):
            save_generator(generator.bit_generator, out[3 * k : 3 * k + 3])

    def load(self, words: NDArray[np.int64]) -> None:
        """Restore the state; the seed must be the one that the state was saved with."""
        for k, generator in enumerate(self._streams.values()):
            load_generator(generator.bit_generator, words[3 * k : 3 * k + 3])


def normal_call(generator: np.random.Generator, out: Array) -> LibraryCall:
    """Draws numbers of mean zero and variance one into ``out``, (n,)."""
    return LibraryCall(
        partial(generator.standard_normal, out=out), _addresses()[0], _bits(generator), out.size,
        out.ctypes.data,
    )  # fmt: skip


def uniform_call(generator: np.random.Generator, out: Array) -> tuple[LibraryCall, Counts]:
    """Draws numbers between zero and one into ``out``, (n,), and where it is read how many, (1,)."""

    def draw() -> None:
        for k in range(int(count[0])):
            out[k] = generator.random()

    call = LibraryCall(draw, _addresses()[1], _bits(generator), out.size, out.ctypes.data)
    count = call.words[2:3]
    return call, count


def _bits(generator: np.random.Generator) -> int:
    """The address of what NumPy's functions draw from; it is the generator's for all its life."""
    interface = generator.bit_generator.ctypes
    return int(interface.bit_generator.value or 0)


@cache
def _addresses() -> tuple[int, int]:
    """The addresses of the functions behind ``standard_normal`` and ``random``; zeros where NumPy does
    not give them away, and then Python calls these."""
    from numpy.random import _generator

    try:
        library = ctypes.CDLL(_generator.__file__)
        normal, uniform = library.random_standard_normal_fill, library.random_standard_uniform_fill
    except (AttributeError, OSError):
        return 0, 0
    return address_of(normal), address_of(uniform)
