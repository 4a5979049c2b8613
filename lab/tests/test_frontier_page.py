"""The page of the frontier: its criteria come first, and its table is made by a script that works."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "frontier.md").read_text()
FOUND = {
    "name": "up", "what": "the rise", "unit": "cm", "reached": 23.0, "landed": 19, "runs": 20,
    "ci_low": 0.764, "ci_high": 0.991, "fails_at": 24.0, "fails_landed": [2, 5],
    "why": "fell", "gaps": [21.0], "planned": 26.0, "planned_ended": True, "theory": 31.0,
    "theory_ended": False, "binds": "knee motor speed",
}  # fmt: skip


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("result_tables")


def test_a_direction_is_a_row(script: ModuleType) -> None:
    nothing = {
        **FOUND, "name": "back", "reached": 0.0, "runs": 0, "gaps": [], "fails_at": 2.5,
        "fails_landed": None, "why": "no plan: motor speed", "planned": 0.0, "theory": 0.0,
        "theory_ended": True, "binds": "",
    }  # fmt: skip
    table = script.frontier_table({"seeds": [9000, 9019], "directions": [FOUND, nothing]})
    assert table.startswith("2 seeds a value, 9000 to 9019.\n")
    assert table.splitlines()[-2:] == [
        "| up: the rise | 23 cm (but not 21) | 19 of 20 | 76 % to 99 % | 24 cm (2 of 5): fell "
        + "| 26 cm | 31 cm or more | knee motor speed |",
        "| back: the rise | nothing | - | - | 2.5 cm: no plan: motor speed | 0 cm | 0 cm | - |",
    ]


def test_the_criteria_come_before_the_table() -> None:
    assert PAGE.index("## Criteria") < PAGE.index("<!-- frontier -->")


def test_the_page_says_what_the_search_does() -> None:
    from aloft.extensions.commissioning.reach.directions import LOOSEST
    from aloft.extensions.commissioning.reach.search import LEAST_RUNS, RATE
    from aloft.lab.benchmarks.frontier import MOST_CPU

    assert LOOSEST == {"effort": 1.0, "margins": None, "foot_clearance": 0.02}
    assert "`effort: 1`" in PAGE and "`margins: null`" in PAGE and "`foot_clearance: 2 cm`" in PAGE
    assert (RATE, LEAST_RUNS) == (0.95, 4) and f"after {MOST_CPU:g} s of processor time" in PAGE


def test_other_robots_are_drawn_beside_what_the_table_says() -> None:
    from aloft.extensions.commissioning.reach.directions import leg_length
    from aloft.extensions.commissioning.reach.reach import bruce_reach, in_legs
    from aloft.robots.description import find_robot

    legs = leg_length(find_robot("bruce"))
    rows = {row.partition(":")[0].removeprefix("| "): row.split(" | ")
            for row in PAGE.splitlines() if row.startswith("| ")}  # fmt: skip
    found = bruce_reach()["directions"]
    assert len(found) == 7
    for each in found:
        cells = [rows[each["name"]][k].split()[:2] for k in (1, 5, 6)]
        ends = dict(
            zip(("reached", "planned", "theory"), (float(c[0]) for c in cells), strict=True)
        )
        assert each["in_legs"] == in_legs({**ends, "unit": cells[0][1]}, legs)
