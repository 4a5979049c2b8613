"""Counts of runs in the prose of pages are those of data files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("claims")


def test_every_count_of_runs_on_the_pages_has_its_data(script: ModuleType) -> None:
    assert list(script.wrong(ROOT)) == []


@pytest.fixture
def pages(tmp_path: Path, script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(script, "PAGES", ("page.md",))
    (tmp_path / "docs" / "data").mkdir(parents=True)
    rows = [
        {"task": "up", "arm": "one", "n": 10, "successes": 7, "stands": 9},
        {"task": "down", "arm": "one", "n": 10, "successes": 8, "stands": 10},
    ]
    (tmp_path / "docs" / "data" / "jumps.json").write_text(json.dumps({"rows": rows}))
    return tmp_path


def wrong(script: ModuleType, root: Path, text: str, claims: str) -> list[str]:
    (root / "page.md").write_text(text)
    (root / script.CLAIMS).write_text("page.md:\n" + claims)
    return list(script.wrong(root))


def test_a_claim_is_the_sum_of_its_rows(script: ModuleType, pages: Path) -> None:
    claim = "  - {says: 'lands 15 of 20', data: jumps, where: {arm: one}}\n"
    assert wrong(script, pages, "It lands 15 of 20.\n", claim) == []
    stands = "  - {says: 'stands 9 of 10', data: jumps, where: {task: up}, count: stands}\n"
    assert wrong(script, pages, "It stands 9 of 10.\n", stands) == []
    other = "  - {says: 'lands 16 of 20', data: jumps, where: {arm: one}}\n"
    assert wrong(script, pages, "It lands 16 of 20.\n", other) == [
        "page.md: 'lands 16 of 20': jumps has 15 of 20"
    ]
    nowhere = "  - {says: 'lands 15 of 20', data: jumps, where: {arm: two}}\n"
    assert wrong(script, pages, "It lands 15 of 20.\n", nowhere) == [
        "page.md: 'lands 15 of 20': no row of jumps has {'arm': 'two'}"
    ]


def test_a_count_without_a_claim_and_a_claim_without_its_text_are_named(
    script: ModuleType, pages: Path
) -> None:
    text = "\nIt lands 15 of 20.\n\n<!-- data: x -->\n| 3 of 4 |\n<!-- end of data: x -->\n"
    assert wrong(script, pages, text, "  []\n") == [
        "page.md, line 2: 15 of 20: no claim in docs/data/claims.yaml covers it"
    ]
    gone = "  - {says: 'lands 7 of 10', data: jumps, where: {task: up}}\n"
    assert wrong(script, pages, "Nothing.\n", gone) == [
        "page.md: 'lands 7 of 10' is not in its prose, or twice"
    ]


def test_goals_that_are_met_are_counted_in_the_table(script: ModuleType, pages: Path) -> None:
    rows = "| a | 40 of 40 | 98 %, met |\n| b | 39 of 40 | 98 %, missed |\n| c | 9 of 9 | 95 %, met |\n"
    (pages / "results.md").write_text(f"<!-- tasks -->\n{rows}<!-- end of tasks -->\n")
    claim = "  - {says: '2 of 3 kinds', goals: 'results.md#tasks'}\n"
    assert wrong(script, pages, "2 of 3 kinds meet their goal.\n", claim) == []
    more = "  - {says: '3 of 3 kinds', goals: 'results.md#tasks'}\n"
    assert wrong(script, pages, "3 of 3 kinds meet their goal.\n", more) == [
        "page.md: '3 of 3 kinds': results.md has 2 of 3"
    ]


def test_a_claim_names_where_its_count_comes_from(script: ModuleType, pages: Path) -> None:
    claim = "  - says: lands 3 of 9\n"
    assert wrong(script, pages, "It lands 3 of 9.\n", claim) == [
        "page.md: 'lands 3 of 9' names neither data nor goals"
    ]
