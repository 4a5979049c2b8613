"""The table of how far the methods for the whole-body program agree."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from aloft.lab.benchmarks.rows import Row

PAGE = Path(__file__).parents[2] / "docs" / "whole_body.md"


def test_the_table(docs_script: Callable[[str], ModuleType]) -> None:
    rows = [
        Row("recorded", 9.0, "", note="2 with a torque at its limit"),
        Row("recorded: own, round cones, largest error", 2.5e-11, "N m", note="9 programs"),
        Row("recorded: own, round cones, not solved", 0.0, ""),
    ]
    script = docs_script("result_tables")
    text = script.agreement_table({"rows": [row.to_json() for row in rows]})
    assert "| recorded |  |  |  | 9 programs, 2 with a torque at its limit |" in text
    assert "| recorded | own, round cones | 2.5e-11 | 0 | 9 programs |" in text
    assert "<!-- end of agreement -->" in PAGE.read_text()
