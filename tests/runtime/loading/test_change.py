"""A loaded graph with other parameters is the one that is loaded with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import aloft
from aloft import AloftError, Graph, LoadError
from aloft.runtime.testing.graphs import checked_graph

GRAPH = """
rate: 100 Hz
duration: 0.2 s
clock: {kind: free}
faults: {late: {on: noise.y, kind: lost, share: 0.5}}
blocks:
  noise: {use: blocks.WhiteNoise, with: {seed: 1}}
  twice: {use: blocks.Gain, with: {gain: 2.0}, in: {u: noise.y}}
  same: {use: blocks.Gain, with: {gain: {from: twice.gain}}, in: {u: noise.y}}
"""


def load(overrides: dict[str, Any] | None = None) -> Graph:
    return aloft.load(GRAPH, overrides or {}, path="here.yaml")


@pytest.mark.parametrize(
    "overrides",
    [
        {"noise.seed": 5},
        {"twice.gain": 3.0},
        {"duration": "0.1 s"},
        {"clock.kind": "paced"},
        {"faults.late.seed": 4},
        {"faults.late.share": 0.1, "same.gain": 7.0},
        {"twice.use": "blocks.RateLimiter", "twice.gain": None},
    ],
)
def test_changed_afterwards_and_when_it_is_loaded_are_one(overrides: dict[str, Any]) -> None:
    try:
        expected = load(overrides).checked
    except LoadError as error:
        with pytest.raises(LoadError) as raised:
            load().changed(overrides)
        assert str(raised.value) == str(error)
        return
    found = load().changed(overrides).checked
    assert found.text == expected.text
    assert found.overrides == expected.overrides == overrides
    assert (found.ticks, found.clock) == (expected.ticks, expected.clock)
    told = [[(spec.path, spec.where, spec.params) for spec in g.blocks] for g in (found, expected)]
    assert told[0] == told[1]


def test_what_follows_from_a_changed_parameter_follows_anew() -> None:
    changed = load().changed({"twice.gain": 3.0})
    assert "same: {use: blocks.Gain" not in changed.checked.text
    assert changed.checked.block("same").params.gain == 3.0  # type: ignore[attr-defined]


def test_changes_add_up() -> None:
    changed = load().changed({"noise.seed": 2}).changed(["twice.gain=4"])
    assert changed.checked.overrides == {"noise.seed": 2, "twice.gain": 4}
    assert changed.checked.text == load({"noise.seed": 2, "twice.gain": 4}).checked.text


def test_a_report_names_the_place_in_the_file_that_was_read() -> None:
    with pytest.raises(LoadError) as raised:
        load().changed({"twice.gain": "two"})
    assert "--set twice.gain=two" in str(raised.value)
    with pytest.raises(LoadError) as raised:
        load().changed({"clock.kind": "free", "noise.use": "blocks.Gain"})
    assert "here.yaml:7" in str(raised.value)


def test_a_block_that_is_not_there_is_named_with_the_nearest() -> None:
    with pytest.raises(LoadError) as raised:
        load().changed({"twic.gain": 2})
    assert "'twic.gain': there is no block 'twic'" in str(raised.value)
    assert "twice.gain" in str(raised.value)


def test_a_block_cannot_become_a_sub_graph_any_more() -> None:
    with pytest.raises(LoadError) as raised:
        load().changed({"twice.use": "leg.yaml"})
    assert "'twice.use': twice cannot become the sub-graph leg.yaml any more" in str(raised.value)
    assert "give twice.use where the graph is loaded, not to one that is" in str(raised.value)


def test_a_graph_that_was_put_together_in_python_cannot_be_changed() -> None:
    graph = Graph(checked_graph({}))
    with pytest.raises(AloftError, match="cannot be changed: it was put together in Python"):
        graph.changed({"a.seed": 1})


def test_a_file_that_is_gone_is_not_needed_again(tmp_path: Path) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH)
    graph = aloft.load(file)
    file.unlink()
    assert (
        graph.run(seed=3).run_hash
        == graph.changed({"noise.seed": 3, "faults.late.seed": 3}).run().run_hash
    )
