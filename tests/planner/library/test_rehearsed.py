"""What a rehearsal has learnt: kept beside its plan, and found for that plan and controller only."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.rehearsed import (
    FOLDER,
    ZERO,
    Deviation,
    RehearsalFileError,
    Rehearsed,
    controller_hash,
    find_rehearsed,
    keep_rehearsed,
)
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.runtime.graph import load
from aloft.runtime.language.errors import AloftError
from aloft.runtime.loading import flatten

JUMP = SHIPPED.parent / "jump.yaml"
TASK = read_task(SHIPPED.parent / "tasks" / "in_situ_12cm.yaml")
BEFORE = Deviation((0.03, 0.0, 0.0), (0.0, -0.01, 0.0), 0.035, 0.002, 2, 3, 3)
LEARNT = Rehearsed(
    (-0.03, 0.0, 0.0), (0.0, 0.01, 0.0), BEFORE, replace(BEFORE, size=0.004), (7001, 7002, 7003),
    "standard", "it helped",
)  # fmt: skip


@pytest.fixture
def library(tmp_path: Path) -> PlanLibrary:
    """A library with the plan of ``TASK``."""
    found = PlanLibrary(find_robot("bruce"), tmp_path)
    kept = found.path_of(TASK)
    assert kept is not None
    shutil.copy(kept, tmp_path)
    return found


def controller(*settings: str) -> str:
    return controller_hash(flatten(JUMP, settings).plain(), 500.0, "plan")


def corrections(library: PlanLibrary, *settings: str) -> list[tuple[float, ...]]:
    """The corrections in a graph that looks for its plan in the library."""
    graph = load(JUMP, [f"plan.library={library.folder}", *settings]).checked
    params = graph.block("targets").params.model_dump()
    return [tuple(params[f"{kind}_correction"]) for kind in ("velocity", "momentum")]


def test_what_was_kept_is_found(library: PlanLibrary) -> None:
    assert find_rehearsed(library, TASK, "a") is None
    path = keep_rehearsed(library, TASK, "a", LEARNT)
    assert path.parent == library.folder / FOLDER
    assert find_rehearsed(library, TASK, "a") == LEARNT


def test_another_controller_or_plan_has_nothing(library: PlanLibrary) -> None:
    path = keep_rehearsed(library, TASK, "a", LEARNT)
    assert find_rehearsed(library, TASK, "b") is None
    path.rename(path.with_name(path.name.replace(".a.", ".b.")))  # under a name that is not its own
    assert find_rehearsed(library, TASK, "b") is None
    keep_rehearsed(library, TASK, "a", LEARNT)
    plan = library.path_of(TASK)
    assert plan is not None
    plan.write_bytes(plan.read_bytes() + b"\0")  # the task was planned anew
    assert find_rehearsed(library, TASK, "a") is None


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 1', "no\0text"])
def test_a_damaged_file_is_named(library: PlanLibrary, text: str) -> None:
    path = keep_rehearsed(library, TASK, "a", LEARNT)
    path.write_text(text)
    with pytest.raises(
        RehearsalFileError, match=r"found a damaged file .* remove it, or"
    ) as caught:
        find_rehearsed(library, TASK, "a")
    assert str(path) in str(caught.value)


def test_values_that_are_not_finite_are_damage(library: PlanLibrary) -> None:
    keep_rehearsed(library, TASK, "a", replace(LEARNT, velocity_correction=(float("nan"), 0, 0)))
    with pytest.raises(RehearsalFileError, match="is not finite"):
        find_rehearsed(library, TASK, "a")


def test_without_a_plan_nothing_is_kept(library: PlanLibrary) -> None:
    other = TASK.model_copy(update={"rise": 0.0733})
    with pytest.raises(RehearsalFileError, match="there is no plan of"):
        keep_rehearsed(library, other, "a", LEARNT)


def test_task_seed_trial_and_score_are_no_part_of_the_controller() -> None:
    own = controller()
    for setting in (
        "plan.task.rise=9cm", "robot.seed=4", "robot.body.mass_spread=0.05", "robot.latency=5ms",
        "plan.rehearsed=false", "plan.library=there", "score.foot_slip=20mm", "push.force=3",
    ):  # fmt: skip
        assert controller(setting) == own, setting
    for setting in (
        "plan.by=clock", "wbc.thrust.linear_weight=[1, 1, 1]", "targets.place_gain=0.5",
        "estimator.use=blocks.InvariantKalmanFilter", "landing.law=paper", "delay.nominal=3ms",
    ):  # fmt: skip
        assert controller(setting) != own, setting


def test_the_graph_takes_it_into_use_unless_told_otherwise(library: PlanLibrary) -> None:
    here = f"plan.library={library.folder}"
    assert corrections(library) == [ZERO, ZERO]
    keep_rehearsed(library, TASK, controller(here), LEARNT)
    learnt = [LEARNT.velocity_correction, LEARNT.momentum_correction]
    assert corrections(library) == learnt
    assert corrections(library, "robot.seed=7", "robot.latency=3ms") == learnt
    assert corrections(library, "plan.rehearsed=false") == [ZERO, ZERO]
    assert corrections(library, "landing.law=paper") == [ZERO, ZERO]
    assert corrections(library, "plan.task.rise=9cm") == [ZERO, ZERO]


def test_a_value_of_the_users_own_wins(library: PlanLibrary) -> None:
    own = "targets.velocity_correction=[0.01, 0, 0]"
    keep_rehearsed(library, TASK, controller(own), LEARNT)
    assert corrections(library, own) == [(0.01, 0.0, 0.0), LEARNT.momentum_correction]


def test_a_graph_says_which_file_is_damaged(library: PlanLibrary) -> None:
    keep_rehearsed(library, TASK, controller(), LEARNT).write_text("{}")
    with pytest.raises(AloftError) as caught:
        corrections(library)
    text = str(caught.value)
    assert "targets.velocity_correction cannot follow from plan.velocity_correction" in text
    assert "found a damaged file" in text and "plan.rehearsed: false" in text
    assert corrections(library, "plan.rehearsed=false") == [ZERO, ZERO]
