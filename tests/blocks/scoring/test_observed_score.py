"""What a robot sees of a hop is judged: a good one passes, and each criterion can fail alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aloft.blocks.scoring.observed_score import ObservedScore
from aloft.blocks.signals import Phase
from aloft.runtime.testing import BlockBench

LIFT_OFF, TOUCHDOWN, REST = 1.0, 1.2, 1.5
PERIOD = 0.01
Tick = dict[str, Any]


def hop(time: float) -> Tick:
    """A hop by the plan, as its sensors show it."""
    phase = Phase.STAND
    if time >= 0.5:
        phase = Phase.SQUAT
    if time >= LIFT_OFF:
        phase = Phase.FLIGHT
    if time >= TOUCHDOWN:
        phase = Phase.LANDING
    flying = phase == Phase.FLIGHT
    depth = 0.05 if phase == Phase.SQUAT else 0.0
    return {
        "phase": phase, "time": time, "loaded": [not flying] * 4, "lean": 0.02,
        "height": 0.4 - depth, "speed": 0.0,
    }  # fmt: skip


def stance(time: float) -> Tick:
    """Standing."""
    return {**hop(0.0), "time": time}


def run(
    change: Callable[[Tick], None] = lambda tick: None, motion: Callable[[float], Tick] = hop,
    flight: bool = True, **params: Any,
) -> dict[str, Any]:  # fmt: skip
    bench = BlockBench(ObservedScore, params, robot="bruce", rate=1.0 / PERIOD)
    for k in range(-20, 400):
        tick = motion(k * PERIOD)
        if k < 0:
            tick |= {"phase": Phase.HANG, "lean": 0.5, "loaded": [False] * 4}
        change(tick)
        half = 0.5 * tick["lean"]
        times = {"lift_off_time": LIFT_OFF, "touchdown_time": TOUCHDOWN} if flight else {}
        bench.set("base", orientation=[0.0, math.sin(half), 0.0, math.cos(half)])
        bench.set("terms", com=[0.0, 0.0, tick["height"]], com_velocity=[0.0, tick["speed"], 0.0])
        bench.set("contacts", active=np.array(tick["loaded"]))
        bench.set("phase", phase=tick["phase"])
        bench.set("reference", time=tick["time"], **times)
        bench.step()
        if bench.block.record.judged >= 0.0:
            break
    return dict(bench.block.metrics())


def test_a_good_hop_passes_with_its_figures() -> None:
    found = run()
    assert found["success"], found["reason"]
    assert found["observed_flight_s"] == pytest.approx(0.2, abs=1e-9)
    assert found["observed_rise_m"] == pytest.approx(9.80665 * 0.04 / 8.0, rel=1e-3)
    assert found["observed_depth_m"] == pytest.approx(0.05)
    assert found["observed_tilt_deg"] == pytest.approx(math.degrees(0.02))


def test_a_stance_needs_no_flight() -> None:
    found = run(motion=stance, flight=False, judge_time=2.0)
    assert found["success"] and found["observed_flight_s"] == 0.0


def test_a_lean_that_the_thrust_plans_is_none() -> None:
    def lean(tick: Tick) -> None:
        if tick["phase"] == Phase.SQUAT:
            tick["lean"] = 0.5

    assert run(lean)["success"]


def at(begin: float, **values: Any) -> Callable[[Tick], None]:
    def change(tick: Tick) -> None:
        if tick["time"] >= begin - 1e-9:
            tick |= values

    return change


def never_down(tick: Tick) -> None:
    tick["phase"] = Phase.HANG


def late(tick: Tick) -> None:
    if tick["phase"] == Phase.FLIGHT and tick["time"] < 1.1:
        tick["loaded"] = [False, False, True, False]


WRONG = {
    "was not put down": (never_down, {}),
    "the phase was FAULT": (at(2.0, phase=Phase.FAULT), {}),
    "it leaned by 17.2 deg of 14.9": (at(1.3, lean=0.3), {}),
    "before the rest was judged": (at(1.3, time=1.3), {}),
    "in the air for 100 ms of 200": (late, {}),
    "squatted by 50 mm, not by 80": (at(0.0), {"squat_depth": 0.08}),
    "leans by 8.6 deg at rest": (at(2.5, lean=0.15), {}),
    "its com moves at 0.30 m/s": (at(2.5, speed=0.3), {}),
    "3 of 4 points": (at(2.5, loaded=[True, True, True, False]), {}),
}


@pytest.mark.parametrize("text", WRONG)
def test_each_criterion_can_fail(text: str) -> None:
    change, params = WRONG[text]
    found = run(change, **params)
    assert not found["success"] and text in found["reason"]
