"""The pages that a new user reads first keep the rules of ``lab/english.py``."""

from pathlib import Path

import pytest

from aloft.lab.english import PAGES, findings

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", PAGES)
def test_a_first_page_is_plain_english(name: str) -> None:
    assert list(findings((ROOT / name).read_text(encoding="utf-8"))) == []


def test_a_rule_finds_its_phrase_with_its_line_and_leaves_code_alone() -> None:
    (found,) = findings("One.\n\nA fault is noticed by nothing. `is noticed by nothing`\n")
    assert (found.line, found.text, found.instead) == (
        3,
        "is noticed by nothing",
        "goes undetected",
    )
