"""Rates and times of a graph file."""

from __future__ import annotations

import math
from typing import Any

import pytest

from aloft.files.nodes import from_plain
from aloft.files.problems import Position, Problems
from aloft.runtime.loading.reading.written import read_quantity

HERE = Position("graph.yaml", 3, 7)


@pytest.mark.parametrize(
    ("value", "seconds"),
    [
        (4, 4.0), (0.5, 0.5), ("250 ms", 0.25), ("2 min", 120.0), (9e11, 9e11), (0, None), (-1, None),
        (True, None), (1e12, None), (math.inf, None), (10**400, None), ("3 Hz", None), ("x", None),
        (None, None), ([1], None),
    ],
)  # fmt: skip
def test_a_quantity_is_positive_and_finite(value: Any, seconds: float | None) -> None:
    problems = Problems()
    assert read_quantity(from_plain(value, HERE), "clock.late", "s", problems) == seconds
    report = problems.report("graph.yaml")
    assert report.ok == (seconds is not None)
    assert all(p.where == HERE and p.at == "clock.late" for p in report.problems)
