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

import ctypes
import zlib
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array, Counts
from ...mathematics.compiling.foreign_call import ForeignCall, address_of
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
    """Return the 64 bits of a whole number as a signed one, which an array of integers holds."""
    return word - (1 << 64) if word >= 1 << 63 else word


def normal_call(generator: np.random.Generator, out: Array) -> ForeignCall:
    """Draws numbers of mean zero and variance one into ``out``, (n,)."""
    return ForeignCall(
        partial(generator.standard_normal, out=out), _addresses()[0], _bits(generator), out.size,
        out.ctypes.data,
    )  # fmt: skip


def uniform_call(generator: np.random.Generator, out: Array) -> tuple[ForeignCall, Counts]:
    """Draws numbers between zero and one into ``out``, (n,), and where it is read how many, (1,)."""

    def draw() -> None:
        for k in range(int(count[0])):
            out[k] = generator.random()

    call = ForeignCall(draw, _addresses()[1], _bits(generator), out.size, out.ctypes.data)
    count = call.words[2:3]
    return call, count


def _bits(generator: np.random.Generator) -> int:
    """Return the address of the state that NumPy's functions draw from, which lasts as long as the
    generator."""
    interface = generator.bit_generator.ctypes
    return int(interface.bit_generator.value or 0)


@cache
def _addresses() -> tuple[int, int]:
    """Return the addresses of the functions behind ``standard_normal`` and ``random``; zeros where
    NumPy does not export them, so that Python calls them instead."""
    from numpy.random import _generator

    try:
        library = ctypes.CDLL(_generator.__file__)
        normal, uniform = library.random_standard_normal_fill, library.random_standard_uniform_fill
    except (AttributeError, OSError):
        return 0, 0
    return address_of(normal), address_of(uniform)
