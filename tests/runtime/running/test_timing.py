"""Statistics of block times from known stamps."""

import numpy as np
import pytest

from aloft.runtime.running.timing import KEPT_TICKS, STAMPED_TICKS, BlockTimes, Program, block_times


def nothing() -> None: ...


def program(*owners: str) -> Program:
    return Program([nothing] * len(owners), owners)


def keep(timed: Program, *durations: int, start: int = 1_000_000) -> None:
    timed.keep([start, *(start + int(total) for total in np.cumsum(durations))])


def test_mean_percentiles_and_maximum() -> None:
    timed = program("a", "", "b")
    for i in range(1, 101):
        keep(timed, 1000 * i, 7_000_000, 500)
    timed.fold()
    assert block_times([timed], "a") == BlockTimes(100, 50.5, 50.0, 99.0, 100.0, 0)
    assert block_times([timed], "b", 3) == BlockTimes(100, 0.5, 0.5, 0.5, 0.5, 3)


def test_emit_and_update_are_one_run() -> None:
    timed = program("robot", "pd", "", "robot")
    keep(timed, 1000, 10, 20, 4000)
    timed.fold()
    assert block_times([timed], "robot") == BlockTimes(1, 5.0, 5.0, 5.0, 5.0, 0)
    assert block_times([timed], "pd").mean_us == pytest.approx(0.01)


def test_all_runs_count_but_only_the_last_are_kept_for_percentiles() -> None:
    timed = program("a")
    runs = KEPT_TICKS * 2 + 3
    keep(timed, 9_000_000)
    for _ in range(runs - 1):
        keep(timed, 2000)
    timed.fold()
    times = block_times([timed], "a")
    assert times.calls == runs
    assert times.max_us == 9000.0
    assert times.p99_us == 2.0
    assert times.mean_us == pytest.approx((9000.0 + 2.0 * (runs - 1)) / runs)


def test_folding_at_any_time_loses_nothing() -> None:
    timed = program("a")
    total = 0
    for stretch in (1, STAMPED_TICKS - 1, STAMPED_TICKS, 5, 3 * KEPT_TICKS, 7, 60):
        for i in range(stretch):
            keep(timed, 100 + i % 3)
        total += stretch
        timed.fold()
        times = block_times([timed], "a")
        assert times.calls == total
        assert 0.0999 <= times.p50_us <= times.p99_us <= 0.1021


def test_phases_weigh_by_how_often_they_run() -> None:
    often, seldom = program("a", "b"), program("a")
    for _ in range(KEPT_TICKS * 3):
        keep(often, 1000, 1)
    for _ in range(KEPT_TICKS):
        keep(seldom, 3000)
    often.fold()
    seldom.fold()
    times = block_times([often, seldom], "a")
    # three quarters of the runs took 1 us, though both phases keep as many
    assert (times.calls, times.p50_us, times.p99_us) == (KEPT_TICKS * 4, 1.0, 3.0)
    assert times.mean_us == pytest.approx(1.5)
    assert block_times([often, seldom], "b").calls == KEPT_TICKS * 3


def test_a_block_that_never_ran() -> None:
    assert block_times([program("a")], "a", 0) == BlockTimes()


def test_who_was_running_at_an_instant() -> None:
    timed = program("a", "", "b")
    for ticks in range(STAMPED_TICKS):  # the last one folds: the row must still be found
        keep(timed, 10, 10, 10, start=1000 * ticks)
        at = [timed.running_at(1000 * ticks + offset) for offset in (5, 10, 15, 25, 29, 30)]
        assert at == ["a", "", "", "b", "b", ""]
