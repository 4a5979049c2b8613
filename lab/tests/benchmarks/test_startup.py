"""Processes are timed with what they start, and a start is measured; how fast is for ``aloft bench``."""

from __future__ import annotations

from pathlib import Path

import pytest

from aloft.lab.benchmarks.startup import startup, time_process


@pytest.mark.long
def test_a_process_is_timed_as_often_as_asked(tmp_path: Path) -> None:
    found = time_process(["--version"], tmp_path, 2)
    assert found.output.startswith("aloft ")
    assert 0.0 < found.user < 60.0 and found.wall > 0.0
    assert list((tmp_path / "bytecode").rglob("*.pyc"))


@pytest.mark.long
def test_a_process_that_fails_is_no_measurement(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="aloft check ended with 2"):
        time_process(["check", "nothing.yaml"], tmp_path, 1, warm=False)


@pytest.mark.long
def test_the_rows_are_complete() -> None:
    rows = startup(repeats=1, first=False)
    assert [row.goal for row in rows] == [0.5, None, 1.5]
    assert all(row.value is not None and 0.0 < row.value < 300.0 for row in rows)
