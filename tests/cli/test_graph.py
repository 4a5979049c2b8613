"""``aloft graph`` as a block diagram in files."""

from pathlib import Path

import pytest

from .conftest import Call

GRAPH = """
rate: 100 Hz
blocks:
  setpoint: {use: blocks.SineWave}
  inner: {use: part.yaml, in: {u: setpoint.y}}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "graph.yaml").write_text(GRAPH)
    (tmp_path / "part.yaml").write_text(
        "inputs: {u: required}\noutputs: {y: g.y}\n"
        "blocks: {g: {use: blocks.Gain, in: {u: inputs.u}}}\n"
    )
    return tmp_path


def test_files_are_written_and_the_table_is_left_out(folder: Path, call: Call) -> None:
    done = call("graph", "graph.yaml", "--svg", "a.svg", "--png", "a.png")
    assert done.stdout == ""
    assert done.stderr.splitlines() == ["diagram: a.svg", "diagram: a.png"]
    assert 'data-path="inner/g"' in (folder / "a.svg").read_text()
    assert (folder / "a.png").stat().st_size > 1000


def test_boxes_can_be_closed(folder: Path, call: Call) -> None:
    call("graph", "graph.yaml", "--svg", "a.svg", "--closed", "inner")
    assert 'data-path="inner/g"' not in (folder / "a.svg").read_text()
    done = call("graph", "graph.yaml", "--svg", "a.svg", "--closed", "iner", code=2)
    assert "there is no sub-graph 'iner'; there is inner" in done.stderr


def test_a_file_that_cannot_be_written_is_an_error(folder: Path, call: Call) -> None:
    done = call("graph", "graph.yaml", "--svg", "no/such/a.svg", code=2)
    assert "cannot write the diagram" in done.stderr


def test_machines_are_drawn(folder: Path, call: Call) -> None:
    """In the table, in both kinds of diagram, and with the links between them."""
    machines = (
        "machines: {here: tcp/127.0.0.1:7450, there: tcp/127.0.0.1:7451}\nplace: {inner: there}\n"
    )
    (folder / "graph.yaml").write_text(GRAPH + machines)
    shown = call("graph", "graph.yaml").stdout
    assert "tcp/127.0.0.1:7451" in shown and "here -> there" in shown
    mermaid = call("graph", "graph.yaml", "--mermaid").stdout
    assert "classDef on_here " in mermaid and "classDef on_there " in mermaid
    assert " on_here\n" in mermaid and mermaid.rstrip().endswith("on_there")
    call("graph", "graph.yaml", "--svg", "graph.svg")
    drawn = (folder / "graph.svg").read_text()
    assert "there" in drawn and "here" in drawn.replace("there", "")
