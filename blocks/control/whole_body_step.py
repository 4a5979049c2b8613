"""What a step of the whole-body controller does before its tasks and after its program."""

from __future__ import annotations

from typing import NamedTuple

from ...mathematics.arrays import (
    Array1D,
    Array2D,
    Flags0D,
    Flags1D,
    Indices0D,
    Indices1D,
)
from ...mathematics.kernel import kernel
from ...mathematics.whole_body_solution import SOLVED
from ..signals import Phase


class Turns(NamedTuple):
    """Which calls a step makes, each (1,) and not zero where it makes them: the tasks with the gains
    of ``stand``, ``thrust`` or ``landing``, and what solves the program if a point is ``loaded``."""

    stand: Indices1D
    thrust: Indices1D
    landing: Indices1D
    loaded: Indices1D


class Told(NamedTuple):
    """The fields of ``WholeBodyCommand``."""

    torque: Array1D
    acceleration: Array1D
    force: Array2D
    solved: Flags0D
    failures: Indices0D


class Kept(NamedTuple):
    """The fields of ``SolverMemory``."""

    torque: Array1D
    failed: Indices0D
    failures: Indices0D


@kernel
def take_turns(phase: Indices0D, stance: Flags1D, turns: Turns) -> None:
    """Find which gains hold in the ``phase``, of shape (), and whether a point is in stance."""
    loaded = 0
    for i in range(stance.shape[0]):
        if stance[i]:
            loaded = 1
    now = phase[()]
    turns.stand[0] = loaded if now < Phase.THRUST else 0
    turns.thrust[0] = loaded if now == Phase.THRUST else 0
    turns.landing[0] = loaded if now > Phase.THRUST else 0
    turns.loaded[0] = loaded


@kernel
def keep_solution(
    loaded: Indices1D, code: Indices1D, command: Told, memory: Kept, unsolved: Indices1D
) -> None:
    """Remember a solution, or without a point in stance make everything zero.

    Args:
        loaded: whether a point is in stance, (1,).
        code: SOLVED where the program has been solved, (1,).
        unsolved: becomes 1 where it has not, else 0, (1,); then nothing else is written.
    """
    unsolved[0] = 0
    if loaded[0] == 0:
        command.force[:, :] = 0.0
        command.acceleration[:] = 0.0
        command.torque[:] = 0.0
        memory.torque[:] = 0.0
    elif code[0] == SOLVED:
        for i in range(memory.torque.shape[0]):
            memory.torque[i] = command.torque[i]
    else:
        unsolved[0] = 1
        return
    memory.failed[()] = 0
    command.solved[()] = True
    command.failures[()] = int(memory.failures[()])
