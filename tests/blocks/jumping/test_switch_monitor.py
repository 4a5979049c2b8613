"""A switch that is stuck or bounces is found in time, and a good one never is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.blocks.jumping.switch_monitor import SwitchMonitor
from aloft.blocks.signals import Phase, SwitchFault
from aloft.runtime.testing import BlockBench

OPEN, CLOSED = [False] * 4, [True] * 4
HEEL = [False, False, False, True]


def make(**params: Any) -> BlockBench[SwitchMonitor]:
    return BlockBench(
        SwitchMonitor, {"stand_time": 0.2, **params}, dimensions={"n_contacts": 4}, rate=500.0
    )


def step(
    bench: BlockBench[SwitchMonitor],
    closed: list[bool],
    phase: Phase,
    ticks: int,
    left: float = 0.2,
) -> None:
    bench.set("switches", closed=closed)
    in_the_air = phase is Phase.FLIGHT
    bench.set("phase", phase=int(phase), time_to_touchdown=left if in_the_air else 0.0)
    bench.step(ticks)


def faults(bench: BlockBench[SwitchMonitor]) -> list[SwitchFault]:
    return [SwitchFault(int(found)) for found in bench.get("health").fault]


GOOD = [SwitchFault.NONE] * 4


def test_a_good_jump_has_no_fault() -> None:
    bench = make()
    for closed, phase, ticks, left in (
        (CLOSED, Phase.STAND, 200, 0.0), (CLOSED, Phase.SQUAT, 200, 0.0),
        ([True, False] * 2, Phase.THRUST, 60, 0.0), (CLOSED, Phase.FLIGHT, 20, 0.3),
        (OPEN, Phase.FLIGHT, 120, 0.2), (CLOSED, Phase.FLIGHT, 15, 0.01),
        (CLOSED, Phase.LANDING, 5, 0.0), (OPEN, Phase.LANDING, 5, 0.0),
        ([True, False] * 2, Phase.RECOVER, 400, 0.0),
    ):  # fmt: skip
        step(bench, closed, phase, ticks, left)
    assert faults(bench) == GOOD and not bench.get("health").stop


def test_stuck_closed_is_found_in_the_air_and_stops_after_the_landing() -> None:
    bench = make()
    step(bench, CLOSED, Phase.THRUST, 100)
    step(bench, HEEL, Phase.FLIGHT, 40)
    assert faults(bench) == GOOD
    step(bench, HEEL, Phase.FLIGHT, 1)
    assert faults(bench)[3] == SwitchFault.STUCK_CLOSED and faults(bench)[:3] == GOOD[:3]
    assert not bench.get("health").stop
    step(bench, CLOSED, Phase.LANDING, 100)
    assert not bench.get("health").stop
    step(bench, CLOSED, Phase.RECOVER, 1)
    assert bench.get("health").stop
    assert faults(bench)[3] == SwitchFault.STUCK_CLOSED, "for good"


def test_just_before_touchdown_a_switch_may_close() -> None:
    bench = make()
    step(bench, HEEL, Phase.FLIGHT, 200, left=0.029)
    assert faults(bench) == GOOD


LIGHT_TOE = [True, True, False, True]


def test_stuck_open_is_found_while_it_stands() -> None:
    bench = make()
    step(bench, CLOSED, Phase.STAND, 10)
    step(bench, LIGHT_TOE, Phase.STAND, 100)
    assert faults(bench)[2] == SwitchFault.HEAVY and not bench.get("health").stop
    step(bench, LIGHT_TOE, Phase.STAND, 1)
    assert faults(bench)[2] == SwitchFault.STUCK_OPEN and bench.get("health").stop
    careless = make(stand_time=None)
    step(careless, OPEN, Phase.STAND, 500)
    assert faults(careless) == GOOD


def test_a_heavy_switch_ends_no_run_and_its_point_stands_while_the_robot_does() -> None:
    bench = make()
    step(bench, LIGHT_TOE, Phase.STAND, 50)
    assert faults(bench) == GOOD
    for phase, said in (
        (Phase.STAND, SwitchFault.HEAVY), (Phase.SQUAT, SwitchFault.HEAVY), (Phase.THRUST, SwitchFault.NONE)
    ):  # fmt: skip
        step(bench, LIGHT_TOE, phase, 101)
        assert faults(bench)[2] == said and not bench.get("health").stop
    step(bench, CLOSED, Phase.THRUST, 1)
    for phase, said in ((Phase.FLIGHT, SwitchFault.NONE), (Phase.RECOVER, SwitchFault.HEAVY)):
        step(bench, OPEN, phase, 101)
        assert faults(bench) == [*GOOD[:2], said, GOOD[3]] and not bench.get("health").stop


def test_a_switch_near_its_threshold_is_heavy_and_not_stuck() -> None:
    bench = make()
    for k in range(10):
        step(bench, CLOSED if k % 2 == 0 else LIGHT_TOE, Phase.STAND, 12)
    for _ in range(5):  # it goes on to close now and then
        step(bench, LIGHT_TOE, Phase.STAND, 1000)
        step(bench, CLOSED, Phase.STAND, 1)
    assert faults(bench)[2] == SwitchFault.HEAVY and not bench.get("health").stop


def test_a_switch_that_no_thrust_closes_is_stuck_and_stops_after_the_landing() -> None:
    bench = make()
    step(bench, LIGHT_TOE, Phase.STAND, 200)
    step(bench, LIGHT_TOE, Phase.THRUST, 100)
    step(bench, OPEN, Phase.FLIGHT, 1)
    assert faults(bench)[2] == SwitchFault.STUCK_OPEN and not bench.get("health").stop
    step(bench, LIGHT_TOE, Phase.LANDING, 100)
    assert not bench.get("health").stop
    step(bench, LIGHT_TOE, Phase.RECOVER, 1)
    assert bench.get("health").stop and faults(bench)[2] == SwitchFault.STUCK_OPEN


@pytest.mark.parametrize(("every", "most"), [(1, 95), (2, 210), (3, 380)])
def test_bouncing_is_found_by_its_changes(every: int, most: int) -> None:
    bench = make()
    ticks = 0
    while faults(bench) == GOOD and ticks < 1000:
        closed = (ticks // every) % 2 == 0
        step(bench, [closed, True, True, True], Phase.SQUAT, 1)
        ticks += 1
    assert faults(bench)[0] == SwitchFault.BOUNCING and bench.get("health").stop
    assert ticks <= most


def test_chatter_at_every_change_is_no_bouncing() -> None:
    bench = make()
    rng = np.random.default_rng(0)
    for _ in range(50):  # the toes in a thrust, near the switches' threshold
        step(bench, (rng.random(4) < 0.5).tolist(), Phase.THRUST, 1)
    for _ in range(20):  # hops: 8 ticks of chatter at each change
        for _ in range(8):
            step(bench, (rng.random(4) < 0.5).tolist(), Phase.LANDING, 1)
        step(bench, CLOSED, Phase.LANDING, 90)
        for _ in range(8):
            step(bench, (rng.random(4) < 0.5).tolist(), Phase.FLIGHT, 1)
        step(bench, OPEN, Phase.FLIGHT, 90)
    assert faults(bench) == GOOD


def test_counts_and_faults_survive_a_restore() -> None:
    bench = make()
    step(bench, HEEL, Phase.FLIGHT, 40)
    before = bench.snapshot()
    step(bench, HEEL, Phase.FLIGHT, 1)
    bench.restore(before)
    assert faults(bench) == GOOD
    step(bench, HEEL, Phase.FLIGHT, 1)
    assert faults(bench)[3] == SwitchFault.STUCK_CLOSED
