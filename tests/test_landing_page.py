"""The tables of the landing study's page, from made-up summaries."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SPEC = importlib.util.spec_from_file_location("refresh", ROOT / "docs" / "refresh_landing.py")
assert SPEC is not None and SPEC.loader is not None
refresh = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(refresh)


def row(arm, direction, impulse, successes):
    return {"arm": arm, "direction_deg": direction, "impulse_n_s": impulse,
            "successes": successes, "n": 10}  # fmt: skip


ROWS = [
    row("predicted", 0.0, 0.7, 9), row("predicted", 45.0, 0.7, 4), row("predicted", 0.0, 1.1, 2),
    row("capture point", 0.0, 0.7, 5), row("capture point", 45.0, 0.7, 6),
    row("capture point", 0.0, 1.1, 2),
]  # fmt: skip


def test_rates_over_all_directions():
    lines = refresh.impulse_table(ROWS).splitlines()
    assert lines[0] == "| arm | 0.7 N s, 0.077 sqrt(g h) | 1.1 N s, 0.121 sqrt(g h) |"
    assert lines[2] == "| predicted | 13 of 20 (65 %) | 2 of 10 (20 %) |"


def test_a_direction_between_two_quarters_counts_half_in_each():
    lines = refresh.quarter_table(ROWS).splitlines()
    assert lines[0] == "| arm | ahead | left | back | right |"
    assert lines[2] == "| predicted | 52 % | 40 % | - | - |"


def test_where_another_arm_is_better_the_page_says_so():
    lines = refresh.direction_table(ROWS).splitlines()
    assert lines[2] == "| 0 deg | 9 of 10 | 2 of 10 |"
    assert lines[3] == "| 45 deg | 4 of 10 (best other arm 6) | 0 of 0 |"


def test_every_table_has_its_place_on_the_page():
    page = (ROOT / "docs" / "landing.md").read_text()
    for name in ("impulses", "quarters", "directions"):
        for mark in (name, f"{name} 12 cm"):
            assert "| new |" in refresh.replaced(page, mark, "| new |\n")
    with pytest.raises(SystemExit, match="has no <!-- nowhere -->"):
        refresh.replaced(page, "nowhere", "")
