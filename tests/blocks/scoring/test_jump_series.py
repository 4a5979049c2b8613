"""A row of jumps on made-up truth: it counts, and every jump in it is judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from aloft.blocks.scoring.jump_score import JumpScore
from aloft.runtime.testing.bench import BlockBench

PERIOD = 0.002
JUMPS = 3
SPEED, STANDING, WEIGHT = 1.2, 0.3287, 5.118 * 9.81
FLIGHT, EVERY, STRIDE = 2 * SPEED / 9.81, 0.55, 0.1
LIFT_OFFS = [1.0 + EVERY * k for k in range(JUMPS)]
FEET = np.array([[0.0425, -0.076], [-0.0425, -0.076], [0.0425, 0.076], [-0.0425, 0.076]])
Fields = dict[str, Any]
Change = Callable[[float, Fields], None]


def state(time: float) -> tuple[int, float, float]:
    """How many jumps have begun, time since the last lift-off, and the feet's x."""
    begun = sum(time >= start - 1e-9 for start in LIFT_OFFS)
    flown = time - LIFT_OFFS[begun - 1] if begun else 0.0
    return begun, flown, STRIDE * (begun - 1 + min(1.0, flown / FLIGHT)) if begun else 0.0


def motion(time: float) -> tuple[float, float]:
    """Height and vertical speed of the centre of mass, forced up just before every lift-off."""
    begun, flown, _ = state(time)
    if begun and flown < FLIGHT:
        return STANDING + SPEED * flown - 9.81 / 2 * flown**2, SPEED - 9.81 * flown
    soon = any(start - 0.01 <= time < start for start in LIFT_OFFS)
    return STANDING, SPEED if soon else 0.0


def truth_at(time: float) -> Fields:
    begun, flown, x = state(time)
    # The tick that ends at lift-off is spent on the ground, that of the touchdown in the air.
    air = bool(begun) and PERIOD - 1e-9 <= flown < FLIGHT
    height, speed = motion(time)
    feet = FEET + np.array([x, 0.0])
    return {
        "base_position": [x, 0.0, height + 0.05], "base_orientation": [0.0, 0.0, 0.0, 1.0],
        "com": [x, 0.0, height], "com_velocity": [0.0, 0.0, speed],
        "contact_position": np.column_stack([feet, np.full(4, 0.05 if air else 0.0)]),
        "contact_force": np.tile([0.0, 0.0, 0.0 if air else WEIGHT / 4], (4, 1)),
        "contact_touched": np.full(4, not air), "ground_height": np.zeros(4),
    }  # fmt: skip


def plan_at(time: float) -> Fields:
    """The reference names the next jump from the middle of a flight on."""
    begun, _, x = state(time)
    height, speed = motion(time)
    number = max(0, begun - 1)
    if begun and begun < JUMPS and time >= LIFT_OFFS[number] + FLIGHT / 2:
        number += 1
    return {
        "time": time, "lift_off_time": LIFT_OFFS[number],
        "touchdown_time": LIFT_OFFS[number] + FLIGHT,
        "com": [x, 0.0, height], "com_velocity": [0.0, 0.0, speed],
        "foot_position": [[x, -0.076, 0.0], [x, 0.076, 0.0]],
    }  # fmt: skip


def bench_of(change: Change, plain: bool, **params: Any) -> BlockBench[JumpScore]:
    """The judge after all that it watches."""
    wired = ("truth", "reference")
    values = {"jumps": JUMPS} | params
    bench = BlockBench(JumpScore, values, robot="bruce", rate=1 / PERIOD, wired=wired, plain=plain)
    while bench.stop_reason is None and bench.clock.tick * PERIOD < 8.0:
        time = bench.clock.tick * PERIOD
        truth = truth_at(time)
        change(time, truth)
        bench.set("truth", **truth)
        bench.set("reference", **plan_at(time))
        bench.step()
    return bench


def run(change: Change = lambda time, truth: None, **params: Any) -> tuple[Mapping[str, Any], str]:
    bench = bench_of(change, False, **params)
    return bench.block.metrics(), str(bench.stop_reason)


def test_a_perfect_row_succeeds() -> None:
    metrics, stopped = run()
    assert metrics["reason"] == "all criteria hold"
    assert metrics["jumps"] == JUMPS
    assert metrics["jump_distance_x_m"] == pytest.approx(JUMPS * STRIDE)
    assert metrics["worst_landing_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert metrics["planned_flight_time_s"] == pytest.approx(FLIGHT)
    assert stopped == "1.60 s after touchdown"


def test_the_row_ends_with_its_last_jump() -> None:
    metrics, stopped = run(jumps=2)
    assert metrics["success"] is False, "it went on jumping"
    assert metrics["jumps"] == 2
    metrics, stopped = run(jumps=4)
    assert metrics["reason"] == "made 3 of 4 jumps"
    assert stopped == "no other jump 1.50 s after touchdown"


def test_machine_code_follows_a_row_as_plain_python_does() -> None:
    """Every byte of what is kept is the same, with steps, slides and a fall at the end."""

    def change(time: float, truth: Fields) -> None:
        astray(time, truth)
        if time > LIFT_OFFS[-1] + FLIGHT + 0.3:
            truth["contact_touched"] = np.array([time % 0.3 > 0.05] * 2 + [True] * 2)
            truth["contact_position"] = truth["contact_position"] + [0.01 * time, 0.003, 0.0]
        if time > LIFT_OFFS[-1] + FLIGHT + 1.0:
            truth["base_position"] = [0.0, 0.0, 0.05]

    benches = [bench_of(change, plain, steps=2) for plain in (True, False)]
    assert benches[0].stop_reason == benches[1].stop_reason == "the robot fell"
    kept = [bench.snapshot() for bench in benches]
    assert kept[0] == kept[1]
    assert benches[0].block.metrics() == benches[1].block.metrics()


def within(start: float, end: float) -> Callable[[float], bool]:
    return lambda time: start <= time < end


SECOND = within(LIFT_OFFS[1], LIFT_OFFS[1] + FLIGHT)


def low(time: float, truth: Fields) -> None:
    if SECOND(time) and truth["com"][2] > STANDING + 0.05:
        truth["com"] = [0.0, 0.0, STANDING + 0.05]


def short(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[1] + 0.15, LIFT_OFFS[1] + FLIGHT)(time):
        truth["contact_touched"] = np.full(4, True)


def slow(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[1] - 0.01, LIFT_OFFS[1] + 0.004)(time):
        truth["com_velocity"] = [0.0, 0.0, 0.8 * SPEED]


def astray(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[0] + FLIGHT, LIFT_OFFS[1] + 0.02)(time):
        truth["contact_position"] = truth["contact_position"] + [0.0, 0.04, 0.0]


def askew(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[0] + FLIGHT, LIFT_OFFS[1] + 0.02)(time):
        shift = np.array([[0.0, 0.005, 0.0], [0.0, -0.005, 0.0]] * 2)
        truth["contact_position"] = truth["contact_position"] + shift


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (low, "jump 2: apex 32% off the planned rise, limit 10%"),
        (short, "jump 2: flight of 60% of the planned one, below 90%"),
        (slow, "jump 2: lift-off speed 20% off the plan, limit 10%"),
        (astray, "jump 1: landed 40.0 mm from its place, limit 30 mm"),
        (askew, "jump 1: landed 6.7 deg off its heading, limit 5 deg"),
    ],
)
def test_each_jump_is_judged(change: Callable[[float, Fields], None], words: str) -> None:
    metrics, _ = run(change)
    assert metrics["reason"] == words
    assert metrics["success"] is False


def test_a_bounce_is_no_jump() -> None:
    landed = LIFT_OFFS[0] + FLIGHT

    def bounce(time: float, truth: Fields) -> None:
        if within(landed + 0.02, landed + 0.06)(time):
            truth["contact_touched"] = np.full(4, False)

    assert run(bounce)[0]["reason"] == "all criteria hold"


def test_a_fall_comes_before_all_else() -> None:
    def fall(time: float, truth: Fields) -> None:
        if time > LIFT_OFFS[1] + FLIGHT + 0.1:
            truth["base_position"] = [0.0, 0.0, 0.05]

    metrics, stopped = run(fall)
    assert metrics["reason"].startswith("fell at ")
    assert metrics["jumps"] == 2
    assert stopped == "the robot fell"
