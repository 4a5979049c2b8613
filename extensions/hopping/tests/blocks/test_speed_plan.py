"""``SpeedPlan`` mixes rows of several speeds; the mixture moves smoothly from one jump to the next."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from aloft.blocks.signals import Phase
from aloft.extensions.hopping.blocks.speed_plan import SpeedPlan
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

TIMES = {"flight_time": 0.262, "contact_time": 0.25}
HOP = 0.512


def played(speeds: list[float], jumps: int) -> dict[str, np.ndarray]:
    """The reference in every tick, where each jump is told its speed before it begins."""
    bench = BlockBench(SpeedPlan, {**TIMES, "jumps": jumps}, robot="bruce")
    names = ("time", "phase", "com", "com_velocity", "foot_position", "lift_off_time")
    found: dict[str, list[np.ndarray]] = {name: [] for name in (*names, "number", "goal")}
    for _ in range(int((1.5 + HOP * jumps) / 0.002)):
        landed = int(bench.get("goal").number)
        bench.set("twist", linear=[speeds[min(landed, len(speeds) - 1)], 0.0, 0.0])
        bench.step()
        for name in names:
            found[name].append(np.array(getattr(bench.get("reference"), name)))
        found["number"].append(np.array(bench.get("goal").number))
        found["goal"].append(np.array(bench.get("goal").position)[0])
    return {name: np.array(rows) for name, rows in found.items()}


@pytest.mark.long
def test_each_jump_has_its_length_and_nothing_leaps() -> None:
    speeds = [0.1, 0.3, 0.35, 0.2, 0.0, 0.0]
    found = played(speeds, 6)
    goals = [found["goal"][found["number"] == n][-1] for n in range(1, 7)]
    assert np.diff([0.0, *goals]) == pytest.approx(np.array(speeds) * HOP, abs=1e-6)
    middle = found["foot_position"].mean(axis=1)[:, 0]
    assert middle[-1] == pytest.approx(goals[-1], abs=1e-3)
    assert found["com"][-1, 0] == pytest.approx(goals[-1], abs=0.03)
    assert np.abs(np.diff(found["com"], axis=0)).max() < 3e-3
    assert np.abs(np.diff(middle)).max() < 5e-3
    # The velocity is that of the place, where speeds change too.
    speed = np.gradient(found["com"][:, 0], found["time"])
    flies = found["phase"] == Phase.FLIGHT
    stands = ~(flies | np.roll(flies, 1) | np.roll(flies, 2) | np.roll(flies, -1))
    assert np.abs(speed - found["com_velocity"][:, 0])[stands].max() < 0.02
    # What flies falls.
    steady = flies & np.roll(flies, 1) & np.roll(flies, -1)
    falling = np.gradient(found["com_velocity"][:, 2], found["time"])
    assert falling[steady] == pytest.approx(-9.81, abs=0.3)


@pytest.mark.long
def test_the_end_is_slow_and_a_jump_follows_another_until_then() -> None:
    found = played([0.8], 6)
    goals = [0.0] + [found["goal"][found["number"] == n][-1] for n in range(1, 7)]
    assert np.diff(goals) / HOP == pytest.approx([0.4, 0.6, 0.8, 0.8, 0.6, 0.4])
    lift_offs = np.unique(found["lift_off_time"].round(6))
    assert np.diff(lift_offs) == pytest.approx(HOP)
    assert len(lift_offs) == 6


@pytest.mark.long
def test_rows_that_nothing_can_jump_are_refused() -> None:
    with pytest.raises(BlockError, match="no row of jumps of"):
        BlockBench(SpeedPlan, {"flight_time": 2.9, "contact_time": 0.25}, robot="bruce")


def test_speeds_must_rise() -> None:
    with pytest.raises(ValidationError, match="rising speeds"):
        BlockBench(SpeedPlan, {**TIMES, "speeds": [0.2, 0.0]}, robot="bruce")
