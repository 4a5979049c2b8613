"""Measures the time that each block takes: time stamps go into buffers made beforehand, and are
folded into statistics every ``STAMPED_TICKS`` ticks.

The executor takes one stamp before the first call of a tick and one after each call, so the time of
a call is the difference of two neighbouring stamps. Nothing here allocates an array during a run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

STAMPED_TICKS = 128
"""Ticks that are stamped before they are folded; folding takes tens of microseconds."""
KEPT_TICKS = 2048
"""The number of last ticks of each phase from which the percentiles are computed."""


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
    runtime. A block that is called twice in a tick (``emit`` and ``update``) counts as one run.
    """

    def __init__(self, calls: Sequence[Callable[[], Any]], owners: Sequence[str]) -> None:
        self.calls = tuple(calls)
        self.owners = tuple(owners)
        self.width = len(self.calls) + 1
        self.ticks = 0
        self._stamps = np.zeros((STAMPED_TICKS, self.width), np.int64)
        self._bytes = self._stamps.data.cast("B")
        self._pack = Struct(f"{self.width}q").pack_into
        self._cursor = 0
        self._kept: NDArray[np.int64] = np.zeros((KEPT_TICKS, len(self.calls)), np.int64)
        self._total = np.zeros(len(self.calls), np.int64)
        self._maximum = np.zeros(len(self.calls), np.int64)
        self._scratch = np.zeros(len(self.calls), np.int64)
        first: dict[str, int] = {}
        self._again: list[tuple[int, int]] = []
        for column, owner in enumerate(self.owners):
            if owner and owner in first:
                self._again.append((first[owner], column))
            first.setdefault(owner, column)
        self.columns = {owner: column for owner, column in first.items() if owner}

    def keep(self, stamps: Sequence[int]) -> None:
        """Keep the stamps [ns] of one tick: one before the first call and one after each call."""
        self._pack(self._bytes, self._cursor, *stamps)
        self._cursor += 8 * self.width
        if self._cursor == len(self._bytes):
            self.fold()

    @property
    def last_stamps(self) -> tuple[NDArray[np.int64], int]:
        """The buffer of stamps, (STAMPED_TICKS, calls + 1), and how many of its rows are newer than
        the rest. The other rows are those of the ticks before, if as many have run."""
        return self._stamps, self._cursor // (8 * self.width)

    def fold(self) -> None:
        """Add the kept stamps to the statistics and empty their buffer."""
        rows = self._cursor // (8 * self.width)
        self._cursor = 0
        if rows == 0 or not self.calls:
            self.ticks += rows
            return
        place = min(self.ticks % KEPT_TICKS, KEPT_TICKS - rows)
        kept = self._kept[place : place + rows]
        stamps = self._stamps[:rows]
        np.subtract(stamps[:, 1:], stamps[:, :-1], out=kept)
        for column, again in self._again:
            np.add(kept[:, column], kept[:, again], out=kept[:, column])
        np.sum(kept, axis=0, out=self._scratch)
        self._total += self._scratch
        np.max(kept, axis=0, out=self._scratch)
        np.maximum(self._maximum, self._scratch, out=self._maximum)
        self.ticks += rows

    def running_at(self, instant: int) -> str:
        """The owner of the call that ran at ``instant`` [ns] of the last stamped tick."""
        ends = self._stamps[self._cursor // (8 * self.width) - 1, 1:].tolist()
        return next((o for o, end in zip(self.owners, ends, strict=True) if end > instant), "")

    def times(self, block: str) -> tuple[int, int, int, NDArray[np.int64]]:
        """A block's times in this phase: runs, total and longest [ns], and the kept times [ns]."""
        column = self.columns[block]
        kept = self._kept[: min(self.ticks, KEPT_TICKS), column]
        return self.ticks, int(self._total[column]), int(self._maximum[column]), kept


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
    order = np.argsort(samples, kind="stable")
    shares = np.cumsum(weights[order]) / weights.sum()

    def percentile(share: float) -> float:
        index = min(int(np.searchsorted(shares, share - 1e-12)), len(samples) - 1)
        return float(samples[order[index]]) * 1e-3

    return BlockTimes(
        calls=calls,
        mean_us=sum(part[1] for part in parts) / calls * 1e-3,
        p50_us=percentile(0.50),
        p99_us=percentile(0.99),
        max_us=max(part[2] for part in parts) * 1e-3,
        overruns=overruns,
    )
