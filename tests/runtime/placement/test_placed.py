"""Placing a graph: who runs what, which links that needs, and what travels on them."""

from pathlib import Path

import pytest

from aloft.runtime.language.stages import MachineSpec
from aloft.runtime.loading import checked_file, checked_text
from aloft.runtime.placement.placed import (
    PlacementError,
    link_rows,
    machine_rows,
    placement_json,
    split_over_machines,
    spread,
)

PATH = Path("graph.yaml")
HEAD = """
rate: 100 Hz
machines: {onboard: tcp/127.0.0.1:7450, ground: tcp/127.0.0.1:7451}
"""
BLOCKS = """
blocks:
  wish: {use: blocks.SineWave, with: {amplitude: 1.0, frequency: 0.5}, rate: 50 Hz}
  error: {use: blocks.Sum, with: {weights: [1, -1]}, in: {a: wish.y, b: position.y}, on: ground}
  controller: {use: blocks.Gain, with: {gain: 4 1/s}, in: {u: error.y}, on: ground}
  position: {use: blocks.Integrator, in: {u: controller.y}}
"""
LEG = """
inputs: {u: }
outputs: {y: second.y}
blocks:
  first: {use: blocks.Gain, in: {u: inputs.u}}
  second: {use: blocks.Gain, in: {u: first.y}, on: ground}
"""


def machines_of(text: str, path: Path = PATH) -> dict[str, str]:
    return {spec.path: spec.machine for spec in checked_text(text, path).blocks}


def test_a_block_without_a_place_runs_on_the_first_machine() -> None:
    assert machines_of(HEAD + BLOCKS) == {
        "wish": "onboard", "error": "ground", "controller": "ground", "position": "onboard",
    }  # fmt: skip


def test_a_graph_without_machines_is_placed_nowhere() -> None:
    graph = checked_text("rate: 1\nblocks:\n  a: {use: blocks.Constant, with: {value: [1]}}", PATH)
    assert graph.machines == () and graph.blocks[0].machine == ""
    with pytest.raises(PlacementError, match="names no machines; give it"):
        split_over_machines(graph)


def test_place_wins_over_on_and_names_whole_subgraphs(tmp_path: Path) -> None:
    (tmp_path / "leg.yaml").write_text(LEG)
    blocks = """
blocks:
  source: {use: blocks.Constant, with: {value: [1.0]}}
  left: {use: leg.yaml, in: {u: source.y}, on: ground}
  right: {use: leg.yaml, in: {u: source.y}}
  last: {use: leg.yaml, in: {u: source.y}}
place: {last: ground, last/second: onboard, left/second: onboard}
"""
    assert machines_of(HEAD + blocks, tmp_path / "graph.yaml") == {
        "source": "onboard",
        "left/first": "ground", "left/second": "onboard",
        "right/first": "onboard", "right/second": "ground",
        "last/first": "ground", "last/second": "onboard",
    }  # fmt: skip


def test_the_flat_text_says_the_place_of_every_block_and_loads_to_the_same_graph() -> None:
    graph = checked_text(HEAD + BLOCKS + "place: {wish: ground}", PATH)
    again = checked_text(graph.text, PATH)
    assert "on: ground" in graph.text and "place" not in graph.text
    assert [spec.machine for spec in again.blocks] == [spec.machine for spec in graph.blocks]
    assert [(m.name, m.endpoint) for m in again.machines] == [
        (m.name, m.endpoint) for m in graph.machines
    ]


def test_overrides_move_blocks_and_endpoints() -> None:
    settings = ["place.error=onboard", "machines.ground=tcp/127.0.0.1:9999"]
    graph = checked_text(HEAD + BLOCKS, PATH, settings)
    assert graph.block("error").machine == "onboard"
    assert [machine.endpoint for machine in graph.machines] == [
        "tcp/127.0.0.1:7450", "tcp/127.0.0.1:9999",
    ]  # fmt: skip


def test_a_delay_and_a_constant_run_where_they_are_read() -> None:
    blocks = """
blocks:
  a: {use: blocks.Gain, in: {u: {from: b.y, delay: 1}}, on: ground}
  b: {use: blocks.Gain, in: {u: {value: {value: 1.0}}}}
"""
    assert machines_of(HEAD + blocks) == {
        "a/u~delay": "ground", "a": "ground", "b/u~constant": "onboard", "b": "onboard",
    }  # fmt: skip


def test_links_carry_only_what_is_read_elsewhere() -> None:
    placed = split_over_machines(checked_text(HEAD + BLOCKS, PATH))
    assert [(link.name, link.rate_hz, link.payload, link.readers) for link in placed.links] == [
        ("wish@onboard -> ground", 50.0, 8, ("error.a",)),
        ("controller@ground -> onboard", 100.0, 8, ("position.u",)),
        ("position@onboard -> ground", 100.0, 8, ("error.b",)),
    ]
    assert [field.describe() for field in placed.links[0].fields] == ["wish.y.value: float64[1]"]
    assert [link.source for link in placed.sent_by("onboard")] == ["wish", "position"]
    assert [link.source for link in placed.received_by("onboard")] == ["controller"]
    assert [spec.path for spec in placed.blocks_on("ground")] == ["error", "controller"]


def test_a_shipped_controller_is_spread_by_an_overlay() -> None:
    shipped = Path(__file__).parents[3] / "graphs"
    placed = split_over_machines(checked_file(shipped / "machines" / "jump_two.yaml"))
    alone = checked_file(shipped / "jump.yaml")
    assert placed.graph.order == alone.order
    assert [spec.path for spec in placed.graph.blocks] == [spec.path for spec in alone.blocks]
    sent = {link.source: [field.name for field in link.fields] for link in placed.links}
    assert {"load", "dynamics", "phase", "wbc", "legs", "robot", "plan"} <= sent.keys()
    # the robot's joints are read on the ground, its IMU and the simulation truth are not
    assert {name.split(".")[1] for name in sent["robot"]} == {"joints"}


def test_an_unknown_machine() -> None:
    placed = split_over_machines(checked_text(HEAD + BLOCKS, PATH))
    assert placed.machine("ground").endpoint == "tcp/127.0.0.1:7451"
    with pytest.raises(PlacementError, match="has no machine 'air'; it has onboard, ground"):
        placed.machine("air")


def test_spread() -> None:
    graph = checked_text(HEAD + BLOCKS, PATH)
    other = spread(graph, {"a": "tcp/127.0.0.1:1", "b": "tcp/127.0.0.1:2"}, {"error": "b"})
    assert other.machines == (
        MachineSpec("a", "tcp/127.0.0.1:1"),
        MachineSpec("b", "tcp/127.0.0.1:2"),
    )
    assert [spec.machine for spec in other.blocks] == ["a", "b", "a", "a"]
    with pytest.raises(PlacementError, match="eror on b: there is no such block"):
        spread(graph, {"a": "tcp/127.0.0.1:1", "b": "tcp/127.0.0.1:2"}, {"eror": "b"})


def test_printed() -> None:
    placed = split_over_machines(checked_text(HEAD + BLOCKS, PATH))
    assert machine_rows(placed) == [
        ("onboard", "tcp/127.0.0.1:7450", "wish, position", "2 links, 1.2 kB/s", "1 link, 0.8 kB/s"),
        ("ground", "tcp/127.0.0.1:7451", "error, controller", "1 link, 0.8 kB/s", "2 links, 1.2 kB/s"),
    ]  # fmt: skip
    assert link_rows(placed)[0] == ("wish", "onboard -> ground", "50 Hz", "8 B", "error.a")
    data = placement_json(placed)
    assert data["machines"][1]["blocks"] == ["error", "controller"]
    assert data["links"][1]["fields"] == ["controller.y.value: float64[1]"]
