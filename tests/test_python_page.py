"""The page on Python: its code runs from top to bottom, and does what it says."""

import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import aloft
from aloft import blocks, hal
from aloft.runtime.testing.conformance import check_block

PAGE = Path(__file__).parents[1] / "docs" / "python.md"


def test_the_code_of_the_page_runs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("gymnasium")
    page = ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", page)
    names: dict[str, Any] = vars(page)
    found = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    for number, code in enumerate(found):
        file = tmp_path / f"page_{number}.py"  # a kernel is translated from its source
        file.write_text(code, encoding="utf-8")
        exec(compile(code, str(file), "exec"), names)  # noqa: S102
    assert "<RunResult: success: ran to its end; 100 ticks" in capsys.readouterr().out
    assert names["speeds"].shape == (100, 1)
    assert names["faster"] > names["before"]
    assert len(names["built"].checked.blocks) == 5  # with the one that selects
    assert (names["torque"].tolist(), names["stiffness"]) == ([20.0], 40.0)
    assert names["first"] == 1.5
    assert names["LandingHeuristic"].__module__ == "aloft.blocks.jumping.landing_heuristic"
    assert names["upright"] == [0.0, -1.0, 0.0]
    check_block(names["Attitude"])
    assert (names["feet"], len(names["joints"])) == (["right_foot", "left_foot"], 10)
    assert names["points"] == ("right_toe", "right_heel", "left_toe", "left_heel")
    assert names["reward"] < 0 and not names["terminated"]


def test_names_of_feet_select_the_rows_that_the_page_says() -> None:
    text = """
include: [aloft:jump]
blocks:
  by_name: {use: blocks.Gain, in: {u: "landing.feet.position[left_foot]"}}
  by_number: {use: blocks.Gain, in: {u: "landing.feet.position[1]"}}
"""
    with aloft.load(text).open() as run:
        run.step(2)
        left = run["landing.feet.position"][1]
        assert run["by_name.y.value"].tolist() == run["by_number.y.value"].tolist() == left.tolist()
        assert left[1] > 0.0  # to the left


def test_what_is_no_shipped_block_has_the_nearest() -> None:
    with pytest.raises(AttributeError, match=r"the nearest block is blocks\.LandingHeuristic"):
        blocks.LandingHeuristics  # noqa: B018
    with pytest.raises(AttributeError, match="has no attribute 'heuristic'"):
        blocks.heuristic  # noqa: B018
    assert hal.MujocoRobot.__name__ == "MujocoRobot"
