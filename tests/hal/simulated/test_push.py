from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aloft.hal.simulated.push import Push
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

POINTS = list(find_robot("bruce").points)


def bench(**params: Any) -> BlockBench[Push]:
    return BlockBench(Push, params, robot="bruce", rate=500.0)


def run(push: BlockBench[Push], touched: list[bool]) -> np.ndarray:
    """The forces of as many ticks as there are flags for whether a toe touched."""
    forces = []
    for flag in touched:
        push.set("truth", contact_touched=[flag, False, False, False])
        push.step()
        forces.append(push.get("push").force.copy())
    return np.array(forces)


def test_pushes_once_the_delay_after_lift_off_for_its_duration() -> None:
    push = bench(force=70.0, duration=0.01, delay=0.03)
    forces = run(push, [True] * 10 + [False] * 40 + [True] * 10 + [False] * 40)
    assert push.get("push").point == POINTS.index("torso_com")
    # Tick 10 is the first to report a tick in the air, which began at tick 9; 0.03 s are 15 ticks.
    np.testing.assert_array_equal(np.nonzero(forces[:, 0])[0], range(24, 29))
    np.testing.assert_allclose(forces[24:29], [[70.0, 0.0, 0.0]] * 5)


@pytest.mark.parametrize("duration", ["10 ms", 0.0123, 0.0007])
def test_impulse_is_exact(duration: Any) -> None:
    push = bench(duration=duration)
    forces = run(push, [True] + [False] * 60)
    impulse = forces.sum(axis=0) * 0.002
    assert impulse[0] == pytest.approx(70.0 * push.block.params.duration, rel=1e-12)


def test_a_later_flight_is_pushed_and_short_ones_do_not_count() -> None:
    jump = [True] * 10 + [False] * 40
    forces = run(bench(flight=2), jump + [True] + [False] * 5 + jump + jump)
    assert np.nonzero(forces[:, 0])[0].tolist() == list(range(80, 85))


def test_contact_within_the_delay_begins_the_wait_anew() -> None:
    forces = run(bench(), [True] * 3 + [False] * 14 + [True] + [False] * 30)
    assert np.nonzero(forces[:, 0])[0][0] == 3 + 14 + 1 + 14


def test_never_pushes_a_robot_that_has_not_stood_or_with_no_force() -> None:
    assert not run(bench(), [False] * 50).any()
    assert not run(bench(force=0.0), [True] + [False] * 50).any()


def test_direction() -> None:
    forces = run(bench(angle="90 deg", delay=0.0), [True, False, False])
    np.testing.assert_allclose(forces[1], [0.0, 70.0, 0.0], atol=1e-12)
    forces = run(bench(angle=math.pi, elevation=math.pi / 4, delay=0.0), [True, False, False])
    half = 70.0 / math.sqrt(2)
    np.testing.assert_allclose(forces[1], [-half, 0.0, half], atol=1e-12)


def test_from_the_start() -> None:
    forces = run(bench(trigger="start", delay=0.01, point="right_knee"), [True] * 20)
    np.testing.assert_array_equal(np.nonzero(forces[:, 0])[0], range(5, 10))


def test_unknown_point_and_missing_robot() -> None:
    with pytest.raises(BlockError, match="bruce has no point 'head' to push at"):
        bench(point="head")
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(Push, {}, dimensions=find_robot("bruce").dimensions)
