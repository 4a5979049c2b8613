"""The table and the picture of one tick, from what ``aloft bench tick --json`` prints."""

from collections.abc import Callable
from types import ModuleType

import pytest

from aloft.lab.benchmarks.rows import Row
from aloft.lab.benchmarks.tick.chart import tick_chart

ROWS = [
    Row("block wbc", 20.0, "us/tick"),
    Row("block legs", 10.0, "us/tick"),
    Row("block step", 0.5, "us/tick"),
    Row("fused block wbc", 19.0, "us/tick"),
    Row("fused block legs", 9.0, "us/tick"),
    Row("fused block step", 0.25, "us/tick"),
    Row("controller, fused", 30.0, "us/tick", "OSQP", 0.04, 1 / 30, floor=1 / 20),
    Row("TSID", None, "us/tick", "x", note="not installed"),
    Row("period", 100.0, "us", goal=50.0, floor=250.0),
]
FOUND = {
    "machine": {"processor": "Quick", "cores": 2, "python": "3.11"},
    "load": {"before": [0.5, 1, 1], "after": [0.75, 1, 1]},
    "rows": [row.to_json() for row in ROWS],
}


@pytest.fixture
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("result_tables")


def test_the_tables(script: ModuleType) -> None:
    page = script.tick_tables(FOUND)
    assert page.startswith("Quick, 2 cores, Python 3.11; load before 0.5, after")
    assert "| median [us] | fused | kernels one by one |" in page  # without OSQP
    assert "| `wbc` | 19.0 | 20.0 |" in page
    assert "| controller, fused | 30 us | OSQP | 25 | 20 | 30 | floor reached |" in page
    assert "| TSID | - | x |  |  |  | not installed |" in page
    assert "| period | 100 us |  |  | 250 us | 50 us | floor reached |" in page


def test_the_table_of_a_benchmark_without_blocks(script: ModuleType) -> None:
    page = script.ratio_table(FOUND)
    assert page.startswith("Quick, 2 cores, Python 3.11; load before 0.5, after 0.75. Ratios bear")
    assert "| controller, fused | 30 us | OSQP | 25 | 20 | 30 | floor reached |" in page
    assert "| block wbc | 20 us |" in page


def test_an_earlier_commit_has_other_blocks(script: ModuleType) -> None:
    rows = [*FOUND["rows"], Row("old block wbc", 200.0, "us/tick").to_json()]
    assert "| `wbc` | 19.0 | 20.0 | 200.0 |" in script.tick_tables({**FOUND, "rows": rows})
    assert "| `legs` | 9.0 | 10.0 |  |" in script.tick_tables({**FOUND, "rows": rows})
    text = tick_chart(rows)
    assert ">at an earlier commit<" in text and ">200 us<" in text


def test_the_picture_has_every_large_block() -> None:
    text = tick_chart(FOUND["rows"])
    assert text == tick_chart(FOUND["rows"])
    for word in ("wbc", "legs", "the others", "kernels one by one", "28 us"):
        assert f">{word}<" in text
    assert "prefers-color-scheme:dark" in text
    for word in ("step", "OSQP"):
        assert f">{word}<" not in text
