"""Random numbers of a simulated robot: one independent stream for every purpose.

Because no two purposes share a stream, switching one disturbance off leaves all others exactly as
they were. Streams depend on the seed and the purpose's number only.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.random_stream import load_generator, save_generator


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


RUNNING = (
    Purpose.GYRO, Purpose.ACCELEROMETER, Purpose.JOINT_VELOCITY, Purpose.JITTER, Purpose.BOUNCE,
)  # fmt: skip
"""The streams that are drawn from during a run; the others are drawn once, before it."""
WORDS = 3 * len(RUNNING)
"""The number of integers in the state of the running streams."""


def stream(seed: int, purpose: Purpose) -> np.random.Generator:
    """A new stream for a seed and a purpose."""
    sequence = np.random.SeedSequence(seed, spawn_key=(int(purpose),))
    return np.random.Generator(np.random.PCG64(sequence))


class RandomStreams:
    """The streams of a run, whose state can be saved as integers and restored exactly."""

    def __init__(self, seed: int) -> None:
        self._streams = {purpose: stream(seed, purpose) for purpose in RUNNING}

    def __getitem__(self, purpose: Purpose) -> np.random.Generator:
        return self._streams[purpose]

    def save(self, out: NDArray[np.int64]) -> None:
        """Write the state of all streams into ``WORDS`` integers."""
        for k, generator in enumerate(self._streams.values()):
            save_generator(generator.bit_generator, out[3 * k : 3 * k + 3])

    def load(self, words: NDArray[np.int64]) -> None:
        """Restore the state; the seed must be the one that the state was saved with."""
        for k, generator in enumerate(self._streams.values()):
            load_generator(generator.bit_generator, words[3 * k : 3 * k + 3])
