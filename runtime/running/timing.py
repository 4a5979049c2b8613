"""Measures the time that each block takes: time stamps go into buffers made beforehand, and are
folded into statistics every ``STAMPED_TICKS`` timed ticks.

The executor takes one stamp before the first call of a tick and one after each call, so the time of
a call is the difference of two neighbouring stamps. A chain of blocks takes one more after each of
its blocks but the last. Nothing here allocates an array during a run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.call_sequence import CallSequence

STAMPED_TICKS = 128
"""Ticks that are stamped before they are folded; folding takes tens of microseconds."""
KEPT_TICKS = 2048
"""The number of last ticks of each phase from which the percentiles are computed."""


FIRST_TIMED = 1024
TIMED_EVERY = 32
"""Interval of timed runs: where no deadline is watched, the first runs of a phase with chains are
all timed, and then one in this many: reading the clock takes several times as long as a small
block."""


@dataclass(frozen=True)
class BlockTimes:
    """The number of runs of one block and the time of one run [us].

    ``overruns`` counts the deadlines that passed while the block ran. Percentiles are taken over
    the last runs, all other figures over all runs.
    """

    calls: int = 0
    mean_us: float = 0.0
    p50_us: float = 0.0
    p99_us: float = 0.0
    max_us: float = 0.0
    overruns: int = 0


class Program:
    """The calls of one phase of the hyperperiod, in order, and the times they took.

    ``owners`` gives the path of the block that each call belongs to; it is empty for a call of the
    runtime, and for a ``CallSequence`` it is the chain. A block that is called twice in a tick (``emit`` and
    ``update``) counts as one run.

    Args:
        now: the clock, which chains need where times are taken.
        sampled: whether only some runs are timed; see ``TIMED_EVERY``.
    """

    def __init__(
        self,
        calls: Sequence[Callable[[], Any]],
        owners: Sequence[str | CallSequence],
        now: Callable[[], int] | None = None,
        *,
        sampled: bool = False,
    ) -> None:
        self.sampled = sampled
        self.untimed = 0
        """Runs that were not timed."""
        self._runs = 0
        self.calls = tuple(calls)
        starts, ends, names = _columns(owners)
        self.owners = tuple(names)
        self.chains = tuple(owner for owner in owners if isinstance(owner, CallSequence))
        self.ticks = 0
        own, columns = len(self.calls) + 1, len(names)
        self._starts, self._ends = np.array(starts, np.intp), np.array(ends, np.intp)
        self._stamps = np.zeros((STAMPED_TICKS, max([own, *(end + 1 for end in ends)])), np.int64)
        self._before = np.zeros((STAMPED_TICKS, columns), np.int64)
        self._after = np.zeros((STAMPED_TICKS, columns), np.int64)
        self._row = 8 * self._stamps.shape[1]
        self._bytes = self._stamps.data.cast("B")
        self._pack = Struct(f"{own}q").pack_into
        self._cursor = 0
        self._base = self._stamps.ctypes.data
        self._place = np.array([self._base], np.int64)
        self._place_value = self._place.data
        first = own
        for chain in self.chains:
            if now is not None:
                chain.stamp(self._place, first, now)
            first += len(chain.owners) - 1
        self._kept: NDArray[np.int64] = np.zeros((KEPT_TICKS, columns), np.int64)
        self._total = np.zeros(columns, np.int64)
        self._maximum = np.zeros(columns, np.int64)
        self._scratch = np.zeros(columns, np.int64)
        met: dict[str, int] = {}
        self._again: list[tuple[int, int]] = []
        for column, owner in enumerate(self.owners):
            if owner and owner in met:
                self._again.append((met[owner], column))
            met.setdefault(owner, column)
        self.columns = {owner: column for owner, column in met.items() if owner}

    def times_this_run(self) -> bool:
        """Return whether the run that begins now is timed; if it is not, its chains read no
        clock."""
        self._runs += 1
        timed = self._runs <= FIRST_TIMED or self._runs % TIMED_EVERY == 0
        self._place_value[0] = self._base + self._cursor if timed else 0
        self.untimed += not timed
        return timed

    def keep(self, stamps: Sequence[int]) -> None:
        """Keep the stamps [ns] of one tick: one before the first call and one after each call."""
        self._pack(self._bytes, self._cursor, *stamps)
        self._cursor += self._row
        if self._cursor == len(self._bytes):
            self.fold()
        self._place_value[0] = self._base + self._cursor

    @property
    def last_stamps(self) -> tuple[NDArray[np.int64], int]:
        """The buffer of stamps, (STAMPED_TICKS, owners + 1), in the order ``stamp_order``, and how
        many of its rows are newer than the rest. The other rows are those of the ticks before, if
        as many have run."""
        return self._stamps, self._cursor // self._row

    @property
    def stamp_order(self) -> tuple[int, ...]:
        """The places of a tick's stamps in their row, in the order of time: the one before the
        first owner, and the one after each."""
        return (0, *self._ends.tolist())

    def fold(self) -> None:
        """Add the kept stamps to the statistics and empty their buffer."""
        rows = self._cursor // self._row
        self._cursor = 0
        self._place_value[0] = self._base
        if rows == 0 or not self.calls:
            self.ticks += rows
            return
        place = min(self.ticks % KEPT_TICKS, KEPT_TICKS - rows)
        kept = self._kept[place : place + rows]
        stamps, before, after = self._stamps[:rows], self._before[:rows], self._after[:rows]
        np.take(stamps, self._starts, axis=1, out=before, mode="clip")
        np.take(stamps, self._ends, axis=1, out=after, mode="clip")
        np.subtract(after, before, out=kept)
        for column, again in self._again:
            np.add(kept[:, column], kept[:, again], out=kept[:, column])
        np.sum(kept, axis=0, out=self._scratch)
        self._total += self._scratch
        np.max(kept, axis=0, out=self._scratch)
        np.maximum(self._maximum, self._scratch, out=self._maximum)
        self.ticks += rows

    def running_at(self, instant: int) -> str:
        """Return the owner of the call that ran at ``instant`` [ns] of the last stamped tick."""
        ends = self._stamps[self._cursor // self._row - 1, self._ends].tolist()
        return next((o for o, end in zip(self.owners, ends, strict=True) if end > instant), "")

    def times(self, block: str) -> tuple[int, int, int, NDArray[np.int64]]:
        """Return a block's times in this phase: runs, total and longest [ns], and the kept times
        [ns].

        The total of all runs follows from those that were timed.
        """
        column = self.columns[block]
        kept = self._kept[: min(self.ticks, KEPT_TICKS), column]
        runs, total = self.ticks + self.untimed, int(self._total[column])
        return runs, total * runs // self.ticks, int(self._maximum[column]), kept


def _columns(owners: Sequence[str | CallSequence]) -> tuple[list[int], list[int], list[str]]:
    """Return, for every block's run in a tick, the places of the stamps before and after it, and
    its path.

    The places before ``len(owners) + 1`` are those of the stamps that the executor takes.
    """
    starts: list[int] = []
    ends: list[int] = []
    names: list[str] = []
    free = len(owners) + 1
    for place, owner in enumerate(owners):
        paths = [o.name for o in owner.owners] if isinstance(owner, CallSequence) else [owner]
        inner = range(free, free + len(paths) - 1)
        free += len(inner)
        starts += [place, *inner]
        ends += [*inner, place + 1]
        names += paths
    return starts, ends, names


def block_times(programs: Sequence[Program], block: str, overruns: int = 0) -> BlockTimes:
    """One block's times over all phases.

    In the percentiles the kept runs of a phase have the weight of all runs of that phase.
    """
    parts = [p.times(block) for p in programs if block in p.columns and p.ticks]
    if not parts:
        return BlockTimes(overruns=overruns)
    calls = sum(part[0] for part in parts)
    samples = np.concatenate([kept for *_, kept in parts])
    weights = np.concatenate([np.full(len(kept), runs / len(kept)) for runs, _, _, kept in parts])
    total, longest = sum(part[1] for part in parts), max(part[2] for part in parts)
    return _times(calls, total, longest, samples, weights, overruns)


def times_of(
    kept: NDArray[np.int64], calls: int, total: int, longest: int, overruns: int = 0
) -> BlockTimes:
    """Return the times of a block that were taken elsewhere: the last ones, and of all runs their
    number, total and longest; all in ns."""
    if not calls:
        return BlockTimes(overruns=overruns)
    return _times(calls, total, longest, kept, np.ones(len(kept)), overruns)


def _times(
    calls: int,
    total: int,
    longest: int,
    samples: NDArray[np.int64],
    weights: NDArray[np.float64],
    overruns: int,
) -> BlockTimes:
    order = np.argsort(samples, kind="stable")
    shares = np.cumsum(weights[order]) / weights.sum()

    def percentile(share: float) -> float:
        index = min(int(np.searchsorted(shares, share - 1e-12)), len(samples) - 1)
        return float(samples[order[index]]) * 1e-3

    return BlockTimes(
        calls=calls,
        mean_us=total / calls * 1e-3,
        p50_us=percentile(0.50),
        p99_us=percentile(0.99),
        max_us=longest * 1e-3,
        overruns=overruns,
    )
