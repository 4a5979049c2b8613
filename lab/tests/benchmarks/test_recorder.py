"""The recorder's benchmark: that it is complete; how fast is for ``aloft bench``."""

import pytest

from aloft.lab.benchmarks.recorder import COST_GOAL, recorder


@pytest.mark.long
def test_rows_are_complete_and_nothing_is_dropped() -> None:
    found = recorder(seconds=1.0, rounds=2)
    rows = {row.name: row for row in found}
    assert rows["recording a tick"].goal == COST_GOAL == 2.0
    assert rows["array allocations of recording"].value == 0.0
    assert rows["rows dropped"].value == 0.0
    size = rows["size of the file"].value
    assert size is not None and size > 100.0  # 8896 bytes at 500 Hz are 267 MB/min
    memory = rows["memory of the recorder, at most"].value
    assert memory is not None and memory > 10.0
    packed = [row for row in found if row.name == "packed rows, size"]
    assert len(packed) == 2 and all(row.ratio is not None and row.ratio < 0.75 for row in packed)
