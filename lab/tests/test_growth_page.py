"""The table and the picture of what grows with what, from what ``aloft bench growth --json`` prints."""

import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from aloft.lab.benchmarks import growth as module
from aloft.lab.benchmarks.earlier_build import Build
from aloft.lab.benchmarks.growth import CURVES, Growth, growth
from aloft.lab.benchmarks.rows import Row
from aloft.lab.figures.growth import growth_chart, measured, seconds

ROOT = Path(__file__).parents[2]
ROWS = [
    Row("load: 100 blocks", 0.5, "s", "0123456789", 1.0).to_json(),
    Row("load: 4900 blocks", 12.25, "s", "0123456789", 0.5).to_json(),
]
FOUND = {
    "machine": {"processor": "Quick", "cores": 2, "python": "3.11"},
    "load": {"before": [0.5, 1, 1], "after": [0.75, 1, 1]},
    "rows": ROWS, "commit": "fedcba9876543210",
}  # fmt: skip


def test_the_earlier_builds_times_follow_from_the_ratios() -> None:
    (curve,) = measured(ROWS)
    assert (curve.work, curve.over, curve.points) == ("load", "blocks", [100, 4900])
    assert (curve.times, curve.earlier) == ([0.5, 12.25], [0.5, 24.5])
    assert measured([Row("a: 1 b", 0.5, "s").to_json()])[0].earlier == []


def test_the_table_has_both_ends(docs_script: Callable[[str], ModuleType]) -> None:
    script = docs_script("result_tables")
    text = script.growth_table(FOUND)
    assert "|  | processor time | times as many | times the time | by 01234567 |" in text
    assert "| load: 100 to 4,900 blocks | 0.5 s to 12 s | 49.0 | 24.5 | 1.00 to 0.50 |" in text
    assert "Code of commit fedcba98.\n\n![What grows with what](growth.svg)" in text
    alone = [Row("load: 1 blocks", 0.5, "s").to_json()]
    assert "| 1.0 | 1.0 |  |" in script.growth_table({**FOUND, "rows": alone})


def test_the_picture_is_of_the_pages_data() -> None:
    rows = json.loads((ROOT / "docs" / "data" / "growth.json").read_text())["rows"]
    curves = measured(rows)
    assert [(c.work, c.over, c.points) for c in curves] == [
        (c.work, c.over, list(c.points)) for c in CURVES
    ]
    for picture in (growth_chart(rows), (ROOT / "docs" / "growth.svg").read_text()):
        assert "prefers-color-scheme:dark" in picture
        for curve in curves:
            assert f">{curve.work} [s]<" in picture
            assert f">{seconds(curve.times[-1])}<" in picture
            assert f">{seconds(curve.earlier[-1])} {curve.since[:8]}<" in picture


def test_builds_take_turns_at_every_curve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "__init__.py").touch()
    asked: list[tuple[bool, str]] = []

    def process(
        arguments: list[str], build: Build, codes: object = (0,), forgets: object = ()
    ) -> dict[str, float]:
        earlier = (build.folder / "aloft").resolve() == tmp_path.resolve()
        asked.append((earlier, arguments[-1].partition("\n")[0]))
        return {"time": 3.0, "1": 2.0 + 2.0 * earlier, "2": 6.0 + 2.0 * earlier}

    monkeypatch.setattr(module, "run_process", process)
    curves = [
        Growth("think", "knots", {1: "", 2: ""}, "print(POINTS)"),
        Growth("jump", "joints", {5: "one", 6: "two"}, arguments=("jump", "POINT")),
    ]
    assert growth(str(tmp_path), curves) == [
        Row("think: 1 knots", 2.0, "s", str(tmp_path), 0.5),
        Row("think: 2 knots", 6.0, "s", str(tmp_path), 0.75),
        Row("jump: 5 joints", 3.0, "s", str(tmp_path), 1.0),
        Row("jump: 6 joints", 3.0, "s", str(tmp_path), 1.0),
    ]
    first, both = "POINTS = {1: ''}", "POINTS = {1: '', 2: ''}"
    assert asked[:6] == [(k, first) for k in (False, True)] + [
        (k, both) for k in (False, True, True, False)
    ]
    assert [word for _, word in asked[8:]] == ["one", "one", "one", "two", "one", "two"]
    assert growth(curves=curves[:1])[0] == Row("think: 1 knots", 2.0, "s")
