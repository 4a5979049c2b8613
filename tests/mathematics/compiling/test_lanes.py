"""A program is evaluated lane by lane, whatever their number, and lanes do not touch each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.mathematics.compiling.kernel_call import CACHE_LINE, aligned_zeros
from aloft.mathematics.compiling.lanes import OPERATIONS, WIDTH, Lanes, Program


def program(*steps: tuple[str, int, int, int], constants: tuple[float, ...] = ()) -> Program:
    rows = [(OPERATIONS.index(name), *numbers) for name, *numbers in (*steps, ("end", 0, 0, 0))]
    return Program(np.array(rows, np.int32), np.array(constants), 3)


SLOPE = program(
    ("input", 0, 0, 1),
    ("input", 1, 1, 0),
    ("constant", 2, 1, 0),
    ("mul", 0, 0, 2),
    ("sin", 1, 1, 1),
    ("sub", 0, 0, 1),
    ("output", 0, 0, 2),
    ("atan2", 1, 0, 2),
    ("output", 1, 1, 0),
    constants=(7.0, 0.3),
)


@pytest.mark.parametrize("lanes", [1, WIDTH - 1, WIDTH, WIDTH + 1, 5 * WIDTH])
def test_every_lane_has_its_own_values(lanes: int) -> None:
    made = Lanes(SLOPE, lanes, (2, 1), (3, 1))
    draw = np.random.default_rng(lanes)
    for given in made.inputs:
        given[:] = draw.normal(size=given.shape)
    expected = [
        0.3 * x - math.sin(y)
        for x, y in zip(made.inputs[0][:, 1].tolist(), made.inputs[1][:, 0].tolist(), strict=True)
    ]
    for _ in range(2):
        made.run()
        assert made.outputs[0][:, 2].tolist() == expected
        assert not made.outputs[0][:, :2].any(), "what the program does not write stays"
        assert made.outputs[1][:, 0].tolist() == [math.atan2(x, 0.3) for x in expected]


def test_two_of_a_program_have_their_own_memory() -> None:
    first, second = (Lanes(SLOPE, 2, (2, 1), (3, 1)) for _ in range(2))
    first.inputs[0][:] = 1.0
    first.run()
    second.run()
    assert first.outputs[0][:, 2].tolist() == [0.3, 0.3]
    assert second.outputs[0][:, 2].tolist() == [0.0, 0.0]


def test_a_program_without_constants_or_inputs() -> None:
    made = Lanes(program(("output", 0, 1, 0)), 3, (), (1,))
    made.run()
    assert not made.outputs[0].any()


@pytest.mark.parametrize("shape", [(1, 8), (3, 5), (700, 264)])
def test_aligned_zeros_begin_with_a_line_of_the_cache(shape: tuple[int, int]) -> None:
    found = [aligned_zeros(shape) for _ in range(3)]
    assert all(each.ctypes.data % CACHE_LINE == 0 for each in found)
    assert all(each.shape == shape and not each.any() for each in found)
