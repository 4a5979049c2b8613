"""Which tasks' turn it is, and what is remembered of a solution."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.whole_body_step import Kept, Told, Turns, keep_solution, take_turns
from aloft.blocks.signals import Phase
from aloft.mathematics.whole_body_solution import ILL_POSED, SOLVED


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("stance", [[False, False], [False, True]])
def test_one_kind_of_gains_has_its_turn_where_a_point_is_in_stance(phase, stance) -> None:
    turns = Turns(*(np.full(1, 7) for _ in Turns._fields))
    take_turns(np.array(int(phase)), np.array(stance), turns)
    kind = "thrust" if phase == Phase.THRUST else "landing" if phase > Phase.THRUST else "stand"
    wanted = {kind: 1, "loaded": 1} if any(stance) else {}
    assert {name: int(turn[0]) for name, turn in turns._asdict().items() if turn[0]} == wanted


def kept(loaded: int, code: int) -> tuple[Told, Kept, int]:
    told = Told(
        np.array([3.0, 4.0]), np.ones(3), np.ones((2, 3)), np.array(False), np.array(-1)
    )  # fmt: skip
    memory = Kept(np.array([1.0, 2.0]), np.array(2), np.array(5))
    unsolved = np.full(1, 7)
    keep_solution(np.array([loaded]), np.array([code]), told, memory, unsolved)
    return told, memory, int(unsolved[0])


def test_a_solution_is_remembered() -> None:
    told, memory, unsolved = kept(1, SOLVED)
    assert unsolved == 0 and bool(told.solved)
    assert memory.torque.tolist() == told.torque.tolist() == [3.0, 4.0]
    assert (int(memory.failed), int(memory.failures), int(told.failures)) == (0, 5, 5)


def test_without_a_point_in_stance_everything_is_zero_and_counts_as_solved() -> None:
    told, memory, unsolved = kept(0, ILL_POSED)
    assert unsolved == 0 and bool(told.solved)
    for array in (told.torque, told.acceleration, told.force, memory.torque):
        assert not array.any()
    assert (int(memory.failed), int(memory.failures), int(told.failures)) == (0, 5, 5)


def test_without_a_solution_python_is_asked_and_nothing_changes() -> None:
    told, memory, unsolved = kept(1, ILL_POSED)
    assert unsolved == 1 and not bool(told.solved)
    assert memory.torque.tolist() == [1.0, 2.0] and told.torque.tolist() == [3.0, 4.0]
    assert (int(memory.failed), int(memory.failures), int(told.failures)) == (2, 5, -1)
