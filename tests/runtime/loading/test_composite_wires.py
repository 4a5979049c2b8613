"""Wires that select, rename and join: what they carry, how they are shown, and every mistake."""

from pathlib import Path
from typing import Any

import pytest

from aloft.files.problems import Problem
from aloft.runtime.graph import Graph
from aloft.runtime.loading import LoadError, checked_text

PARTS = """\
from aloft import Block, Field, Input, Output, Parameters, Signal, parameter

class State(Signal):
    position = Field(3, unit="m", frame="world", text="where")
    angle = Field((), unit="rad", text="how far")
    grid = Field((2, 3), unit="", text="numbers")
    on = Field((), dtype="bool", text="whether")

class Plant(Block):
    y = Output(State, text="the state")
    secret = Output(State, truth=True, text="the same, known to a simulator")
    def step(self):
        self.y.position[:] = [1.0, 2.0, 3.0]
        self.y.angle[...] = 0.5
        self.y.grid[:] = [[1, 2, 3], [4, 5, 6]]
        self.y.on[...] = True
        self.secret.position[:] = 7.0

class Pair(Signal):
    value = Field((), unit="m", text="a length")
    angle = Field((), unit="rad", text="an angle")

class Two(Block):
    u = Input(Pair, text="both")
    y = Output(Pair, text="both")
    def step(self):
        self.y.value[...] = self.u.value
        self.y.angle[...] = self.u.angle
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "parts.py").write_text(PARTS)
    return tmp_path


def graph_of(folder: Path, blocks: str) -> Graph:
    head = "rate: 100 Hz\nduration: 0.05 s\nblocks:\n  p: {use: parts:Plant}\n"
    return Graph(checked_text(head + blocks, folder / "graph.yaml"))


def problem_of(folder: Path, blocks: str) -> Problem:
    with pytest.raises(LoadError) as caught:
        graph_of(folder, blocks)
    found = caught.value.report.problems
    assert len(found) == 1, caught.value.report.text()
    return found[0]


def last(folder: Path, wire: str, n: int = 1) -> Any:
    graph = graph_of(
        folder, f"  g:\n    use: blocks.Gain\n    with: {{n: {n}}}\n    in:\n      u: {wire}"
    )
    return graph.run(log=True).signal("g.y.value")[-1].tolist()


@pytest.mark.parametrize(
    ("wire", "values"),
    [
        ("p.y.position", [1.0, 2.0, 3.0]),
        ("p.y.position[1]", [2.0]),
        ("p.y.position[::-1]", [3.0, 2.0, 1.0]),
        ("{value: p.y.position[0:2]}", [1.0, 2.0]),
        ("p.y.angle", [0.5]),
        ("p.y.grid[1]", [4.0, 5.0, 6.0]),
        ("p.y.grid[1, 2]", [6.0]),
        ("[p.y.angle, p.y.position[2]]", [0.5, 3.0]),
        ("[p.y.position[2], 4 m, p.y.position[0:2]]", [3.0, 4.0, 1.0, 2.0]),
        ("{value: [p.y.grid[0], p.y.grid[1]]}", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        ("{from: p.y.position[1], delay: 1}", [2.0]),
        ("3.5", [3.5]),
        ("[1, 2 , 3]", [1.0, 2.0, 3.0]),
        ("25 mm", [25.0]),
        ("{value: 2}", [2.0]),
    ],
)
def test_what_arrives(folder: Path, wire: str, values: list[float]) -> None:
    assert last(folder, wire, len(values)) == values


def test_a_delay_comes_behind_the_selection_and_its_initial_value_is_the_readers(
    folder: Path,
) -> None:
    wire = "{from: p.y.position[1], delay: 2, initial: {value: 300 cm}}"
    graph = graph_of(folder, f"  g: {{use: blocks.Gain, in: {{u: {wire}}}}}\n")
    assert graph.run(log=True).signal("g.y.value")[:, 0].tolist() == [300.0, 300.0, 2.0, 2.0, 2.0]
    graph = graph_of(
        folder,
        "  two:\n    use: parts:Two\n    in:\n      u:\n        from: {value: p.y.position[1], "
        "angle: p.y.angle}\n        delay: 1\n        initial: {value: 300 cm}\n",
    )
    assert graph.run(log=True).signal("two.y.value").tolist() == [3.0, 2.0, 2.0, 2.0, 2.0]


def test_every_field_has_a_source_of_its_own(folder: Path) -> None:
    wire = "{value: p.y.position[2], angle: p.y.angle}"
    graph = graph_of(folder, f"  two: {{use: parts:Two, in: {{u: {wire}}}}}\n")
    result = graph.run(log=True)
    assert result.signal("two.y.value")[-1] == 3.0
    assert result.signal("two.y.angle")[-1] == 0.5


def test_the_flattened_graph_says_it_as_it_was_meant_and_loads_again(folder: Path) -> None:
    blocks = (
        "  two: {use: parts:Two, in: {u: {value: p.y.position[2], angle: 30 deg}}}\n"
        "  g: {use: blocks.Gain, with: {n: 2}, in: {u: [p.y.grid[0, 1], 0]}}\n"
    )
    first = graph_of(folder, blocks)
    assert 'in: {u: {value: "p.y.position[2]", angle: 30 deg}}' in first.checked.text
    assert 'in: {u: ["p.y.grid[0, 1]", 0]}' in first.checked.text
    again = Graph(checked_text(first.checked.text, folder / "graph.yaml"))
    assert again.checked.text == first.checked.text
    assert again.run().run_hash == first.run().run_hash


def test_units_and_frames_are_those_of_the_parts(folder: Path) -> None:
    graph = graph_of(folder, "  g: {use: blocks.Gain, in: {u: p.y.position[0]}}\n").checked
    assert str(graph.block("g").quantities["y.value"]) == "m in world"
    mixed = "  g: {use: blocks.Gain, with: {n: 2}, in: {u: [p.y.angle, p.y.position[0]]}}\n"
    found = graph_of(folder, mixed).checked.block("g").quantities["y.value"]
    assert found.unit is None


def test_through_sub_graphs(folder: Path) -> None:
    (folder / "inner.yaml").write_text(
        "inputs: {state: required}\n"
        "outputs: {first: g.y.value[0], both: [g.y.value[1], g.y.value[0]]}\n"
        "blocks:\n  g: {use: blocks.Gain, with: {n: 2}, in: {u: inputs.state.position[0:2]}}\n"
    )
    graph = graph_of(
        folder,
        "  s: {use: inner.yaml, in: {state: p.y}}\n"
        "  a: {use: blocks.Gain, in: {u: s.first}}\n"
        "  b: {use: blocks.Gain, with: {n: 2}, in: {u: s.both}}\n"
        "  c: {use: blocks.Gain, with: {n: 3}, in: {u: [s.first, s.both]}}\n",
    )
    result = graph.run(log=True)
    assert result.signal("a.y.value")[-1].tolist() == [1.0]
    assert result.signal("b.y.value")[-1].tolist() == [2.0, 1.0]
    assert result.signal("c.y.value")[-1].tolist() == [1.0, 2.0, 1.0]


def test_a_selection_of_truth_needs_leave(folder: Path) -> None:
    blocks = "  g: {use: blocks.Gain, with: {n: 3}, in: {u: p.secret.position}}\n"
    problem = problem_of(folder, blocks)
    assert problem.code == "truth"
    assert problem.fix.endswith("u: {from: p.secret.position, allow: truth}")
    allowed = "{from: p.secret.position, allow: truth}"
    assert last(folder, allowed, 3) == [7.0, 7.0, 7.0]


@pytest.mark.parametrize(
    ("wire", "message", "fix"),
    [
        ("p.y.positon", "p.y has no field 'positon'", "u: p.y.position"),
        ("p.y[0]", "p.y has several fields, and none is selected", "u: p.y.position[0]"),
        ("pp.y.position", "g.u reads pp.y, but there is no block 'pp'", "u: p.y.position"),
        ("p.z.position", "p (parts:Plant) has no output 'z'", ""),
        (
            "p.y.position[7]",
            "p.y.position[7]: [7] is outside of 3 elements, which count from 0",
            "",
        ),
        ("p.y.on", "g.u does not fit p.y.on: field 'value' has another element type", ""),
        ("[p.y.on, p.y.angle]", "p.y.on is bool and p.y.angle is float64", ""),
        ("{valu: p.y.angle}", "Vector has no field 'valu'", "value: p.y.angle"),
        ("{other: p.y.angle}", "Vector has no field 'other'", ""),
        ("{from: 3, delay: 1}", "the wire to g.u delays a constant", "remove 'delay'"),
    ],
)
def test_mistakes(folder: Path, wire: str, message: str, fix: str) -> None:
    blocks = f"  g: {{use: blocks.Gain, in: {{u: {wire}}}}}\n"
    problem = problem_of(folder, blocks)
    assert problem.message == message
    assert problem.where.file.endswith("graph.yaml") and problem.where.line == 5
    assert problem.fix == fix or not fix
    assert "~" not in problem.text()


def test_an_input_with_several_fields_needs_a_source_for_each(folder: Path) -> None:
    problem = problem_of(folder, "  two: {use: parts:Two, in: {u: p.y.angle}}\n")
    assert problem.message == "two.u has several fields, and one source is given for it"
    assert problem.fix == "u: {value: p.y.angle, ...}"
    problem = problem_of(folder, "  two: {use: parts:Two, in: {u: {angle: p.y.angle}}}\n")
    assert problem.message == "two.u is given no value"


def test_parts_must_be_what_the_reader_says(folder: Path) -> None:
    wire = "{value: p.y.angle, angle: p.y.angle}"
    problem = problem_of(folder, f"  two: {{use: parts:Two, in: {{u: {wire}}}}}\n")
    assert problem.message == "p.y.angle is in rad: the reader's value is m"
    assert problem.at == "two.u"


def test_a_loop_through_a_selection_is_named_without_inserted_blocks(folder: Path) -> None:
    problem = problem_of(
        folder,
        "  a: {use: blocks.Gain, in: {u: b.y.value[0]}}\n  b: {use: blocks.Gain, in: {u: a.y}}\n",
    )
    assert problem.code == "loop"
    assert "~" not in problem.text()
    assert "delay: 1}" in problem.fix
    graph_of(
        folder,
        "  a: {use: blocks.Gain, in: {u: {from: b.y.value[0], delay: 1}}}\n"
        "  b: {use: blocks.Gain, in: {u: a.y}}\n",
    )


def test_a_slower_reader_samples_and_a_faster_one_holds(folder: Path) -> None:
    graph = graph_of(
        folder,
        "  r: {use: blocks.Ramp, rate: 50 Hz}\n  g: {use: blocks.Gain, in: {u: r.y.value[0]}}\n",
    )
    assert graph.run(log=True).signal("g.y.value")[:, 0].tolist() == [0.0, 0.0, 0.02, 0.02, 0.04]


def test_comments_and_quotes_keep_their_brackets(folder: Path) -> None:
    blocks = (
        "  g:  # reads p.y.position[0], not [1]\n"
        "    use: blocks.Gain\n"
        "    in: {u: 'p.y.position[ 0 ]'}  # a.b[1]\n"
    )
    assert graph_of(folder, blocks).run(log=True).signal("g.y.value")[-1].tolist() == [1.0]


COMMAND = """\
rate: 500 Hz
duration: 10 ms
robot: bruce
blocks:
  robot: {{use: hal.MujocoRobot, with: {{seed: 0}}, in: {{command: {{mode: {mode}, torque: {torque}, position: {position},
    velocity: 0, stiffness: {stiffness}, damping: 1.5}}}}}}
  tau: {{use: blocks.Constant, with: {{n: 1, value: {ten}, unit: N m}}}}
"""
TEN = [0.1 * k for k in range(10)]


def commanded(tmp_path: Path, **given: object) -> Any:
    text = {"mode": "ACTIVE", "torque": "tau.y.value", "position": 0.1, "stiffness": 60, "ten": TEN}
    written = COMMAND.format(**{**text, **given}).replace("n: 1, ", "")
    with Graph(checked_text(written, tmp_path / "g.yaml")).open() as run:
        run.step()
        return run.block("robot").command


@pytest.mark.parametrize(
    ("given", "mode", "torque", "position", "stiffness"),
    [
        ({}, 1, TEN, [0.1] * 10, [60.0] * 10),
        ({"mode": 2, "torque": 0}, 2, [0.0] * 10, [0.1] * 10, [60.0] * 10),
        ({"mode": "damping", "position": TEN}, 2, TEN, TEN, [60.0] * 10),
        ({"stiffness": "600 N cm/rad", "torque": TEN}, 1, TEN, [0.1] * 10, [6.0] * 10),
    ],
)
def test_fields_may_be_constants_beside_wired_ones_or_alone(
    tmp_path: Path, given: dict[str, Any], mode: int, torque: Any, position: Any, stiffness: Any
) -> None:
    found = commanded(tmp_path, **given)
    assert int(found.mode) == mode
    assert found.torque.tolist() == pytest.approx(torque)
    assert found.position.tolist() == pytest.approx(position)
    assert found.stiffness.tolist() == pytest.approx(stiffness)
    assert found.damping.tolist() == [1.5] * 10


@pytest.mark.parametrize(
    ("given", "message", "expected"),
    [
        ({"mode": "ACTVE"}, "mode cannot be ACTVE", "OFF, ACTIVE, DAMPING, or a whole number"),
        (
            {"stiffness": "tau"},
            "stiffness cannot be tau",
            "a source, block.port.field, or a number",
        ),
        (
            {"position": [1, 2]},
            "position cannot be [1, 2]",
            "a finite number in rad, or a list of shape [10]",
        ),
        ({"position": [1, 2], "torque": 0}, "position cannot be [1, 2]", "of shape [10]"),
    ],
)
def test_constants_that_do_not_fit(
    tmp_path: Path, given: dict[str, Any], message: str, expected: str
) -> None:
    with pytest.raises(LoadError) as caught:
        commanded(tmp_path, **given)
    (found,) = caught.value.report.problems
    assert found.message == f"robot.command: {message}" and expected in found.expected
