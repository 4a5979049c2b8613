"""An output and an input with one field each fit, whatever the fields are called, one number or a vector of one."""

from pathlib import Path

import numpy as np
import pytest

from aloft import LoadError, load

BLOCKS = """
from aloft import Block, Field, Input, Output, Signal, kernel


class Angle(Signal):
    angle = Field(unit="rad", text="one number")


class Rate(Signal):
    w = Field(1, unit="rad/s", text="a vector of one")


class Decay(Block):
    \"\"\"The rate -angle.\"\"\"

    a = Input(Angle, text="the angle")
    w = Output(Rate, text="the rate")

    @kernel
    @staticmethod
    def step(a: Angle, w: Rate) -> None:
        w.w[0] = -a.angle
"""
GRAPH = """
rate: 100 Hz
duration: 1 s
blocks:
  decay: {use: "decay:Decay", in: {a: place.y}}
  place: {use: blocks.Integrator, with: {initial: 1}, in: {u: decay.w}}
  late: {use: blocks.Gain, in: {u: {from: decay.w, delay: 1}}}
"""


@pytest.fixture
def graph(tmp_path: Path) -> Path:
    (tmp_path / "decay.py").write_text(BLOCKS)
    (tmp_path / "graph.yaml").write_text(GRAPH)
    return tmp_path / "graph.yaml"


def test_numbers_and_vectors_of_one_are_wired_by_their_port(graph: Path) -> None:
    result = load(graph).run()
    place, late = result.signal("place.y.value")[:, 0], result.signal("late.y.value")[:, 0]
    assert np.allclose(place, 0.99 ** np.arange(100), rtol=1e-12, atol=0.0)
    assert late[0] == 0.0 and np.array_equal(late[1:], -place[:-1])


def test_it_is_what_selecting_the_field_gives(graph: Path) -> None:
    by_port = load(graph).run()
    graph.write_text(
        GRAPH.replace("u: decay.w}", "u: decay.w.w}").replace("a: place.y", "a: place.y.value[0]")
    )
    selected = load(graph).run()
    assert np.array_equal(by_port.signal("place.y.value"), selected.signal("place.y.value"))


def test_another_unit_and_more_numbers_are_refused_as_before(graph: Path) -> None:
    graph.write_text(GRAPH.replace("with: {initial: 1}", "with: {initial: 1, n: 2}"))
    with pytest.raises(LoadError, match=r"fix +a: place.y.value\[0\]"):
        load(graph)
    graph.write_text(GRAPH.replace("a: place.y", "a: decay.w"))
    with pytest.raises(LoadError, match=r"decay.w does not carry angle"):
        load(graph)
