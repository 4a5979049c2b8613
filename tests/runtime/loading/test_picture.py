"""The table and the diagram of a graph."""

import json
from pathlib import Path

from aloft.extensions.studio.diagram.diagram import diagram
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading import checked_text
from aloft.runtime.loading.picture import mermaid, table, table_json

PARTS = """
from aloft.runtime.language.block import Block, Input, Output
from aloft.runtime.language.signals import Field, Signal
class Pose(Signal):
    position = Field((2, "n_joints"), unit="m", frame="world")
    count = Field(dtype="int64")
class Robot(Block):
    pose = Output(Pose, truth=True)
    push = Input(Pose, default={})
    def emit(self): pass
    def update(self): pass
class Judge(Block):
    pose = Input(Pose, reads_truth=True)
    def step(self): pass
"""
GRAPH = """
rate: 100 Hz
duration: 1 s
robot: bruce
blocks:
  last: {use: blocks.Gain, with: {n: 2}, in: {u: slow.y}}
  source: {use: blocks.Constant, with: {value: [1.0, 2.0]}}
  slow: {use: blocks.Gain, with: {n: 2}, in: {u: {from: source.y, delay: 2}}, rate: 50 Hz}
  robot: {use: picture_parts:Robot}
  judge: {use: picture_parts:Judge, in: {pose: robot.pose}}
  fed: {use: blocks.Gain, in: {u: {value: {value: 3.0}}}}
"""


def graph(folder: Path) -> CheckedGraph:
    (folder / "picture_parts.py").write_text(PARTS)
    return checked_text(GRAPH, folder / "graph.yaml")


def test_rows_in_the_order_of_execution(tmp_path: Path) -> None:
    rows = table(graph(tmp_path))
    assert [(r.order, r.path, r.use, r.rate_hz, r.machine) for r in rows] == [
        (1, "slow/u~delay", "delay", 100.0, "Moore"),
        (2, "robot", "picture_parts:Robot", 100.0, "Moore"),
        (3, "source", "blocks.Constant", 100.0, "Mealy"),
        (4, "slow", "blocks.Gain", 50.0, "Mealy"),
        (5, "last", "blocks.Gain", 100.0, "Mealy"),
        (6, "judge", "picture_parts:Judge", 100.0, "Mealy"),
        (7, "fed/u~constant", "constant", 100.0, "Mealy"),
        (8, "fed", "blocks.Gain", 100.0, "Mealy"),
    ]


def test_inputs_say_what_happens_on_the_way(tmp_path: Path) -> None:
    rows = {row.path: row for row in table(graph(tmp_path))}
    texts = {path: [item.text() for item in row.inputs] for path, row in rows.items()}
    assert texts == {
        "slow/u~delay": ["u <- source.y (Vector)"],
        "robot": ["push <- default (Pose)"],
        "source": [],
        "slow": ["u <- source.y (Vector, delay 2, samples 100 Hz)"],
        "last": ["u <- slow.y (Vector, holds 50 Hz)"],
        "judge": ["pose <- robot.pose (Pose, simulation truth)"],
        "fed/u~constant": [],
        "fed": ["u <- constant (Vector)"],
    }
    assert rows["judge"].inputs[0].fields == ("position: float64[2, 10] m in world", "count: int64")
    assert rows["robot"].outputs == ("pose: Pose",)


def test_json(tmp_path: Path) -> None:
    data = json.loads(json.dumps(table_json(graph(tmp_path))))
    assert (data["name"], data["base_rate_hz"], data["ticks"], data["robot"]) == (
        "graph",
        100.0,
        100,
        "bruce",
    )
    assert data["blocks"][3]["inputs"][0]["delay"] == 2


def test_mermaid(tmp_path: Path) -> None:
    assert mermaid(graph(tmp_path)) == (
        "flowchart LR\n"
        '  b0["last<br/>blocks.Gain<br/>100 Hz"]\n'
        '  b1["source<br/>blocks.Constant<br/>100 Hz"]\n'
        '  b2["slow<br/>blocks.Gain<br/>50 Hz"]\n'
        '  b3(["robot<br/>picture_parts:Robot<br/>100 Hz"])\n'
        '  b4["judge<br/>picture_parts:Judge<br/>100 Hz"]\n'
        '  b5["fed<br/>blocks.Gain<br/>100 Hz"]\n'
        '  b1 -.->|"y to u<br/>Vector<br/>samples 100 Hz<br/>delay 2"| b2\n'
        '  b2 ==>|"y to u<br/>Vector<br/>holds 50 Hz"| b0\n'
        '  b3 -->|"pose to pose<br/>Pose"| b4\n'
    )


def test_mermaid_draws_a_box_around_a_subgraph(tmp_path: Path) -> None:
    (tmp_path / "leg.yaml").write_text(
        "outputs: {y: gain.y}\nblocks:\n  one: {use: blocks.SineWave}\n"
        "  gain: {use: blocks.Gain, in: {u: one.y}}\n"
    )
    text = "rate: 1\nblocks: {left: {use: leg.yaml}, sum: {use: blocks.Gain, in: {u: left.y}}}"
    assert mermaid(checked_text(text, tmp_path / "graph.yaml")) == (
        "flowchart LR\n"
        '  b2["sum<br/>blocks.Gain<br/>1 Hz"]\n'
        '  subgraph left_box ["left"]\n'
        '    b0["one<br/>blocks.SineWave<br/>1 Hz"]\n'
        '    b1["gain<br/>blocks.Gain<br/>1 Hz"]\n'
        "  end\n"
        '  b0 -->|"y to u<br/>Vector"| b1\n'
        '  b1 -->|"y to u<br/>Vector"| b2\n'
    )


def test_a_block_in_the_background_says_its_latency(tmp_path: Path) -> None:
    text = GRAPH.replace("rate: 50 Hz}", "rate: 50 Hz, background: {latency: 60 ms}}")
    (tmp_path / "picture_parts.py").write_text(PARTS)
    checked = checked_text(text, tmp_path / "graph.yaml")
    rows = {row.path: row for row in table(checked)}
    assert (rows["slow"].background, rows["slow"].machine) == ("60 ms", "Moore")
    assert {row.background for path, row in rows.items() if path != "slow"} == {""}
    line = '  b2(["slow<br/>blocks.Gain<br/>50 Hz<br/>in the background, 60 ms"])\n'
    assert line in mermaid(checked)
    assert diagram(checked).nodes["slow"].use == "blocks.Gain, 60 ms behind"
