"""The fix that a report proposes is one that a person would choose."""

from pathlib import Path

from aloft.runtime.loading.checked import check

TWO_SOURCES = """\
rate: 100 Hz
blocks:
  ref: {use: blocks.SineWave}
  other: {use: blocks.SineWave}
  sum: {use: blocks.Sum, in: {a: ref.y}}
"""


def test_a_second_input_is_not_offered_the_source_of_the_first(tmp_path: Path) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(TWO_SOURCES)
    (problem,) = check(file).problems
    assert problem.at == "sum.b"
    assert problem.fix == "in: {b: other.y}"


PLANT = """\
from aloft import Block, Field, Output, Parameters, Signal

class State(Signal):
    switch = Field(dtype="bool", text="closed")
    position = Field(1, unit="m", text="where")
    velocity = Field(1, unit="m/s", text="how fast")

class Plant(Block):
    state = Output(State, text="all there is")
    def step(self): ...
"""


def test_a_field_of_the_source_is_proposed_before_another_source(tmp_path: Path) -> None:
    (tmp_path / "plants.py").write_text(PLANT)
    file = tmp_path / "graph.yaml"
    blocks = "  p: {use: plants:Plant}\n  other: {use: blocks.SineWave}\n"
    file.write_text(f"rate: 1\nblocks:\n{blocks}  g: {{use: blocks.Gain, in: {{u: p.state}}}}\n")
    (problem,) = check(file).problems
    assert problem.message == "p.state does not carry value"
    assert problem.nearest == ("p.state.position", "p.state.velocity")
    assert problem.fix == "u: p.state.position"
    file.write_text(file.read_text().replace("p.state}", "p.state.position}"))
    assert check(file).ok
