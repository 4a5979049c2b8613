"""Random numbers of a block: a seeded stream whose state lies in the block's declared state.

A block that draws random numbers declares a state of this signal and makes its stream in ``setup``;
snapshots, replay and the conformance suite then work with nothing more than two lines::

    class Dither(Block):
        params: Params                      # with a seed
        stream = State(StreamState, text="the random stream")
        ...
        def setup(self) -> None:
            self._random = RandomStream(self, self.params.seed)

        def step(self) -> None:
            self._random.generator.standard_normal(out=self._noise)

        def save_state(self) -> None:
            self._random.save(self.stream)

        def load_state(self) -> None:
            self._random.load(self.stream)
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .block import Block
from .signals import Field, Signal

_MASK = (1 << 64) - 1


class StreamState(Signal):
    """The state of a PCG64 generator."""

    words = Field(3, dtype="int64", text="its number's low and high half, and a saved half number")


class RandomStream:
    """A stream of random numbers that depends on a seed and on the block's path in the graph only.

    Two blocks with the same seed so have independent streams; a block that is renamed has another.
    """

    def __init__(self, block: Block, seed: int) -> None:
        key = zlib.crc32(block.context.path.encode())
        sequence = np.random.SeedSequence(seed, spawn_key=(key,))
        self._bits = np.random.PCG64(sequence)
        self.generator = np.random.Generator(self._bits)

    def save(self, state: StreamState) -> None:
        """Write where the stream is; for ``Block.save_state``."""
        save_generator(self._bits, state.words)

    def load(self, state: StreamState) -> None:
        """Go back to where the stream was; for ``Block.load_state``."""
        load_generator(self._bits, state.words)


def save_generator(bits: np.random.BitGenerator, words: NDArray[np.int64]) -> None:
    """Write the state of a PCG64 generator into ``words``, (3,), as ``StreamState`` describes them."""
    present: Any = bits.state
    number = int(present["state"]["state"])
    words[0] = _signed(number & _MASK)
    words[1] = _signed(number >> 64)
    words[2] = int(present["has_uint32"]) << 32 | int(present["uinteger"])


def load_generator(bits: np.random.BitGenerator, words: NDArray[np.int64]) -> None:
    """Restore the state from ``words``, (3,); the generator must have the seed it was saved with."""
    low, high, rest = (int(word) & _MASK for word in words)
    present: Any = bits.state
    restored: Any = {
        **present,
        "state": {**present["state"], "state": high << 64 | low},
        "has_uint32": rest >> 32,
        "uinteger": rest & (1 << 32) - 1,
    }
    bits.state = restored


def _signed(word: int) -> int:
    """The 64 bits of a whole number as a signed one, which an array of integers holds."""
    return word - (1 << 64) if word >= 1 << 63 else word
