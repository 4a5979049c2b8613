from __future__ import annotations

import numpy as np

from aloft.hal.random_streams import RUNNING, Purpose, RandomStreams, stream


def test_streams_of_one_seed_differ_and_are_repeatable() -> None:
    draws = {purpose: stream(5, purpose).random(4).tolist() for purpose in Purpose}
    assert len({tuple(values) for values in draws.values()}) == len(Purpose)
    assert draws == {purpose: stream(5, purpose).random(4).tolist() for purpose in Purpose}
    assert stream(6, Purpose.GYRO).random() != stream(5, Purpose.GYRO).random()


def test_a_restored_stream_goes_on_where_it_was() -> None:
    streams = RandomStreams(3)
    for purpose in RUNNING:
        streams[purpose].standard_normal(7)
    words = np.zeros(streams.words, np.int64)
    streams.save(words)
    after = [streams[purpose].standard_normal(5).tolist() for purpose in RUNNING]
    other = RandomStreams(3)
    other.load(words)
    assert [other[purpose].standard_normal(5).tolist() for purpose in RUNNING] == after
