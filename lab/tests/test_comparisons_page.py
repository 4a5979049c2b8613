"""The page of comparisons: its tables are made of studies' summaries, by a script that works."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from aloft.studies.reading import read_study

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "comparisons.md").read_text()


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("result_tables")


def row(arm: str, **metrics: float) -> dict[str, object]:
    return {
        "task": "default", "jump": "up", "arm": arm, "n": 4, "successes": 1, "ci_low": 0.05,
        "ci_high": 0.7, "reasons": {"fell at 1.1 s": 1, "fell at 1.2 s": 1, "feet slid": 1},
        "metrics": {
            name: {"n": 3, "median": value, "low": value - 0.01, "high": value + 0.01}
            for name, value in metrics.items()
        },
    }  # fmt: skip


def test_a_table_has_a_row_a_cell(script: ModuleType) -> None:
    apex = {"apex_above_standing_m": 0.13, "planned_apex_above_standing_m": 0.12}
    rows = [row("one", **apex, peak_tilt_deg=2.0), row("other")]
    table = script.comparison_table({"study": "formulations", "rows": rows})
    head, _, first, second = table.splitlines()
    assert head.startswith("| arm | succeeded | 95 % interval | fell |"), "jump is always the same"
    assert first == (
        "| one | 1 of 4 | 5 % to 70 % | 2 | - | 2 (1.99 to 2.01, 3 runs) | 1 (0 to 2, 3 runs) |"
    )
    assert second == "| other | 1 of 4 | 5 % to 70 % | 2 | - | - | - |"


@pytest.mark.parametrize("name", ["formulations", "estimator"])
def test_the_page_has_every_arm_of_every_study(script: ModuleType, name: str) -> None:
    assert name in script.COLUMNS
    study = read_study(ROOT / "graphs" / "studies" / f"{name}.yaml")
    table = PAGE.partition(f"<!-- study: {name} -->")[2].partition(f"<!-- end of {name} -->")[0]
    for arm in study.arms:
        assert f"| {arm.name} |" in table, (
            f"run: aloft study {study.path.name}; lab/pages/refresh.py"
        )
    assert f"{study.seeds[0]} to {study.seeds[-1]}" in PAGE
