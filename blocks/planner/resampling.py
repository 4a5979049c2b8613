"""A plan's motion on another grid of the same phases: what a solve on that grid starts from.

A segment is a run of intervals of one kind: phase, contacts on the ground, impulse or not.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from .plan import JumpPlan

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Kinds = Sequence[Hashable]


def kinds_of(plan: JumpPlan) -> list[Hashable]:
    """The kind of every interval of a plan."""
    lasting = np.diff(plan.time) > 0.0
    return [
        (int(plan.phase[k]), tuple(np.flatnonzero(plan.contact[k]).tolist()), bool(lasting[k]))
        for k in range(len(plan.time) - 1)
    ]


def segments(kinds: Kinds) -> list[tuple[Hashable, int, int]]:
    """Runs of intervals of one kind: the kind, first interval, one behind the last."""
    found, start = list[tuple[Hashable, int, int]](), 0
    for kind, group in groupby(kinds):
        stop = start + len(list(group))
        found.append((kind, start, stop))
        start = stop
    return found


def same_phases(first: Kinds, second: Kinds) -> bool:
    """Whether both go through the same segments in the same order."""
    return [s[0] for s in segments(first)] == [s[0] for s in segments(second)]


def matching_places(
    time: Array, kinds: Kinds, steps: Array, others: Kinds
) -> tuple[Indices, Array]:
    """For every knot of a grid (intervals of lengths ``steps`` and kinds ``others``) the interval
    of the motion with knots at ``time`` and that many of ``kinds``, and how much of it is past.

    Only the proportions of ``steps`` within a segment count. Both (n_steps + 1,).
    """
    interval, past = np.zeros(len(steps) + 1, np.int64), np.zeros(len(steps) + 1)
    for (_, a, b), (_, c, d) in zip(segments(kinds), segments(others), strict=True):
        whole = float(steps[c:d].sum())
        share = np.concatenate([[0.0], np.cumsum(steps[c:d])[:-1]]) / (whole or 1.0)
        instants = time[a] + share * (time[b] - time[a])
        k = np.clip(np.searchsorted(time[a:b], instants + 1e-12, side="right") - 1, 0, None) + a
        interval[c:d] = k
        past[c:d] = (instants - time[k]) / np.where(time[k + 1] > time[k], time[k + 1] - time[k], 1)
    interval[-1], past[-1] = len(time) - 2, 1.0
    return interval, past


def states_at(
    interval: Indices, past: Array, time: Array, place: Array, rate: Array
) -> tuple[Array, Array]:
    """Places and rates within intervals: places by the cubic through both ends' places and rates,
    rates linearly."""
    k, u = interval, past[:, None]
    h = (time[k + 1] - time[k])[:, None]
    way = place[k + 1] - place[k]
    bend = 3.0 * way - h * (2.0 * rate[k] + rate[k + 1])
    twist = h * (rate[k] + rate[k + 1]) - 2.0 * way
    moved = place[k] + u * (h * rate[k] + u * (bend + u * twist))
    return moved, (1.0 - u) * rate[k] + u * rate[k + 1]


def means_between(interval: Indices, past: Array, time: Array, values: Array) -> Array:
    """Of what is constant over the intervals of ``time`` (rows of ``values``) the means between
    consecutive places; an interval of no length keeps its value. (n_places - 1, ...)"""
    lengths = np.diff(time)
    total = np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(lengths[:, None] * values[: len(lengths)], 0)]
    )
    sums = total[interval] + (past * lengths[interval])[:, None] * values[interval]
    spans = np.diff(time[interval] + past * lengths[interval])
    means = np.diff(sums, axis=0) / np.where(spans > 0.0, spans, 1.0)[:, None]
    return np.where(spans[:, None] > 0.0, means, values[interval[:-1]])
