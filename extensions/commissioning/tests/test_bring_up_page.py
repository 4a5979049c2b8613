"""The bring-up page: every fault that the twin can have is in its table, and every row names a test."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path
from typing import get_args

from aloft.hal.twin.injected_faults import Kind

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "extensions" / "commissioning" / "bring_up.md").read_text()
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.split("| what goes wrong |")[1].split("\n\n")[0].splitlines()[2:]
]


def test_every_row_names_a_test_that_is_there() -> None:
    files: defaultdict[str, str] = defaultdict(str)
    for path in sorted(ROOT.glob("tests/**/test_*.py")):
        files[path.name] += path.read_text()  # a name may stand in several folders
    assert len(ROWS) >= 20
    for row in ROWS:
        assert len(row) == 5 and all(row), row
        named = re.findall(r"(test_\w+\.py)::(test_\w+)", row[4])
        assert named, row
        for file, name in named:
            assert f"def {name}(" in files[file], (file, name)


SLOW = {
    "a foot switch bounces", "a foot switch is stuck open", "a foot switch is stuck closed",
    "a foot switch was open from the first tick on",
    "the dead man's button or key is let go", "nothing: a run ends while the robot stands",
}  # fmt: skip
"""Rows that may take longer than ``SOON``: the page says why, or they are no faults."""
SOON = 30.0
"""Within which every other fault is damped [ms]."""
UNITS = {"exchange": 1.0, "exchanges": 1.0, "packets": 1.0, "of": 1.0, "ms": 1.0, "tick": 2.0}


def test_every_other_fault_is_damped_soon() -> None:
    """How long it takes is tested by the row's own test, mostly with the noise of the sensors."""
    assert {row[0] for row in ROWS} >= SLOW
    for row in ROWS:
        times = [
            float(number) * UNITS[unit]
            for number, unit in re.findall(r"(\d+) (exchanges?|packets|of|ms|tick)\b", row[3])
        ]
        if row[0] not in SLOW and row[3] not in ("-", "as in a run"):
            assert times and max(times) <= SOON, row


def test_every_fault_of_the_twin_is_in_the_table() -> None:
    cells = " ".join(row[4] for row in ROWS)
    spoken = {"stuck_encoder": "test_a_stuck_encoder"}
    for kind in get_args(Kind):
        assert spoken.get(kind, f"[{kind}") in cells, kind
