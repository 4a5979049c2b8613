"""The bring-up page: every fault that the twin can have is in its table, and every row names a test."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path
from typing import get_args

from aloft.hal.twin.faults import Kind

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "bring_up.md").read_text()
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


def test_every_fault_of_the_twin_is_in_the_table() -> None:
    cells = " ".join(row[4] for row in ROWS)
    spoken = {"stuck_encoder": "test_a_stuck_encoder"}
    for kind in get_args(Kind):
        assert spoken.get(kind, f"[{kind}") in cells, kind
