"""The benchmark of the exported library compares equal computations, and says what it measured."""

import shutil

import pytest

from aloft.lab.benchmarks.export import BARE, FUSED, LIBRARY, export

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler (cc)"),
]


def test_the_rows() -> None:
    rows = {row.name: row for row in export(rounds=1, ticks=60, count=2000, seconds=1)}
    for peer in (FUSED, BARE):
        beside = rows[f"{LIBRARY}, beside {peer}"]
        assert beside.peer == peer and beside.ratio is not None and 0.1 < beside.ratio < 10.0
    one, longest = rows["library in C, a tick"], rows["library in C, longest tick"]
    assert (
        one.value is not None
        and longest.value is not None
        and 0.0 < one.value <= 1000.0 * longest.value
    )
    assert longest.note.startswith("of 2000; 99 % below ")
    memory, stack = rows["library, memory of an instance"], rows["library, stack of a step"]
    assert memory.value is not None and 10.0 < memory.value < 1000.0
    assert stack.value is not None and 0.0 < stack.value < 100.0
    assert {f"library in C at {rate} Hz, latest wake-up" for rate in (500, 1000, 5000)} <= set(rows)
