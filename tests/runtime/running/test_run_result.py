"""The outcome of a run: whose verdict counts, names of metrics, and the result as text and plain data."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from aloft.runtime.graph import Graph
from aloft.runtime.loading import checked_text
from aloft.runtime.running.run_result import ExitCode, RunResult, merge_metrics


def test_names_of_several_blocks_are_told_apart() -> None:
    merged, failure, success_reason = merge_metrics({"a": {"x": 1, "y": 2}, "b": {"x": 3}, "c": {}})
    assert merged == {"a.x": 1, "b.x": 3, "y": 2}
    assert failure is None and success_reason is None


def test_the_first_block_that_judges_without_success_gives_the_reason() -> None:
    blocks = {
        "plain": {"speed": 1.0},
        "good": {"success": True, "reason": "it stands", "tilt": 0.1},
        "bad": {"success": False, "reason": "it fell"},
        "worse": {"success": False},
    }
    merged, failure, success_reason = merge_metrics(blocks)
    assert (failure, success_reason) == ("it fell", "it stands")
    assert list(merged) == ["tilt", "speed"], "those of blocks that judge come first"
    assert merge_metrics({"worse": {"success": False}})[1] == "block 'worse' reports no success"
    vetoed: dict[str, dict[str, object]] = {"a": {"veto": "damped"}, "b": {"success": True}}
    assert merge_metrics(vetoed) == ({}, "damped", None)  # type: ignore[arg-type]
    judged = {**vetoed, "b": {"success": False, "reason": "fell"}}
    assert merge_metrics(judged)[1] == "fell"  # type: ignore[arg-type]
    assert merge_metrics({"quiet": {"success": True}})[1:] == (None, None)
    # a reason without a verdict is nobody's
    assert merge_metrics({"talker": {"reason": "well"}}) == ({}, None, None)


def result(**values: object) -> RunResult:
    return RunResult(True, "done", ExitCode.SUCCESS, 250, 0.002, 0.1, **values)  # type: ignore[arg-type]


def test_a_result_as_text_and_plain_data() -> None:
    metrics = {"a": math.nan, "b": np.float64(1.5), "c": np.int64(2), "d": math.inf, "e": "<b>"}
    found = result(metrics=metrics)
    assert found.duration_s == pytest.approx(0.5)
    assert repr(found) == "<RunResult: success: done; 250 ticks, 0.5 s, 5 metrics, hash none>"
    data = json.loads(json.dumps(found.to_json()))
    assert data["metrics"] == {"a": None, "b": 1.5, "c": 2, "d": None, "e": "<b>"}
    assert (data["success"], data["ticks"], data["duration_s"]) == (True, 250, 0.5)
    page = found._repr_html_()
    assert "<b>success: done (250 ticks, 0.5 s)</b>" in page and "&lt;b&gt;" in page
    with pytest.raises(RuntimeError, match="this run kept no log"):
        found.signals()


def test_the_times_and_values_of_a_logged_run() -> None:
    text = "rate: 100 Hz\nduration: 0.25 s\nblocks:\n  r: {use: blocks.Ramp, with: {slope: 2}}\n"

    found = Graph(checked_text(text, Path("ramp.yaml"))).run(log=True)
    assert found.ticks == 25 and found.duration_s == pytest.approx(0.25)
    np.testing.assert_allclose(found.time, 0.01 * np.arange(25))
    values = found.signal("r.y.value")
    np.testing.assert_allclose(values[:, 0], 2.0 * found.time, atol=1e-12)
    assert "r.y.value" in found.signals()
    with pytest.raises(KeyError, match=r"no signal 'r\.y\.valeu'; the nearest is r\.y\.value"):
        found.signal("r.y.valeu")
    assert "25 ticks logged" in repr(found)
