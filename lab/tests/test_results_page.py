"""The tables of results, and what the README shows of them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from aloft.studies.batch.seeds import SeedRow

ROOT = Path(__file__).parents[2]
RESULTS = (ROOT / "docs" / "results.md").read_text()
README = (ROOT / "README.md").read_text()
ROW = re.compile(r"^\| .* \| \d+ of \d+ \| .* \|$", re.MULTILINE)


@pytest.fixture
def tasks(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("result_tables")


def row(task: str, successes: int) -> dict[str, Any]:
    return {"task": task, "successes": successes, "n": 40, "ci_low": 0.8, "ci_high": 0.97,
            "goal": 0.95, "met": successes >= 38}  # fmt: skip


def test_readme_has_its_tasks_and_all_that_miss_their_goal(tasks: ModuleType) -> None:
    summary = {
        "rows": [*(row(name, 40) for name in tasks.README_TASKS), row("a", 38), row("b", 37)]
    }
    whole, short = tasks.tasks_table(summary), tasks.short_tasks_table(summary)
    missed = "| b | 37 of 40 | 80 % to 97 % | 95 %, missed |\n"
    met = "| a | 38 of 40 | 80 % to 97 % | 95 %, met |\n"
    assert missed in whole and met in whole
    assert missed in short and met not in short
    assert short.startswith(
        f"{len(tasks.README_TASKS) + 1} of {len(tasks.README_TASKS) + 2} tasks and push"
    )
    assert all(f"| {name} | 40 of 40 |" in short for name in tasks.README_TASKS)


def test_a_task_of_readme_that_a_summary_lacks_is_named(tasks: ModuleType) -> None:
    with pytest.raises(
        ValueError, match=f"no task '{tasks.README_TASKS[0]}', which the README shows"
    ):
        tasks.short_tasks_table({"rows": [row("a", 40)]})


def test_readme_shows_rows_of_the_page_of_results(tasks: ModuleType) -> None:
    all_rows, shown = ROW.findall(RESULTS), ROW.findall(README)
    assert set(shown) <= set(all_rows)
    assert {line for line in all_rows if "missed" in line} <= set(shown)
    for name in tasks.README_TASKS:
        assert any(line.startswith(f"| {name} |") for line in shown)
    met = sum("missed" not in line for line in all_rows)
    assert f"{met} of {len(all_rows)} tasks and pushes met their goal" in README


def test_the_jump_on_the_spot(docs_script: Callable[[str], ModuleType]) -> None:
    script = docs_script("result_tables")
    metrics = {name: 0.1 for name, *_ in script.FIGURES}
    rows = [
        SeedRow(seed, seed != 2, "", {**metrics, "apex_above_standing_m": 0.1 + 0.01 * seed}, "")
        for seed in range(3)
    ]
    begin = "Jump on the spot, seeds 6000 to 6019: **2 of 3 succeed**"
    table = script.results_table(rows)
    assert table.startswith(f"{begin}.\n\n|  | least |")
    assert "| apex above standing | 10 | 11 | 12 | cm | 10.8 to 13.2 |" in table
    assert script.results_sentence(rows) == (
        f"{begin}, with an apex above standing of 11 cm in the median (goal 10.8 to 13.2).\n"
    )
