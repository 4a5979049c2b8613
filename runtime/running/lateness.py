"""Measures how late ticks begin: the time between a tick's deadline and the instant at which it begins.

The clock is read after the wait, so a late wake-up counts like work that took too long. Each tick
adds one to a histogram whose buckets are an eighth of an octave wide, so percentiles are at most an
eighth too high. Memory and time are the same for a second and for a month.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

FIRST_BITS, LAST_BITS = 11, 30
"""Bits of the shortest and the longest lateness [ns] that are told apart: 1 us to 1.07 s."""
BUCKETS = 8 * (LAST_BITS - FIRST_BITS + 1) + 2
"""Buckets: below 1 us, eight an octave, and above a second."""
_SHORTEST, _OFFSET = 1 << (FIRST_BITS - 1), 8 * FIRST_BITS + 7


@dataclass(frozen=True)
class TickLateness:
    """The lateness of the ticks of a run.

    Attributes:
        ticks: how many had a deadline; the first one, and the first after a pause, have none.
        late: how many began more than ``late_after_us`` after their deadline.
        late_after_us: the limit [us].
        p50_us, p99_us, p99_9_us: the lateness that so many percent of the ticks kept below [us], at
            most an eighth too high.
        max_us: the longest [us], exactly.
        histogram: pairs of a lateness [us] and the number of ticks below it and not below the pair
            before; only those with ticks.
    """

    ticks: int = 0
    late: int = 0
    late_after_us: float = 0.0
    p50_us: float = 0.0
    p99_us: float = 0.0
    p99_9_us: float = 0.0
    max_us: float = 0.0
    histogram: tuple[tuple[float, int], ...] = ()

    @classmethod
    def of(
        cls, histogram: Iterable[tuple[float, int]], late: int, limit_us: float, max_us: float
    ) -> TickLateness:
        """Make it from the pairs, in order; ``limit_us`` and ``max_us`` are in microseconds."""
        pairs = tuple((edge, count) for edge, count in histogram if count)
        sums = list(accumulate(count for _, count in pairs))
        ticks = sums[-1] if sums else 0

        def percentile(share: float) -> float:
            found = (edge for (edge, _), s in zip(pairs, sums, strict=True) if s >= share * ticks)
            return min(next(found, 0.0), max_us)

        return cls(
            ticks, late, limit_us, percentile(0.5), percentile(0.99), percentile(0.999), max_us, pairs
        )  # fmt: skip

    @classmethod
    def merged(cls, parts: Iterable[Mapping[str, Any] | None]) -> TickLateness | None:
        """Merge those of several parts of a run, each as in its JSON; none where no part was paced."""
        sums: dict[float, int] = {}
        found = [part for part in parts if part]
        for part in found:
            for edge, count in part["histogram"]:
                sums[edge] = sums.get(edge, 0) + count
        if not found:
            return None
        limit, most = (max(part[name] for part in found) for name in ("late_after_us", "max_us"))
        return cls.of(sorted(sums.items()), sum(part["late"] for part in found), limit, most)

    def __str__(self) -> str:
        p50, p99, p99_9, most, limit = (
            duration(1e3 * us)
            for us in (self.p50_us, self.p99_us, self.p99_9_us, self.max_us, self.late_after_us)
        )
        return (
            f"ticks began {p50} (median), {p99} (99 %), {p99_9} (99.9 %) and at most {most} after "
            f"their deadlines; {self.late} of {self.ticks} were more than {limit} late"
        )


def duration(nanoseconds: float) -> str:
    """Format a duration with three digits and a unit that fits."""
    for limit, scale, unit in ((1e6, 1e3, "µs"), (1e9, 1e6, "ms")):
        if nanoseconds < 0.9995 * limit:
            return f"{nanoseconds / scale:.3g} {unit}"
    return f"{nanoseconds / 1e9:.3g} s"


class LatenessCounter:
    """Counts how late ticks begin.

    Args:
        limit: a tick that begins so much after its deadline [ns] is not late yet.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.late = self.longest = 0
        self.counts = [0] * BUCKETS

    def add(self, lateness: int) -> bool:
        """Count a tick that begins ``lateness`` [ns] after its deadline, which is not negative.

        Returns whether it is late.
        """
        if lateness < _SHORTEST:
            self.counts[0] += 1
        else:  # the leading bit and three more select the bucket
            bits = lateness.bit_length()
            try:
                self.counts[(bits << 3) + (lateness >> (bits - 4)) - _OFFSET] += 1
            except IndexError:
                self.counts[-1] += 1
        if lateness > self.longest:  # noqa: PLR1730  # a call of max would take as long as all of this
            self.longest = lateness
        if lateness > self.limit:
            self.late += 1
            return True
        return False

    def result(self) -> TickLateness:
        """Return the outcome so far."""
        return lateness_of(self.counts, self.late, self.limit, self.longest)


def lateness_of(counts: Sequence[int], late: int, limit: int, longest: int) -> TickLateness:
    """Return what the counts of the buckets say; ``limit`` and ``longest`` are in nanoseconds."""
    return TickLateness.of(
        ((_upper_edge(i) * 1e-3, count) for i, count in enumerate(counts)),
        late, limit * 1e-3, longest * 1e-3,
    )  # fmt: skip


def _upper_edge(bucket: int) -> int:
    """Return the lateness [ns] at which a bucket ends; the last one has no end."""
    octave, eighth = divmod(bucket, 8)
    return (8 + eighth) << (FIRST_BITS - 4 + octave) if bucket < BUCKETS - 1 else 1 << 62
