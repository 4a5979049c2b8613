"""The estimate of another machine's clock is within its stated uncertainty."""

import random

from aloft.runtime.links.peers import ClockOffset

MS = 1_000_000


def exchange(
    here: ClockOffset, there: ClockOffset, now: int, ahead: int, out: int, back: int
) -> int:
    """One beacon each way; ``out`` and ``back`` are the times on the way. Returns the time after."""
    stamp = here.stamp(now)
    now += out
    there.update(stamp, now + ahead)
    now += 3 * MS
    stamp = there.stamp(now + ahead)
    now += back
    here.update(stamp, now)
    return now


def test_equal_ways_give_the_exact_offset() -> None:
    here, there = ClockOffset(), ClockOffset()
    assert (here.offset, here.uncertainty) == (0, -1)
    now = exchange(here, there, 10**12, 5_000 * MS, 2 * MS, 2 * MS)
    assert (here.offset, here.uncertainty) == (5_000 * MS, 2 * MS)
    exchange(here, there, now + 50 * MS, 5_000 * MS, 2 * MS, 2 * MS)
    assert there.offset == -5_000 * MS


def test_unequal_ways_stay_within_the_uncertainty() -> None:
    rng = random.Random(1)
    for ahead in (-7_000 * MS, 0, 123_456):
        here, there, now = ClockOffset(), ClockOffset(), 10**12
        for _ in range(30):
            out, back = rng.randrange(50_000, 5 * MS), rng.randrange(50_000, 5 * MS)
            now = exchange(here, there, now, ahead, out, back) + 50 * MS
            assert abs(here.offset - ahead) <= here.uncertainty
        assert here.uncertainty < 3 * MS


def test_drift_is_followed() -> None:
    here, there, now, ahead = ClockOffset(), ClockOffset(), 10**12, 0
    for _ in range(200):
        ahead += 50_000  # 100 us a second
        now = exchange(here, there, now, ahead, MS, MS) + 500 * MS
    assert abs(here.offset - ahead) <= 20 * 50_000


def test_a_restarted_clock_gives_no_estimate() -> None:
    here = ClockOffset()
    here.update([10, 1000, 5], 100)
    assert here.uncertainty == -1
