"""What ``DelayEstimator`` does in every tick, as kernels: sums of products, and their best delay."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array0D, Array1D, Array2D, Indices0D
from ...mathematics.kernel import kernel

LAGS = 12
"""Delays up to this many periods less one can be measured."""
BETWEEN = 25
"""Ticks between two solutions."""


class Memory(NamedTuple):
    """The fields of ``DelayMemory``."""

    command: Array1D
    torque: Array1D
    changes: Array2D
    square: Array2D
    product: Array1D
    energy: Array0D
    ticks: Indices0D
    delay: Array0D
    matched: Array0D


@kernel
def give_delay(
    told: float,
    usual: float,
    follows: bool,
    memory: Memory,
    tolerated: float,
    measured: Array0D,
    known: NDArray[np.bool_],
    delay: Array0D,
    ahead: Array0D,
) -> None:
    """Write the fields of ``DelayEstimate``: what was measured, whether it counts, the delay, and how
    much of it is more than ``tolerated`` [s]."""
    found = memory.delay[()]
    measured[()] = max(found, 0.0)
    known[()] = found >= 0.0
    delay[()] = max(found - usual, 0.0) if found >= 0.0 and follows else told
    ahead[()] = max(delay[()] - tolerated, 0.0)


@kernel
def follow_delay(
    command: Array1D,
    torque: Array1D,
    least: int,
    last: int,
    least_match: float,
    period: float,
    memory: Memory,
) -> None:
    """One tick of the measurement, which ends after the tick ``last``.

    Args:
        command, torque: as commanded now, and as measured now, (n_joints,) [N m].
        least: the number of ticks after which the measurement may count.
        least_match: the share of the changes that it must explain.
        period: of a tick [s].
    """
    ticks, changes = memory.ticks[()], memory.changes
    if ticks > last:
        return
    if ticks > LAGS + 1:  # before, some changes are those from nothing to the first command
        add_changes(torque, memory)
    for joint in range(command.shape[0]):
        for lag in range(LAGS - 1, 0, -1):
            changes[lag, joint] = changes[lag - 1, joint]
        changes[0, joint] = command[joint] - memory.command[joint]
        memory.command[joint] = command[joint]
        memory.torque[joint] = torque[joint]
    memory.ticks[()] = ticks + 1
    if ticks >= least and (ticks % BETWEEN == 0 or ticks == last):
        solve_delay(least_match, period, memory)


@kernel
def add_changes(torque: Array1D, memory: Memory) -> None:
    """Add the products of this tick's changes to the sums."""
    joints, changes = torque.shape[0], memory.changes
    energy = 0.0
    for joint in range(joints):
        change = torque[joint] - memory.torque[joint]
        energy += change * change
    memory.energy[()] = memory.energy[()] + energy
    for i in range(LAGS):
        total = 0.0
        for joint in range(joints):
            change = torque[joint] - memory.torque[joint]
            total += changes[i, joint] * change
        memory.product[i] = memory.product[i] + total
        for j in range(LAGS):
            total = 0.0
            for joint in range(joints):
                total += changes[i, joint] * changes[j, joint]
            memory.square[i, j] = memory.square[i, j] + total


@kernel
def solve_delay(least_match: float, period: float, memory: Memory) -> None:
    """The number of periods and the share of one that leave the least unexplained."""
    square, product = memory.square, memory.product
    energy = memory.energy[()]
    if energy <= 0.0:
        return
    best, delay = energy, -1.0
    for j in range(LAGS - 1):
        own, cross = square[j, j], square[j, j + 1]
        other = square[j + 1, j + 1]
        length = own - 2.0 * cross + other
        if length <= 0.0:
            continue
        here, there = product[j], product[j + 1]
        share = min(max((there - here - cross + own) / length, 0.0), 1.0)
        rest = 1.0 - share
        error = energy - 2.0 * (rest * here + share * there)
        error += rest * rest * own + 2.0 * share * rest * cross
        error += share * share * other
        if error < best:
            best, delay = error, (float(j) + share) * period
    matched = 1.0 - best / energy
    memory.matched[()] = matched
    memory.delay[()] = delay if matched >= least_match else -1.0
