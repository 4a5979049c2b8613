"""Kernels that the tests compile."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aloft.mathematics.kernel import kernel

SCALE = 2.5


class Pair(NamedTuple):
    """An array and a number."""

    values: np.ndarray
    factor: float


@kernel
def scaled(x: float) -> float:
    return SCALE * math.sin(x)


@kernel
def mix(matrix: np.ndarray, pair: Pair, count: int, flag: bool, out: np.ndarray) -> None:
    for i in range(count):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += float(matrix[i, j]) * scaled(float(pair.values[j]))
        out[i] = pair.factor * total if flag else -total


@kernel
def divide(values: np.ndarray) -> None:
    values[0] = float(values[1]) / float(values[2])


@kernel
def allocates(values: np.ndarray) -> None:
    values[:] = np.sort(values)


def unmarked(values: np.ndarray) -> None:
    values[0] = 1.0


@kernel
def add_scaled(values: np.ndarray, factor: float, out: np.ndarray) -> None:
    for i in range(out.shape[0]):
        out[i] += float(values[i]) * factor


@kernel
def next_positive(after: int, values: np.ndarray) -> int:
    for i in range(after, values.shape[0]):
        if values[i] > 0.0:
            return i + 1
    return -1


@kernel
def total_of_positive(values: np.ndarray, out: np.ndarray) -> None:
    place = 0
    while place >= 0:
        place = next_positive(place, values)
        if place > 0:
            out[0] += float(values[place - 1])
