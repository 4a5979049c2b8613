"""The page on Python: its code runs from top to bottom, and does what it says."""

import re
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "python.md"


def test_the_code_of_the_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("gymnasium")
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(compile(code, str(PAGE), "exec"), names)  # noqa: S102
    assert "<RunResult: success: ran to its end; 100 ticks" in capsys.readouterr().out
    assert names["speeds"].shape == (100, 1)
    assert names["faster"] > names["before"]
    assert len(names["built"].checked.blocks) == 5  # with the one that selects
    assert names["reward"] < 0 and not names["terminated"]
