"""What is frozen comes back exactly, with its types."""

from enum import IntEnum

import numpy as np

from aloft.hal.twin.snapshot import ObjectSnapshot


class Colour(IntEnum):
    RED = 1
    BLUE = 2


class Thing:
    def __init__(self) -> None:
        self.array = np.arange(6.0).reshape(2, 3)
        self.flags = np.array([True, False])
        self.count = 3
        self.on = True
        self.colour = Colour.BLUE
        self.named = {"b": 0.1, "a": 2.0}
        self.other = "not kept"


def test_all_values_come_back() -> None:
    thing = Thing()
    frozen = ObjectSnapshot([(thing, ("array", "flags", "count", "on", "colour", "named"))])
    kept = np.zeros(frozen.size)
    frozen.save(kept)
    array = thing.array
    thing.array[:] = 9.0
    thing.flags[:] = True
    thing.count, thing.on, thing.colour = 7, False, Colour.RED
    thing.named["a"] = -1.0
    frozen.load(kept)
    assert thing.array is array and thing.array.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert thing.flags.tolist() == [True, False]
    assert thing.count == 3 and isinstance(thing.count, int)
    assert thing.on is True and thing.colour is Colour.BLUE
    assert thing.named == {"b": 0.1, "a": 2.0}
    assert frozen.size == 6 + 2 + 1 + 1 + 1 + 2
