"""Clocks in virtual time: exact deadlines, overruns, both policies, blame; and a little real time."""

from collections.abc import Sequence

import pytest

from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.errors import AloftError, ExitCode
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.running.executor import Executor, run
from aloft.runtime.running.lateness import LatenessCounter
from aloft.runtime.running.pacing import Paced
from aloft.runtime.testing.graphs import BlockUse, checked_graph

MS = 1_000_000


class VirtualTime:
    """Time passes only when somebody sleeps, polls (1 us) or works."""

    def __init__(self) -> None:
        self.instant = 0
        self.slept: list[float] = []

    def now(self) -> int:
        return self.instant

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.instant += round(seconds * 1e9)


class PollingTime(VirtualTime):
    """Also looking at the clock takes time, so that a spin ends."""

    def now(self) -> int:
        self.instant += 10
        return self.instant


TIME = PollingTime()


class Worker(Block):
    """Takes its time: so many milliseconds in the given ticks."""

    class Params(Parameters):
        n: int = 1
        slow_ticks: list[int] = []
        takes: float = 0.0

    y = Output(Vector, text="nothing")
    begun: list[int] = []

    def step(self) -> None:
        if self.context.path == "a":
            self.begun.append(TIME.instant)
        if self.tick in self.params.slow_ticks:
            TIME.instant += round(self.params.takes * MS)


def paced(clock: ClockSpec, slow: Sequence[int], takes: float, ticks: int = 8) -> Executor:
    global TIME
    TIME = PollingTime()
    Worker.begun = []
    graph = checked_graph(
        {"a": BlockUse(Worker), "b": BlockUse(Worker, {"slow_ticks": list(slow), "takes": takes})},
        rate=500.0,
        ticks=ticks,
        clock=clock,
    )
    return Executor(graph, time_source=TIME)


def begun_ms() -> list[float]:
    return [round((instant - Worker.begun[0]) / MS, 2) for instant in Worker.begun]


def test_the_time_of_a_pause_is_no_lost_time() -> None:
    time = PollingTime()
    pacer = Paced(100.0, time, 0.1)
    assert pacer.wait(0) == 0
    time.instant += 25 * MS  # a tick that takes too long
    assert pacer.wait(1) > 0 and pacer.skipped_periods == 2
    time.instant += 5000 * MS
    pacer.restart()
    began = time.instant
    assert pacer.wait(2) == 0 and time.instant - began < MS, "it begins at once"
    assert pacer.wait(3) == 0 and (pacer.lateness.late, pacer.skipped_periods) == (1, 2)
    assert (time.instant - began) / MS == pytest.approx(10.0, abs=0.1), "and then in periods"


def test_a_playback_rate_stretches_the_periods() -> None:
    time = PollingTime()
    pacer = Paced(100.0, time, 0.1)
    pacer.wait(0)
    pacer.play(0.2)
    began = time.instant
    assert pacer.wait(1) == 0 and pacer.wait(2) == 0
    assert (time.instant - began) / MS == pytest.approx(50.0, abs=0.1)
    pacer.play(1.0)
    began = time.instant
    assert pacer.wait(3) == 0 and pacer.wait(4) == 0
    assert (time.instant - began) / MS == pytest.approx(10.0, abs=0.1)
    assert (pacer.lateness.late, pacer.skipped_periods) == (0, 0)


def test_ticks_begin_at_whole_periods() -> None:
    result = paced(ClockSpec("paced"), [2], 1.5).run()
    assert begun_ms() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]
    assert (result.overruns, result.skipped_periods, result.success) == (0, 0, True)
    assert max(TIME.slept) == pytest.approx(1.8e-3, abs=1e-6)  # the rest is spun


def test_an_overrun_skips_to_the_next_whole_period_and_blames_the_block() -> None:
    result = paced(ClockSpec("paced"), [2, 3], 4.5).run()
    # ticks 2 and 3 take 4.5 ms each: the tick after begins at the third deadline from theirs
    assert begun_ms() == [0.0, 2.0, 4.0, 10.0, 16.0, 18.0, 20.0, 22.0]
    assert (result.overruns, result.skipped_periods) == (2, 4)
    assert (result.blocks["a"].overruns, result.blocks["b"].overruns) == (0, 2)
    assert result.success


def test_the_stop_policy_ends_the_run() -> None:
    result = paced(ClockSpec("paced", "stop", 1), [2], 3.25).run()
    assert result.reason.startswith("overrun at tick 3 (0.006 s): 2.000 ms late, 1")
    assert result.reason.endswith(
        " in a row; block 'b' was running when the deadline passed, and the overrun "
        "policy is 'stop'"
    )
    assert (result.ticks, result.exit_code) == (3, ExitCode.RUN_FAILED)
    assert result.error is not None and result.error.block == "b"


def test_the_stop_policy_can_bear_some_in_a_row() -> None:
    assert paced(ClockSpec("paced", "stop", 3), [1, 2, 4, 5], 3.0).run().success
    result = paced(ClockSpec("paced", "stop", 3), [1, 2, 3], 3.0).run()
    assert not result.success and "3 in a row" in result.reason
    assert result.ticks == 4


def test_deadlines_do_not_drift_when_the_period_is_no_whole_number_of_nanoseconds() -> None:
    time = VirtualTime()
    pacer = Paced(300.0, time, 0.1)
    for tick in range(30_001):
        pacer.wait(tick)
        time.instant += 1_000
        # a virtual spin cannot end by itself: go to the deadline
        time.instant = max(time.instant, int((tick + 1) * 1e9 / 300.0))
    assert time.instant == int(30_001 * 1e9 / 300.0)
    assert pacer.lateness.late == 0


def test_without_pacing_nothing_is_waited_for() -> None:
    result = paced(ClockSpec("free"), [1, 2], 50.0).run()
    assert TIME.slept == []
    assert (result.overruns, result.blocks["b"].overruns) == (0, 0)


class LateSystem(PollingTime):
    """A system that wakes whoever sleeps a share of a period of 2 ms too late."""

    share = 0.98

    def sleep(self, seconds: float) -> None:
        super().sleep(seconds + 200e-6 + self.share * 2e-3)


def with_late_system(clock: ClockSpec, share: float) -> Executor:
    graph = checked_graph({"a": BlockUse(Worker)}, rate=500.0, ticks=50, clock=clock)
    time = LateSystem()
    time.share = share
    return Executor(graph, time_source=time)


def test_a_late_wake_up_makes_the_tick_late() -> None:
    result = with_late_system(ClockSpec("paced"), 0.98).run()
    assert (result.overruns, result.skipped_periods) == (25, 0), "the next one only polls"
    late = result.lateness
    assert late is not None and (late.ticks, late.late, late.late_after_us) == (49, 25, 200.0)
    assert 1960.0 <= late.max_us < 1961.0
    assert late.max_us == late.p50_us == late.p99_9_us, "none is above the longest"
    assert sum(count for _, count in late.histogram) == 49


def test_the_limit_of_lateness_is_a_share_of_the_period() -> None:
    assert with_late_system(ClockSpec("paced", late_after=0.99), 0.98).run().overruns == 0
    assert with_late_system(ClockSpec("paced"), 0.09).run().overruns == 0
    assert with_late_system(ClockSpec("paced"), 0.11).run().overruns == 49


def test_a_graph_may_say_how_many_ticks_may_be_late() -> None:
    result = with_late_system(ClockSpec("paced", late_share=0.4), 0.98).run()
    assert not result.success
    assert result.reason == "25 of 50 ticks began late, at most 40 % may (clock.late_share)"
    assert with_late_system(ClockSpec("paced", late_share=0.5), 0.98).run().success


def test_late_wake_ups_end_the_run_where_the_policy_is_to_stop() -> None:
    result = with_late_system(ClockSpec("paced", "stop", 3), 0.5).run()
    assert result.reason == (
        "overrun at tick 3 (0.006 s): 1.000 ms late, 3 in a row; no block was running when the "
        "deadline passed, and the overrun policy is 'stop'"
    )


def test_a_skipped_period_counts_from_the_deadline_that_passed() -> None:
    late = paced(ClockSpec("paced"), [2], 4.5).run().lateness
    assert late is not None and late.late == 1
    assert late.max_us == pytest.approx(4000.0, abs=0.1), "two periods of 2 ms"
    assert late.p50_us < 1.1


def test_the_buckets_hold_every_lateness() -> None:
    for lateness in [0, 1, 1023, 1024, 1151, 1152, 123_456, 10**9, (1 << 30) - 1, 1 << 30, 10**15]:
        counter = LatenessCounter(10**16)
        counter.add(lateness)
        ((edge, count),) = counter.result().histogram
        assert count == 1 and lateness < edge * 1e3
        if 1024 <= lateness < 1 << 30:
            assert edge * 1e3 <= 1.125 * lateness + 1.0, "an eighth too high at most"
        assert counter.result().max_us == lateness * 1e-3


class Driver(Block):
    """A robot that says when: every cycle; two were missed before the fourth."""

    class Params(Parameters):
        n: int = 1

    y = Output(Vector, text="nothing")
    waits = 0

    def wait(self) -> int:
        Driver.waits += 1
        if Driver.waits == 7:
            raise OSError("the bus is gone")
        return 2 if Driver.waits == 4 else 0

    def step(self) -> None:
        self.y.value.fill(Driver.waits)


def test_a_robot_drives_the_clock() -> None:
    Driver.waits = 0
    graph = checked_graph({"robot": BlockUse(Driver)}, clock=ClockSpec("robot"))
    result = run(graph, ticks=5)
    assert result.signal("robot.y.value")[:, 0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert (result.overruns, result.skipped_periods) == (1, 2)


class StampedDriver(Block):
    """A robot that says when its data were there, here 0.3 ms before the control thread woke."""

    class Params(Parameters):
        n: int = 1

    y = Output(Vector, text="nothing")

    def wait(self) -> int:
        TIME.instant += 2 * MS
        return 0

    def ready_at(self) -> int:
        return TIME.instant - 300_000

    def step(self) -> None:
        """Compute nothing."""


def test_a_robot_says_when_its_data_were_there() -> None:
    global TIME
    TIME = PollingTime()
    for share, late in ((0.1, 5), (0.2, 0)):
        clock = ClockSpec("robot", late_after=share)
        graph = checked_graph({"robot": BlockUse(StampedDriver)}, rate=500.0, clock=clock)
        result = Executor(graph, time_source=TIME).run(5)
        assert (result.overruns, result.skipped_periods) == (late, 0)
        assert result.lateness is not None and result.lateness.max_us == pytest.approx(300, abs=0.1)


def test_a_failing_wait_names_the_robot() -> None:
    Driver.waits = 0
    result = run(checked_graph({"robot": BlockUse(Driver)}, clock=ClockSpec("robot")))
    assert result.reason == "block 'robot' failed at tick 6 (0.012 s): OSError: the bus is gone"


def test_the_robot_clock_needs_one_driver() -> None:
    for blocks, found in (
        ({"a": BlockUse(Worker)}, "none"),
        ({"a": BlockUse(Driver), "b": BlockUse(Driver)}, "a, b"),
    ):
        with pytest.raises(AloftError) as caught:
            Executor(checked_graph(blocks, clock=ClockSpec("robot")))
        assert str(caught.value) == (
            f"clock 'robot' needs exactly one block with a wait() method; there is {found}"
        )


def test_wall_time_is_kept_to() -> None:
    graph = checked_graph({"a": BlockUse(Worker)}, rate=1000.0, ticks=101, clock=ClockSpec("paced"))
    results = [run(graph) for _ in range(5)]
    assert all(result.wall_time_s >= 0.1 for result in results)
    # not later either, unless the machine had no time for it, which shows as skipped periods
    assert any(result.skipped_periods or result.wall_time_s < 0.11 for result in results)
