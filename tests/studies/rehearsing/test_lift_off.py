"""A rehearsal: what is learnt from a plant with a known deviation, and once from a real jump."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.rehearsed import ZERO, Vector, controller_hash, keep_rehearsed
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.runtime.graph import load
from aloft.runtime.language.errors import AloftError
from aloft.runtime.loading import flatten
from aloft.studies.rehearsing.lift_off import (
    LARGEST,
    NEGLIGIBLE,
    LiftOff,
    Measure,
    corrected_parameters,
    learn,
    missed_at_lift_off,
    rehearse,
)

GRAPHS = SHIPPED.parent
JUMP = GRAPHS / "jump.yaml"
UNIT = 0.6
MISSED = np.array([0.04, -0.02, 0.01, 0.0, -0.015, 0.005])
SPREAD = np.array([-1.0, 0.0, 1.0])[:, None] * 1e-3


def plant(missed: Any = MISSED, response: float = 0.7, landing: float = 1.0) -> Measure:
    """A robot that misses its plan by ``missed`` + ``response`` times the correction. It lands as long as
    no correction is larger than ``landing``."""

    def measure(velocity: Vector, momentum: Vector) -> Sequence[LiftOff]:
        correction = np.array(velocity + momentum)
        lands = bool(np.abs(correction).max() <= landing)
        return [LiftOff(missed + response * correction + each, lands) for each in SPREAD]

    return measure


def test_the_correction_of_a_known_deviation_is_learnt() -> None:
    found = learn(plant(), UNIT, tries=4, seeds=(1, 2, 3))
    learnt = np.array(found.velocity_correction + found.momentum_correction)
    np.testing.assert_allclose(learnt, -MISSED / 0.7, atol=NEGLIGIBLE / 0.7)
    assert found.after.size < 0.15 * found.before.size
    assert found.before.velocity == pytest.approx(tuple(MISSED[:3]))
    assert found.before.size == pytest.approx(float(np.hypot(
        np.linalg.norm(MISSED[:3]), np.linalg.norm(MISSED[3:]) / UNIT)))  # fmt: skip
    assert found.seeds == (1, 2, 3) and found.corrects and "of the deviation" in found.reason


def test_a_gain_that_is_too_high_is_halved() -> None:
    found = learn(plant(response=2.4), UNIT, tries=3)
    assert 0.0 < found.after.size < 0.2 * found.before.size


@pytest.mark.parametrize(
    ("measure", "reason"),
    [
        (plant(missed=0.05 * MISSED), "nothing to correct"),
        (plant(response=0.0), "made the deviation smaller by a quarter"),
        (plant(response=-0.7), "made the deviation smaller by a quarter"),
        (plant(landing=0.01), "made the deviation smaller by a quarter"),
        (lambda velocity, momentum: [LiftOff(None, False)] * 3, "no run left the ground"),
    ],
)
def test_a_correction_that_does_not_help_is_not_kept(measure: Measure, reason: str) -> None:
    found = learn(measure, UNIT)
    assert found.velocity_correction == found.momentum_correction == ZERO
    assert not found.corrects and reason in found.reason
    assert found.after == found.before


def test_a_correction_is_limited() -> None:
    found = learn(plant(missed=np.array([1.0, 0, 0, 0, 1.0, 0]), response=0.9), UNIT, tries=5)
    for learnt, unit in ((found.velocity_correction, 1.0), (found.momentum_correction, UNIT)):
        assert max(np.abs(learnt)) <= LARGEST * unit


def run_of(speed: float, late: int) -> Any:
    """A throw of 1.5 m/s planned for 0.2 s; the robot leaves ``late`` ticks later at ``speed``."""
    time = np.arange(300) * 0.002
    signals = {"plan.reference.time": time, "plan.reference.lift_off_time": np.full(300, 0.2)}
    for name, begin, up in (("plan.reference", 100, 1.5), ("robot.truth", 100 + late, speed)):
        fall = np.maximum(time - time[begin], 0.0)
        velocity = np.zeros((300, 3))
        velocity[:, 0], velocity[:, 2] = 0.3 * up, np.where(fall > 0, up - 9.81 * fall, 0.0)
        velocity[begin, 2] = up
        com = np.zeros((300, 3))
        com[:, 2] = 0.4 + up * fall - 0.5 * 9.81 * fall**2
        momentum = np.tile([0.0, 0.01 * up, 0.0], (300, 1))
        signals |= {f"{name}.com": com, f"{name}.com_velocity": velocity}
        signals[f"{name}.angular_momentum"] = momentum
    touched = np.zeros((300, 4), bool)
    touched[: 100 + late] = True
    signals["robot.truth.contact_touched"] = touched
    return SimpleNamespace(signal=signals.__getitem__)


@pytest.mark.parametrize("late", [-3, 0, 4])
def test_the_deviation_of_a_run_is_that_of_its_lift_off(late: int) -> None:
    missed = missed_at_lift_off(run_of(1.4, late))
    assert missed is not None
    np.testing.assert_allclose(missed, [-0.03, 0, -0.1, 0, -0.001, 0], atol=1e-3)


def test_a_run_that_stays_on_the_ground_has_no_deviation() -> None:
    assert missed_at_lift_off(run_of(1.4, 199)) is None


def test_the_parameters_that_follow_the_plan_are_found() -> None:
    found = corrected_parameters(flatten(JUMP))
    assert found == {
        "velocity_correction": "targets.velocity_correction",
        "momentum_correction": "targets.momentum_correction",
    }
    with pytest.raises(AloftError, match=r"include controllers/planned.yaml, and set targets"):
        corrected_parameters(flatten(GRAPHS / "somersault_forward_35cm.yaml"))


@pytest.mark.long
def test_a_real_jump_is_rehearsed_and_its_correction_taken_into_use(tmp_path: Path) -> None:
    task = read_task(GRAPHS / "tasks" / "in_situ_12cm.yaml")
    library = PlanLibrary(find_robot("bruce"), tmp_path)
    settings = [f"plan.library={tmp_path}", "wbc.thrust.linear_weight=[100, 60, 30]"]
    kept = library.path_of(task)
    assert kept is not None
    shutil.copy(kept, tmp_path)
    flat = flatten(JUMP, settings)
    tried: list[str] = []
    found = rehearse(
        JUMP, settings, corrected_parameters(flat), UNIT, tries=1, seeds=(7001, 7002),
        on_try=tried.append,
    )  # fmt: skip
    assert found.before.flown == 2
    assert found.after.size <= found.before.size
    assert len(tried) == 2 or found.before.size < max(0.005, found.before.scatter)
    graph = load(JUMP, settings).checked
    keep_rehearsed(library, task, controller_hash(flat.plain(), graph.base_rate, "plan"), found)
    taken = load(JUMP, settings).checked.block("targets").params.model_dump()
    assert tuple(taken["velocity_correction"]) == found.velocity_correction
    assert tuple(taken["momentum_correction"]) == found.momentum_correction
