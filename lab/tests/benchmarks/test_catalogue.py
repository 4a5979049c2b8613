"""All benchmarks by name, and the report of those that were run."""

import pytest

from aloft.lab.benchmarks.catalogue import BENCHMARKS, run_benchmarks
from aloft.lab.benchmarks.rows import Row


def test_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "aloft.lab.benchmarks.catalogue.BENCHMARKS", {"one": lambda: [Row("x", 1.0, "s")]}
    )
    report = run_benchmarks()
    assert set(report) == {"machine", "load", "rows"}
    assert report["rows"][0]["name"] == "x" and report["rows"][0]["met"] is None
    assert report["machine"]["cores"] >= 1
    with pytest.raises(KeyError, match="no benchmark 'two'; there is one"):
        run_benchmarks(["two"])
    assert "scheduler" in BENCHMARKS
