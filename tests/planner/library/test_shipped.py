"""Tasks are found beside the graph first, then among the shipped ones."""

from __future__ import annotations

import pytest

from aloft.planner.library.shipped import find_task, shipped_folder, shipped_tasks


def test_the_shipped_folder_has_tasks_and_plans():
    assert (shipped_folder() / "tasks" / "in_situ.yaml").is_file()
    assert "tasks/in_situ.yaml" in shipped_tasks()
    assert list((shipped_folder() / "plans").glob("*.npz"))


def test_the_folders_given_come_first(tmp_path):
    assert find_task("tasks/in_situ.yaml", tmp_path).parent == shipped_folder() / "tasks"
    (tmp_path / "tasks").mkdir()
    own = tmp_path / "tasks" / "in_situ.yaml"
    own.write_text("rise: 5 cm\n")
    assert find_task("tasks/in_situ.yaml", tmp_path) == own


def test_a_task_that_is_nowhere_is_refused(tmp_path):
    with pytest.raises(LookupError, match=r"no task 'mine.yaml' beside the graph or among the sh"):
        find_task("mine.yaml", tmp_path)
