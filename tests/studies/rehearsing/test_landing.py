"""The rehearsal of a landing: what is learnt from a known plant, and what a real run missed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from aloft.mathematics.arrays import Array
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.rehearsed import ZERO, Vector
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.runtime.graph import load
from aloft.runtime.running.run_result import RunResult
from aloft.studies.rehearsing.landing import (
    LARGEST,
    LEARNT,
    LEAST_SHARE,
    LOST,
    Measure,
    Touchdown,
    angles_of,
    learn_landing,
    response,
    touchdown_of,
)
from aloft.studies.rehearsing.lift_off import LiftOff

GRAPHS = SHIPPED.parent
BRUCE = find_robot("bruce")
UNIT = 0.5
ERROR = np.array([0.008, -0.004, 0.06, -0.12, 0.02])
SPREAD = np.array([-1.0, 0.0, 1.0])[:, None] * 1e-3


def plan_of(task: str) -> PlannedJump:
    plan = PlanLibrary(BRUCE, SHIPPED).find(read_task(GRAPHS / "tasks" / f"{task}.yaml"))
    assert plan is not None
    return plan


def plant(answer: Array, error: Array = ERROR, landing: float = 1.0) -> Measure:
    """A robot that lands with ``error`` + ``answer`` times the correction. It lands as long as no correction
    is larger than ``landing``, and uses as much of what is allowed as it is tilted or off its place."""

    def measure(velocity: Vector, momentum: Vector) -> Sequence[Touchdown]:
        correction = np.array(velocity + momentum)
        lands = bool(np.abs(correction).max() <= landing)
        found = [error + answer @ correction[LEARNT] + each for each in SPREAD]
        missed = LiftOff(correction, lands)
        return [Touchdown(missed, each, 5.0 * float(np.abs(each).max())) for each in found]

    return measure


@pytest.mark.parametrize("task", ["in_situ_32cm", "turn_180deg"])
def test_a_landing_that_is_off_is_learnt(task: str) -> None:
    answer = response(plan_of(task), BRUCE.total_mass)
    # The real robot answers by a quarter more, and one axis by the other a little.
    real = 1.25 * answer + 0.05 * np.roll(answer, 1, axis=0)
    found = learn_landing(plant(real), answer, UNIT, seeds=(1, 2, 3))
    learnt = np.array(found.velocity_correction + found.momentum_correction)
    assert learnt[2] == 0.0, "the apex is left as it is"
    left = np.abs(ERROR + real @ learnt[LEARNT])
    assert left.max() < 0.1 * np.abs(ERROR).max()
    assert found.corrects and found.seeds == (1, 2, 3) and found.trial == "robust"
    assert "3 instead of 3 of 3 landings" in found.reason


def test_what_does_not_help_is_not_kept() -> None:
    answer = response(plan_of("in_situ_32cm"), BRUCE.total_mass)
    for measure in (plant(-answer), plant(answer, landing=1e-4)):
        found = learn_landing(measure, answer, UNIT)
        assert found.velocity_correction == found.momentum_correction == ZERO
        assert not found.corrects and found.after == found.before
        assert "no correction of 5 tried" in found.reason


def test_a_robot_that_never_lands_teaches_nothing() -> None:
    def measure(velocity: Vector, momentum: Vector) -> Sequence[Touchdown]:
        assert velocity == momentum == ZERO, "there is nothing to try"
        return [Touchdown(LiftOff(None, False), None, LOST)] * 3

    found = learn_landing(measure, np.eye(5), UNIT)
    assert not found.corrects and found.before.flown == 0


def test_no_correction_is_larger_than_the_largest() -> None:
    answer = 1e-3 * np.eye(5)
    found = learn_landing(plant(answer), answer, UNIT, tries=2)
    assert max(map(abs, found.velocity_correction)) == LARGEST
    assert max(map(abs, found.momentum_correction)) == UNIT * LARGEST


def test_a_momentum_tilts_a_robot_that_turns_about_other_axes() -> None:
    straight = response(plan_of("in_situ_32cm"), BRUCE.total_mass)
    turned = response(plan_of("turn_180deg"), BRUCE.total_mass)
    assert straight[2, 2] > 0.0 and straight[3, 3] > 0.0
    np.testing.assert_allclose([straight[2, 3], straight[3, 2]], 0.0, atol=1e-6)
    # Half way through half a turn the robot looks to the left: what rolls the world pitches it back.
    assert turned[3, 2] < -0.4 * straight[2, 2] and turned[2, 3] > 0.4 * straight[2, 2]
    assert abs(turned[2, 2]) < 0.2 * turned[2, 3]
    assert float(np.hypot(*turned[2, 2:4])) >= LEAST_SHARE * 0.5 * straight[2, 2]
    assert straight[0, 0] == pytest.approx(plan_of("in_situ_32cm").flight_time)


def test_angles_are_those_of_a_quaternion() -> None:
    roll, pitch, heading = 0.3, -0.2, 2.5
    half = 0.5 * np.array([roll, pitch, heading])
    (a, b, c), (p, q, r) = np.sin(half), np.cos(half)
    x, y = a * q * r - p * b * c, p * b * r + a * q * c
    z, w = p * q * c - a * b * r, p * q * r + a * b * c
    np.testing.assert_allclose(angles_of(np.array([[x, y, z, w]])), [[roll, pitch, heading]])


@pytest.mark.long
def test_a_real_jump_tells_how_it_landed() -> None:
    graph = load(GRAPHS / "jump.yaml", ["robot.seed=7001"])
    allowed = graph.checked.block("score").params
    result = graph.run()
    found = touchdown_of(result, allowed)
    assert found.lift_off.landed and found.error is not None
    assert np.abs(found.error[:2]).max() < 0.02 and np.abs(found.error[2:4]).max() < 0.26
    peak = np.radians(result.metrics["peak_tilt_deg"])
    assert float(np.hypot(*found.error[2:4])) <= peak + 1e-6
    assert 0.0 < found.used < 1.0
    missing = touchdown_of(_without_landing(result), allowed)
    assert missing.error is None and missing.used == LOST


def _without_landing(result: RunResult) -> RunResult:
    metrics = {k: v for k, v in result.metrics.items() if not k.startswith("jump_distance")}
    return replace(result, metrics=metrics)
