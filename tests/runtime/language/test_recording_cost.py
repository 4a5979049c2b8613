"""What it costs to record a graph, told before it runs."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from aloft.cli import make_app
from aloft.runtime.language.recording_cost import large_recording, recording_cost
from aloft.runtime.loading import checked_file

CAMERA = """\
from aloft import Block, Field, Output, Signal

class Picture(Signal):
    pixels = Field((480, 640), text="grey values")

class Camera(Block):
    picture = Output(Picture, text="the picture")
    def step(self): pass
"""
GRAPH = """\
rate: 500 Hz
blocks:
  cam: {use: "camera_of_cost:Camera", rate: 25 Hz}
  t: {use: blocks.Ramp, with: {slope: 1, unit: ""}}
"""


@pytest.fixture
def graph(tmp_path: Path) -> Path:
    (tmp_path / "camera_of_cost.py").write_text(CAMERA)
    (tmp_path / "cam.yaml").write_text(GRAPH)
    return tmp_path / "cam.yaml"


def test_a_slow_block_counts_where_it_runs(graph: Path) -> None:
    cost = recording_cost(checked_file(graph))
    picture = 480 * 640 * 8
    assert cost.bus_bytes == picture + 8
    assert cost.bytes_per_minute == 60 * (25 * picture + 500 * 8 + picture + 8)
    assert cost.largest[0].name == "cam.picture.pixels"


def test_a_large_recording_is_warned_of(graph: Path) -> None:
    assert "cam.picture.pixels 3.69 GB" in large_recording(checked_file(graph))
    done = CliRunner().invoke(make_app(["check"]), ["check", str(graph), "--cost"])
    text = " ".join(done.output.split())
    assert "warning: a minute of its recording takes 3.83 GB before compression" in text
    assert "or not at all (--no-record)" in text and "cost: a minute" in text


def test_a_slower_camera_is_not_large(graph: Path) -> None:
    graph.write_text(GRAPH.replace("25 Hz", "5 Hz"))
    assert large_recording(checked_file(graph)) == ""


def test_the_shipped_jump_is_not_large() -> None:
    cost = recording_cost(checked_file("aloft:jump"))
    assert not cost.is_large and cost.bytes_per_minute > 1e8
