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


def test_a_task_has_its_interval_and_its_goal(tasks: ModuleType) -> None:
    whole = tasks.tasks_table({"rows": [row("a", 38), row("b", 37)]})
    assert "| b | 37 of 40 | 80 % to 97 % | 95 %, missed |\n" in whole
    assert "| a | 38 of 40 | 80 % to 97 % | 95 %, met |\n" in whole


def test_readme_counts_the_tasks_of_the_page_of_results() -> None:
    rows = ROW.findall(RESULTS)
    met = sum("missed" not in line for line in rows)
    assert f"{met} of {len(rows)} kinds of jumps and pushes" in README


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
