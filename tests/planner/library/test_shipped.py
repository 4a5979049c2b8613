"""Tasks are found beside the graph first, then among the shipped ones."""

from __future__ import annotations

import pytest

from aloft.planner.library.shipped import find_task, shipped_graphs
from aloft.planner.task.task import TaskError


def test_the_shipped_folder_has_tasks_and_plans():
    assert (shipped_graphs() / "tasks" / "in_situ.yaml").is_file()
    assert list((shipped_graphs() / "plans").glob("*.npz"))


def test_the_folders_given_come_first(tmp_path):
    assert find_task("tasks/in_situ.yaml", tmp_path).parent == shipped_graphs() / "tasks"
    (tmp_path / "tasks").mkdir()
    own = tmp_path / "tasks" / "in_situ.yaml"
    own.write_text("rise: 5 cm\n")
    assert find_task("tasks/in_situ.yaml", tmp_path) == own


def test_a_task_that_is_nowhere_is_refused_with_those_that_are(tmp_path):
    with pytest.raises(TaskError, match=r"no task 'mine.yaml' .*tasks/forward_10cm.yaml, tasks/"):
        find_task("mine.yaml", tmp_path)
