"""Random streams: independent by path, the same for the same seed, and restored exactly."""

import numpy as np

from aloft.blocks.general.noise import WhiteNoise
from aloft.runtime.language.block import Clock, Context
from aloft.runtime.language.random_stream import RandomStream, StreamState


def stream(path: str, seed: int) -> RandomStream:
    return RandomStream(WhiteNoise(WhiteNoise.Params(), Context(path, Clock(0.01))), seed)


def test_a_stream_depends_on_the_seed_and_the_path() -> None:
    first = stream("a", 1).generator.standard_normal(4).tolist()
    assert stream("a", 1).generator.standard_normal(4).tolist() == first
    assert stream("b", 1).generator.standard_normal(4).tolist() != first
    assert stream("a", 2).generator.standard_normal(4).tolist() != first


def test_a_stream_goes_on_from_where_it_was_saved() -> None:
    one, other, state = stream("a", 1), stream("a", 1), StreamState.allocate()
    one.generator.integers(0, 7, 3, dtype=np.uint32)  # leaves half a number behind
    one.save(state)
    expected = one.generator.integers(0, 1000, 9, dtype=np.uint32).tolist()
    other.load(state)
    assert other.generator.integers(0, 1000, 9, dtype=np.uint32).tolist() == expected
