"""The tables of the landing study's page, from made-up summaries."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("result_tables")


def row(arm, direction, impulse, successes):
    return {"arm": arm, "direction_deg": direction, "impulse_n_s": impulse,
            "successes": successes, "n": 10}  # fmt: skip


ROWS = [
    row("predicted", 0.0, 0.7, 9), row("predicted", 45.0, 0.7, 4), row("predicted", 0.0, 1.1, 2),
    row("capture point", 0.0, 0.7, 5), row("capture point", 45.0, 0.7, 6),
    row("capture point", 0.0, 1.1, 2),
]  # fmt: skip


def test_a_direction_between_two_quarters_counts_half_in_each(script: ModuleType) -> None:
    lines = script.quarter_table(ROWS).splitlines()
    assert lines[0] == "| arm | ahead | left | back | right |"
    assert lines[2] == "| predicted | 52 % | 40 % | - | - |"
