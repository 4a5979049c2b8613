"""A plan is checked and made a table once for the same content, and anew for another.

That a plan has passed its check is remembered between processes, and nothing else is.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aloft.mathematics.kept_arrays import code_digest
from aloft.planner.checking import validity
from aloft.planner.library import validation_cache
from aloft.planner.library.library import PlanLibrary, shipped_folder
from aloft.planner.library.reference_table import reference_table
from aloft.planner.library.validation_cache import NOTES, check_unless_noted
from aloft.planner.task.plan import InvalidPlanError
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


@pytest.fixture(scope="module")
def plan():
    found = PlanLibrary(ROBOT).find(read_task(shipped_folder() / "tasks" / "in_situ_12cm.yaml"))
    assert found is not None
    return found


def test_the_same_plan_is_checked_once_and_a_changed_one_again(plan, monkeypatch):
    checked = []
    monkeypatch.setattr(validation_cache, "_valid", validation_cache.ResultCache())
    monkeypatch.setattr(validity, "require_valid", lambda plan, robot: checked.append(plan))
    validation_cache.require_valid_cached(plan, ROBOT)
    validation_cache.require_valid_cached(replace(plan, com=plan.com.copy()), ROBOT)
    assert len(checked) == 1
    validation_cache.require_valid_cached(replace(plan, com=plan.com + 1e-12), ROBOT)
    validation_cache.require_valid_cached(
        plan, ROBOT.with_profile("koala").model_copy(update={"name": "x"})
    )
    assert len(checked) == 3


def test_a_plan_that_is_not_valid_is_refused_every_time(plan):
    wrong = replace(plan, contact_force=2.0 * plan.contact_force)
    for _ in range(2):
        with pytest.raises(InvalidPlanError):
            validation_cache.require_valid_cached(wrong, ROBOT)


def test_tables_are_shared_by_what_they_are_made_from(plan):
    first = validation_cache.cached_reference_table(plan, ROBOT, 0.2)
    assert validation_cache.cached_reference_table(plan, ROBOT, 0.2) is first
    later = validation_cache.cached_reference_table(plan, ROBOT, 0.3)
    assert later is not first
    np.testing.assert_allclose(later.time[2:] - first.time[2:], 0.1)


def test_only_the_results_used_last_are_kept():
    kept = validation_cache.ResultCache[int]()
    for key in range(validation_cache.KEPT + 1):
        kept.get(key, lambda key=key: key)
    assert kept.get(0, lambda: -1) == -1
    assert kept.get(validation_cache.KEPT, lambda: -1) == validation_cache.KEPT


@pytest.mark.long
@pytest.mark.parametrize("task", ["in_situ_12cm", "hops_forward_10"])
def test_a_later_process_finds_the_very_table(task, monkeypatch):
    plan = PlanLibrary(ROBOT).find(read_task(shipped_folder() / "tasks" / f"{task}.yaml"))
    made = reference_table(plan, ROBOT, 0.2)
    monkeypatch.setattr(validation_cache, "_tables", validation_cache.ResultCache())
    validation_cache.cached_reference_table(plan, ROBOT, 0.2)
    monkeypatch.setattr(validation_cache, "_tables", validation_cache.ResultCache())
    making = "aloft.planner.library.reference_table.reference_table"
    monkeypatch.setattr(making, None)  # not needed any more
    found = validation_cache.cached_reference_table(plan, ROBOT, 0.2)
    assert {**vars(found), "time": 0, "columns": 0, "contact": 0} == {
        **vars(made), "time": 0, "columns": 0, "contact": 0,
    }  # fmt: skip
    assert found.time.tobytes() == made.time.tobytes()
    assert list(found.columns) == list(made.columns)
    for name, values in made.columns.items():
        assert found.columns[name].shape == values.shape
        assert found.columns[name].tobytes() == values.tobytes()
    assert bool(made.later_jumps) == (task == "hops_forward_10")
    assert (found.contact is None) == (made.contact is None)
    assert made.contact is None or np.array_equal(found.contact, made.contact)


@pytest.fixture(autouse=True)
def _checked_before_own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


class Check:
    """A check that counts its calls, and fails where it is told to."""

    def __init__(self, fails: bool = False) -> None:
        self.calls, self.fails = 0, fails

    def __call__(self) -> None:
        self.calls += 1
        if self.fails:
            raise ValueError("not valid")


def test_what_has_passed_is_not_checked_again_and_other_content_is() -> None:
    check = Check()
    for content in (b"one", b"one", b"other", b"one"):
        check_unless_noted(content, check)
    assert check.calls == 2
    assert NOTES.folder is not None and len(list(NOTES.folder.iterdir())) == 2


def test_what_has_failed_is_checked_every_time() -> None:
    check = Check(fails=True)
    for _ in range(2):
        with pytest.raises(ValueError, match="not valid"):
            check_unless_noted(b"one", check)
    assert check.calls == 2


def test_another_check_does_not_believe_what_this_one_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    check = Check()
    check_unless_noted(b"one", check)
    monkeypatch.setattr(validation_cache, "_code", lambda: b"a changed test")
    check_unless_noted(b"one", check)
    assert check.calls == 2


def test_the_code_of_the_check_is_part_of_it() -> None:
    root = Path(validation_cache.__file__).parents[2]
    for folder in validation_cache.FOLDERS:
        assert list((root / folder).rglob("*.py")), folder
    assert validation_cache._code() == code_digest(*validation_cache.FOLDERS)


def test_without_a_place_for_notes_it_is_checked_every_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    check = Check()
    check_unless_noted(b"one", check)
    check_unless_noted(b"one", check)
    assert check.calls == 2
