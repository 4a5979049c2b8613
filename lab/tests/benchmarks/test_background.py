"""The benchmark of background blocks: that it is complete; how fast is for ``aloft bench``."""

import pytest

from aloft.lab.benchmarks.background import background


@pytest.mark.long
def test_rows_are_complete() -> None:
    rows = {row.name: row for row in background(seconds=1.0, rounds=1)}
    cost = rows["sampling and showing"].value
    assert cost is not None and cost > 0.0
    late = rows["late ticks beside 40 ms of work every 60 ms"]
    assert late.peer == "the same graph without the block" and late.goal == 1.0
