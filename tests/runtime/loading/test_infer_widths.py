"""Widths follow from wires: ``n`` need not be said, and a contradiction names both ends."""

from pathlib import Path
from typing import Any

import pytest

from aloft.runtime.graph import Graph
from aloft.runtime.loading import LoadError, checked_text

HEAD = """\
rate: 100 Hz
duration: 0.05 s
blocks:
  c: {use: blocks.Constant, with: {value: [1, 2, 3]}}
  two: {use: blocks.Constant, with: {value: [4, 5]}}
"""


def graph_of(blocks: str) -> Graph:
    return Graph(checked_text(HEAD + blocks, Path("graph.yaml")))


def width(blocks: str, path: str = "b", name: str = "n") -> int:
    return graph_of(blocks).checked.block(path).dimensions[name]


@pytest.mark.parametrize(
    ("blocks", "expected"),
    [
        ("  b: {use: blocks.Gain, in: {u: c.y}}", 3),
        ("  b: {use: blocks.Gain, in: {u: c.y.value}}", 3),
        ("  b: {use: blocks.Gain, in: {u: 'c.y.value[1:3]'}}", 2),
        ("  b: {use: blocks.Gain, in: {u: ['c.y.value[0]', 7, two.y.value]}}", 4),
        ("  b: {use: blocks.Gain, in: {u: {from: c.y, delay: 2}}}", 3),
        ("  b: {use: blocks.Gain, in: {u: [1, 2]}}", 2),
        ("  b: {use: blocks.Compare, in: {a: c.y, b: 1.5}}", 3),
        ("  b: {use: blocks.PID, in: {setpoint: 0, measured: c.y}}", 3),
        ("  b: {use: blocks.Delay, with: {samples: 2}, in: {u: c.y}}", 3),
        ("  b: {use: blocks.Gain, in: {u: a.y}}\n  a: {use: blocks.Compare, in: {a: c.y, b: 0}}", None),
        ("  b: {use: blocks.Demux, with: {n_a: 1, n_b: 2}, in: {u: c.y}}", 3),
    ],
)  # fmt: skip
def test_a_width_is_that_of_the_wire(blocks: str, expected: int | None) -> None:
    if expected is None:  # flags are no numbers, but their width goes on
        with pytest.raises(LoadError, match="another element type") as caught:
            graph_of(blocks)
        assert "shape" not in {problem.code.value for problem in caught.value.report.problems}
        return
    assert width(blocks) == expected


def test_several_widths_of_one_block() -> None:
    mux = "  b: {use: blocks.Mux, in: {a: c.y, b: two.y}}"
    assert [width(mux, name=name) for name in ("n_a", "n_b")] == [3, 2]


def test_rings_have_the_width_that_enters_them() -> None:
    ring = """\
  loop: {use: blocks.Gain, with: {gain: 1 1/s}, in: {u: {from: sum.y, delay: 1}}}
  sum: {use: blocks.Sum, in: {a: x.y, b: c.y}}
  x: {use: blocks.Integrator, in: {u: loop.y}}
"""
    graph = graph_of(ring)
    assert {graph.checked.block(name).dimensions["n"] for name in ("loop", "sum", "x")} == {3}
    assert "n: 3" in graph.checked.text and graph.run().success
    closed = """\
  loop: {use: blocks.Gain, with: {gain: 1 1/s}, in: {u: {from: x.y, delay: 1}}}
  x: {use: blocks.Integrator, with: {initial: [1, 2]}, in: {u: loop.y}}
"""
    assert width(closed, "loop") == width(closed, "x") == 2
    assert width(closed.replace("[1, 2]", "1"), "loop") == 1


def test_widths_of_the_robot_go_on() -> None:
    text = """\
rate: 500 Hz
robot: bruce
blocks:
  robot: {use: hal.MujocoRobot, in: {command: {mode: ACTIVE, torque: pd.y.value, position: 0, velocity: 0, stiffness: 0,
    damping: 0}}}
  pd: {use: blocks.Gain, with: {gain: -3 N m/rad}, in: {u: {from: robot.joints.position, delay: 1}}}
  knees: {use: blocks.Gain, in: {u: 'robot.joints.position[*_knee]'}}
"""
    graph = Graph(checked_text(text, Path("graph.yaml")))
    assert graph.checked.block("pd").dimensions["n"] == 10
    assert graph.checked.block("knees").dimensions["n"] == 2


def test_a_long_chain_written_backwards_is_no_trouble() -> None:
    many = 3000
    lines = [f"  b{k}: {{use: blocks.Gain, in: {{u: b{k + 1}.y}}}}\n" for k in range(many)]
    graph = graph_of("".join(lines) + f"  b{many}: {{use: blocks.Gain, in: {{u: c.y}}}}\n")
    assert graph.checked.block("b0").dimensions["n"] == 3


@pytest.mark.parametrize(
    ("blocks", "expected", "other"),
    [
        ("  b: {use: blocks.Sum, in: {a: c.y, b: two.y}}", "[n] = [3], as b.a from c.y", "two.y"),
        ("  b: {use: blocks.Sum, with: {n: 3}, in: {a: c.y, b: two.y}}", "[n] = [3]", "two.y"),
        ("  b: {use: blocks.Gain, with: {gain: [1, 2]}, in: {u: c.y}}", "[n] = [2]", "c.y"),
    ],
)
def test_a_contradiction_names_both_ends(blocks: str, expected: str, other: str) -> None:
    with pytest.raises(LoadError) as caught:
        graph_of(blocks)
    (found,) = caught.value.report.problems
    details: Any = found
    assert (details.code.value, details.expected, details.other) == ("shape", expected, other)
