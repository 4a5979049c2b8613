"""What the page needs to know of parameters: numbers, lists, choices, bounds, places."""

from pathlib import Path
from typing import Any

from aloft.runtime.live.tunables import Tunables
from aloft.runtime.loading import load
from aloft.runtime.loading.checking.parameters import entries
from aloft.runtime.running.memory import BoundGraph


def rows(source: Path | str, *overrides: str) -> dict[str, dict[str, Any]]:
    graph = load(source, list(overrides))
    listed = [vars(entry) for entry in entries(BoundGraph(graph).blocks) if entry.live]
    return {row["path"]: row for row in Tunables(graph).rows(listed)}


def test_numbers_lists_and_what_may_be_nothing(graph_file: Path) -> None:
    found = rows(graph_file)
    frequency = found["wave.frequency"]
    assert (frequency["kind"], frequency["unit"], frequency["bounds"]) == ("number", "Hz", "≥ 0")
    assert (frequency["low"], frequency["high"]) == (0.0, 6.0)
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
