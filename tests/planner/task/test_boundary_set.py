"""What a formulation has nothing for is refused, and not ignored."""

from __future__ import annotations

import pytest

from aloft.planner.task.boundary_set import UNSUPPORTED, in_formulation, unsupported_keys
from aloft.planner.task.read_task import contradictions
from aloft.planner.task.task import JumpTask, make_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
VALUES = {
    "impact": True, "effort": 0.9, "foot_clearance": 0.03, "leg_clearance": 0.02, "gap": 0.1, "step_edge": 0.1,
    "slope": [0.1, 0.0], "landing_slope": [0.1, 0.0], "rough": {"seed": 1}, "stairs": {"rise": 0.05, "depth": 0.1},
    "jumps": [{"rise": 0.1}], "repeat": 2, "take_off": {"fore": 0.05}, "touchdown": {"hind": 0.05},
    "contact_time": 0.3, "weights.acceleration": 0.1, "weights.impulse": 0.1, "margins.step": 0.01,
    "margins.pressure": 0.1, "margins.load": 0.1, "margins.lift_off_speed": 1.0, "margins.touchdown_speed": 1.0,
    "margins.touchdown_slide": 1.0, "margins.landing_effort": 0.5, "margins.squat_lean": 0.8,
    "margins.landing_lean": 0.2, "margins.joints": 0.1, "margins.landing_limits": {"knee": [-2.0, -0.3]},
    "touchdown_lean": 0.2, "lift_off_momentum": 0.1, "touchdown_momentum": 0.1, "bounds": {"force": 60.0},
    "weights.posture": 2.0, "weights.joint_velocity": 2.0,
}  # fmt: skip


def task(formulation: str, key: str = "", value: object = None) -> JumpTask:
    values: dict[str, object] = {
        "name": "odd", "recipe": "paper", "rise": 0.1, "formulation": formulation,
    }  # fmt: skip
    group, _, name = key.rpartition(".")
    if key:
        values |= {group: {name: value}} if group else {key: value}
    return make_task(values)


REFUSED = [
    (formulation, key)
    for formulation, keys in UNSUPPORTED.items()
    for key in keys
    if key not in ("phases", "stairs", "rough")  # these exclude other keys by themselves
]


@pytest.mark.parametrize(("formulation", "key"), REFUSED)
def test_a_key_that_a_formulation_has_nothing_for_is_refused_by_name(
    formulation: str, key: str
) -> None:
    odd = task(formulation, key, VALUES[key])
    assert list(unsupported_keys(odd)) == [key]
    told = dict(contradictions(odd, ROBOT))
    other = "paper" if formulation == "full" else "full"
    assert told[key] == (
        f"formulation {formulation} has nothing for it; leave it out, or use formulation: {other}"
    )


@pytest.mark.parametrize("formulation", ["full", "paper", "srbm"])
def test_what_has_its_default_is_not_refused(formulation: str) -> None:
    assert not list(unsupported_keys(task(formulation, "impact", False)))


@pytest.mark.parametrize("key", [key for key in VALUES if key not in UNSUPPORTED["paper"]])
def test_the_papers_formulation_takes_what_bounds_its_set(key: str) -> None:
    assert not list(unsupported_keys(task("paper", key, VALUES[key])))


def test_a_task_in_another_formulation_is_without_what_that_has_nothing_for() -> None:
    given = task("full", "margins.pressure", 0.1)
    given = given.model_copy(update={"impact": True, "touchdown_lean": 0.2})
    found, left_out = in_formulation(given, "paper")
    assert left_out == ["impact", "margins.pressure"]
    assert (found.formulation, found.impact, found.touchdown_lean) == ("paper", False, 0.2)
    assert found.margins is not None
    assert found.margins.pressure == 0.0
    assert not list(unsupported_keys(found))
    assert in_formulation(given, "full") == (given, [])
