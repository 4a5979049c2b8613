"""Numbers drawn without the interpreter are those of the generator, and it goes on behind them."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.hal.random_streams import Purpose, stream
from aloft.mathematics.compiling.call_sequence import CallSequence
from aloft.runtime.language import random_stream
from aloft.runtime.language.random_stream import normal_call, uniform_call


@pytest.mark.parametrize("known", [True, False])
def test_draws_are_those_of_the_generator(known: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not known:
        monkeypatch.setattr(random_stream, "_addresses", lambda: (0, 0))
    ours, theirs = stream(3, Purpose.GYRO), stream(3, Purpose.GYRO)
    normal, uniform = np.zeros(7), np.zeros(5)
    drawing, count = uniform_call(ours, uniform)
    sequence = CallSequence([normal_call(ours, normal), drawing])
    sequence.prepare()
    assert sequence.native is known
    for wanted in (5, 0, 2):
        count[0] = wanted
        uniform.fill(-1.0)
        sequence.run()
        assert normal.tolist() == theirs.standard_normal(7).tolist()
        assert uniform.tolist() == [theirs.random() for _ in range(wanted)] + [-1.0] * (5 - wanted)
    assert ours.random() == theirs.random()
    ours.bit_generator.state = theirs.bit_generator.state  # as a snapshot is restored
    sequence.run()
    assert normal.tolist() == theirs.standard_normal(7).tolist()
