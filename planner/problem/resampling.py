"""A plan's motion at other instants of the same phases: what a solve on another grid starts from."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from ...mathematics.arrays import Array

Phases = Sequence[int]


def segments(phases: Phases) -> list[tuple[int, int, int]]:
    """Runs of intervals in one phase: (phase, first interval, one behind the last)."""
    found, start = [], 0
    for phase, group in groupby(int(phase) for phase in phases):
        stop = start + len(list(group))
        found.append((phase, start, stop))
        start = stop
    return found


def same_phases(first: Phases, second: Phases) -> bool:
    """Whether both go through the same phases in the same order."""
    return [s[0] for s in segments(first)] == [s[0] for s in segments(second)]


def matching_times(time: Array, phases: Phases, steps: Array, others: Phases) -> Array:
    """For every knot of a grid (interval lengths ``steps`` in phases ``others``) the instant of the
    motion with knots at ``time`` and intervals in ``phases`` that is as far into the same phase.

    Only the proportions of ``steps`` within a phase count. (n_steps + 1,)
    """
    out = np.empty(len(steps) + 1)
    for (_, a, b), (_, c, d) in zip(segments(phases), segments(others), strict=True):
        share = np.concatenate([[0.0], np.cumsum(steps[c:d])]) / steps[c:d].sum()
        out[c : d + 1] = time[a] + share * (time[b] - time[a])
    return out


def states_at(instants: Array, time: Array, place: Array, rate: Array) -> tuple[Array, Array]:
    """Places and rates at those instants between knots: places by the cubic through both ends'
    places and rates, rates linearly."""
    k = np.clip(np.searchsorted(time, instants + 1e-12, side="right") - 1, 0, len(time) - 2)
    h = (time[k + 1] - time[k])[:, None]
    u = (instants[:, None] - time[k][:, None]) / h
    way = place[k + 1] - place[k]
    bend = 3.0 * way - h * (2.0 * rate[k] + rate[k + 1])
    twist = h * (rate[k] + rate[k + 1]) - 2.0 * way
    moved = place[k] + u * (h * rate[k] + u * (bend + u * twist))
    return moved, (1.0 - u) * rate[k] + u * rate[k + 1]


def means_over(instants: Array, time: Array, values: Array) -> Array:
    """Of what is constant over the intervals of ``time`` (rows of ``values``) the means between
    the instants, (n_instants - 1, ...)."""
    total = np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(np.diff(time)[:, None] * values[: len(time) - 1], 0)]
    )
    sums = np.column_stack([np.interp(instants, time, column) for column in total.T])
    return np.asarray(np.diff(sums, axis=0) / np.diff(instants)[:, None])
