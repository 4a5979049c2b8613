"""What the page needs to know of parameters: numbers, lists, choices, bounds, places."""

from pathlib import Path
from typing import Any

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.runtime.live.tunables import FIRST_LINE, Tunables, write_overlay
from aloft.runtime.loading import checked_file, checked_text
from aloft.runtime.loading.checking.parameters import entries
from aloft.runtime.running.memory import BoundGraph


def rows(source: Path | str, *overrides: str) -> dict[str, dict[str, Any]]:
    graph = checked_file(source, list(overrides))
    listed = [vars(entry) for entry in entries(BoundGraph(graph).blocks) if entry.live]
    return {row["path"]: row for row in Tunables(graph).rows(listed)}


def test_numbers_lists_and_what_may_be_nothing(graph_file: Path) -> None:
    found = rows(graph_file)
    frequency = found["wave.frequency"]
    assert (frequency["kind"], frequency["unit"], frequency["bounds"]) == ("number", "Hz", "≥ 0")
    assert (frequency["low"], frequency["high"]) == (0.0, 6.0)
    assert found["wave.amplitude"]["bounds"] == "" and found["wave.amplitude"]["low"] < 0.0
    assert frequency["start"] == frequency["value"] == 2.0
    assert frequency["place"] == f"{graph_file}:8:7"
    assert (frequency["block"], frequency["name"]) == ("wave", "frequency")
    kp = found["pid.kp"]
    assert (kp["kind"], kp["value"], kp["low"], kp["high"]) == ("numbers", [1.0, 2.0], -3.0, 6.0)
    assert found["pid.lower"]["kind"] == "text"
    assert found["inner/twice.gain"]["place"].startswith(f"{graph_file.parent / 'part.yaml'}:4:")
    assert found["pid.kd"]["place"] == f"default; its block is in {graph_file}:10:3"


def test_inside_of_the_jump() -> None:
    found = rows("aloft:jump", "wbc.landing.torso_damping=[28, 28, 29]")
    damping = found["wbc.landing.torso_damping"]
    assert (damping["block"], damping["name"]) == ("wbc", "landing.torso_damping")
    assert damping["kind"] == "numbers" and len(damping["value"]) == 3
    assert "--set wbc.landing.torso_damping" in damping["place"]
    beyond = found["legs.beyond"]
    assert (beyond["kind"], beyond["choices"]) == ("choice", ["turn", "slide"])
    for row in found.values():
        assert row["text"] and row["low"] <= row["high"], row["path"]
        numbers = row["value"] if row["kind"] == "numbers" else [row["value"]]
        if row["kind"] in ("number", "numbers"):
            assert all(row["low"] <= x <= row["high"] for x in numbers), row["path"]


def row(path: str, value: Any, start: Any, unit: str = "") -> dict[str, Any]:
    return {"path": path, "value": value, "start": start, "unit": unit}


ROWS = [
    row("wave.frequency", 5.0, 2.0, "Hz"),
    row("wave.phase", 0.0, 0.0, "rad"),
    row("inner/twice.gain", [1.5, 2.5], 2.0),
]


def test_it_includes_the_graph_and_sets_what_changed(graph_file: Path) -> None:
    folder = graph_file.parent / "tuned"
    folder.mkdir()
    path = folder / "fast.yaml"
    assert write_overlay(path, checked_file(graph_file), ROWS) == [
        "wave.frequency",
        "inner/twice.gain",
    ]
    assert path.read_text().splitlines() == [
        FIRST_LINE,
        'include: ["../waves.yaml"]',
        "set:",
        "  wave.frequency: 5.0  # was 2.0 Hz",
        "  inner/twice.gain: [1.5, 2.5]  # was 2.0",
    ]
    graph = checked_file(path)
    assert graph.block("wave").params.frequency == 5.0  # type: ignore[attr-defined]
    assert graph.block("inner/twice").params.gain == [1.5, 2.5]  # type: ignore[attr-defined]
    assert graph.base_rate == 200.0
    write_overlay(path, checked_file(graph_file), ROWS[:1])
    assert "twice" not in path.read_text(), "its own file is replaced"


def test_what_is_refused(graph_file: Path) -> None:
    graph, path = checked_file(graph_file), graph_file.parent / "other.yaml"
    with pytest.raises(AloftError, match="no parameter has another value than when the run began"):
        write_overlay(path, graph, ROWS[1:2])
    path.write_text("rate: 1 Hz\n")
    with pytest.raises(AloftError, match=r"other\.yaml is there already; give another name with"):
        write_overlay(path, graph, ROWS)
    assert path.read_text() == "rate: 1 Hz\n"
    with pytest.raises(AloftError, match="cannot be written"):
        write_overlay(graph_file.parent / "no" / "such.yaml", graph, ROWS)
    with pytest.raises(AloftError, match=r"the file would not load: .*wave\.frequency"):
        write_overlay(graph_file.parent / "new.yaml", graph, [row("wave.frequency", "fast", 2.0)])
    text = "rate: 1 Hz\nblocks: {a: {use: blocks.Constant, with: {value: [7]}}}"
    with pytest.raises(AloftError, match="not run from a file that is still there"):
        write_overlay(path, checked_text(text, "nowhere.yaml"), ROWS)
