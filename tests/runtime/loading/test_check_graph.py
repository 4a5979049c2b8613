"""The checked graph: rates, durations, dimensions, delays, constants, order."""

from pathlib import Path
from typing import Any

import pytest

from aloft.files.problems import Position
from aloft.runtime.graph import Graph
from aloft.runtime.language.stages import CheckedGraph, ClockSpec
from aloft.runtime.loading import LoadError, check, checked_file, checked_text

PATH = Path("graph.yaml")


def graph_of(blocks: str, head: str = "rate: 100 Hz") -> CheckedGraph:
    return checked_text(f"{head}\nblocks:\n{blocks}", PATH)


def problems_of(blocks: str, head: str = "rate: 100 Hz") -> list[str]:
    with pytest.raises(LoadError) as caught:
        graph_of(blocks, head)
    return [f"{p.code}: {p.message}" for p in caught.value.report.problems]


CONSTANT = "  one: {use: blocks.Constant, with: {value: [1.0, 2.0]}}\n"


@pytest.mark.parametrize(
    ("rate", "hertz"),
    [("500 Hz", 500.0), ("500", 500.0), ("1 kHz", 1000.0), ("1e3", 1000.0), ("2.5", 2.5)],
)
def test_rate(rate: str, hertz: float) -> None:
    assert graph_of(CONSTANT, f"rate: {rate}").base_rate == hertz


@pytest.mark.parametrize(
    ("duration", "ticks"),
    [("4 s", 400), ("250 ms", 25), ("0.29", 29), ("1e-9", 1), ("2 min", 12000)],
)
def test_duration_in_ticks(duration: str, ticks: int) -> None:
    assert graph_of(CONSTANT, f"rate: 100\nduration: {duration}").ticks == ticks


def test_a_graph_without_a_duration_runs_until_stopped() -> None:
    assert graph_of(CONSTANT).ticks is None


def test_clock() -> None:
    assert graph_of(CONSTANT).clock == ClockSpec()
    head = "rate: 1\nclock: {kind: paced, overrun: stop, stop_after: 3}"
    assert graph_of(CONSTANT, head).clock == ClockSpec("paced", "stop", 3)


@pytest.mark.parametrize("value", ["0", "-1", "true", "1.5", "three", "[1]"])
def test_overruns_in_a_row_are_a_whole_number_from_one(value: str) -> None:
    (problem,) = problems_of(CONSTANT, f"rate: 1\nclock: {{stop_after: {value}}}")
    assert problem.startswith("bad-value: clock.stop_after cannot be")
    assert graph_of(CONSTANT, "rate: 1\nclock: {stop_after: 1}").clock.stop_after == 1


@pytest.mark.parametrize(
    ("rate", "offset", "period"), [("100", 0, 1), ("50 Hz", 1, 2), ("33.3333333333 Hz", 2, 3)]
)
def test_block_rates(rate: str, offset: int, period: int) -> None:
    graph = graph_of(
        f"  one: {{use: blocks.Constant, with: {{value: [1]}}, rate: {rate}, offset: {offset}}}"
    )
    assert (graph.block("one").period_ticks, graph.block("one").offset_ticks) == (period, offset)


def test_dimensions_of_robot_graph_and_block() -> None:
    graph = graph_of(
        "  one: {use: blocks.Gain, with: {n: 3}, in: {u: two.y}}\n"
        "  two: {use: blocks.Constant, with: {value: [1, 2, 3]}}\n",
        "rate: 1\nrobot: bruce\ndimensions: {n: 7, m: 5}",
    )
    assert graph.robot is not None and graph.robot.name == "bruce"
    sizes = graph.block("one").dimensions
    assert (sizes["n"], sizes["m"], sizes["n_joints"]) == (3, 5, 10)


SIZED = """\
from aloft import Block, Field, Output, Signal


class Sized(Signal):
    value = Field("m")


class Source(Block):
    y = Output(Sized)

    def step(self):
        self.y.value[:] = 1.0
"""


def test_the_fix_for_a_missing_dimension_is_a_key_of_the_graph(tmp_path: Path) -> None:
    (tmp_path / "sized.py").write_text(SIZED)
    path = tmp_path / "graph.yaml"
    path.write_text("rate: 1\nblocks:\n  one: {use: sized:Source}\n")
    (problem,) = check(path).problems
    assert problem.message == "one (sized:Source) needs the dimension 'm', which nothing gives"
    assert problem.fix == "for the whole graph, beside 'blocks': dimensions: {m: 3}"
    path.write_text(f"{problem.fix.partition(': ')[2]}\n{path.read_text()}")
    assert checked_file(path).block("one").dimensions["m"] == 3


def test_a_robot_from_a_file_beside_the_graph(tmp_path: Path) -> None:
    shipped = Path(__file__).parents[3] / "robots" / "bruce" / "bruce.yaml"
    (tmp_path / "mine.yaml").write_text(shipped.read_text().replace("name: bruce", "name: mine", 1))
    (tmp_path / "graph.yaml").write_text(f"rate: 1\nrobot: mine.yaml\nblocks:\n{CONSTANT}")
    graph = checked_file(tmp_path / "graph.yaml")
    assert graph.robot is not None and graph.robot.name == "mine"


@pytest.mark.parametrize("text", ["links: 3", "- 1", "[", "\x00"])
def test_a_broken_robot_is_a_problem(tmp_path: Path, text: str) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    (tmp_path / "graph.yaml").write_text(f"rate: 1\nrobot: mine.yaml\nblocks:\n{CONSTANT}")
    problems = check(tmp_path / "graph.yaml").problems
    assert problems
    for problem in problems:
        assert problem.code == "robot"
        assert problem.where.file == str(tmp_path / "mine.yaml")
        assert problem.other_where is not None and problem.other_where.line == 2


def test_a_delayed_wire_becomes_a_block_of_its_own() -> None:
    graph = graph_of(
        "  one: {use: blocks.SineWave, with: {n: 2}, rate: 50 Hz, offset: 1}\n"
        "  gain:\n"
        "    use: blocks.Gain\n"
        "    with: {n: 2}\n"
        "    in: {u: {from: one.y, delay: 3, initial: {value: [4, 5]}}}\n"
    )
    assert [block.path for block in graph.blocks] == ["one", "gain/u~delay", "gain"]
    delay = graph.block("gain/u~delay")
    assert delay.block_type.is_moore()
    assert delay.wires["u"].source == "one.y"
    assert (delay.period_ticks, delay.offset_ticks) == (2, 1)
    assert delay.params.initial == {"value": [4, 5]}  # type: ignore[attr-defined]
    wire = graph.block("gain").wires["u"]
    assert (wire.source, wire.delay, wire.initial) == ("gain/u~delay.y", 3, {"value": [4, 5]})
    assert wire.where == Position("graph.yaml", 7, 20)


def test_a_ring_with_a_delay_runs() -> None:
    graph = graph_of(
        "  step: {use: blocks.Constant, with: {value: [1.0]}}\n"
        "  sum: {use: blocks.Sum, in: {a: step.y, b: {from: sum.y, delay: 1}}}\n",
        "rate: 10\nduration: 0.5",
    )
    values = Graph(graph).run().signal("sum.y.value")
    assert values[:, 0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_constant_in_place_of_a_source_with_units(tmp_path: Path) -> None:
    (tmp_path / "heights.py").write_text(
        "from aloft.runtime.language.block import Block, Input, Output\n"
        "from aloft.runtime.language.signals import Field, Signal\n"
        "class Height(Signal):\n"
        "    height = Field(unit='m')\n"
        "    others = Field(2, unit='m')\n"
        "class Relay(Block):\n"
        "    u = Input(Height)\n"
        "    y = Output(Height)\n"
        "    def step(self):\n"
        "        self.y.height[...] = self.u.height\n"
        "        self.y.others[...] = self.u.others\n"
    )
    (tmp_path / "graph.yaml").write_text(
        "rate: 1\nduration: 1\nblocks:\n"
        "  a: {use: heights:Relay, in: {u: {value: {height: 12 cm}}}}\n"
        "  b: {use: heights:Relay, in: {u: {value: {others: [1 mm, 2]}}}}\n"
    )
    result = Graph(checked_file(tmp_path / "graph.yaml")).run()
    assert result.signal("a.y.height")[0] == 0.12
    assert result.signal("a.y.others")[0].tolist() == [0.0, 0.0]
    assert result.signal("b.y.others")[0].tolist() == [0.001, 2.0]


def test_order_is_the_schedules() -> None:
    graph = graph_of(
        "  last: {use: blocks.Gain, with: {n: 2}, in: {u: middle.y}}\n"
        "  middle: {use: blocks.Gain, with: {n: 2}, in: {u: one.y}}\n" + CONSTANT
    )
    assert graph.order == ("one", "middle", "last")


def test_text_numbers_and_truth_words() -> None:
    graph = graph_of("  s: {use: blocks.SineWave, with: {frequency: 1e-3, phase: 180 deg}}")
    params: Any = graph.block("s").params
    assert params.frequency == 0.001
    assert params.phase == pytest.approx(3.14159265358979)


def test_follow_ups_of_one_mistake_are_left_out() -> None:
    # no such block: nothing more about its ports, parameters or readers
    blocks = "  one: {use: runtime.Nothing, with: {a: 1}, in: {b: two.c}}\n"
    blocks += "  gain: {use: blocks.Gain, in: {u: one.y}}\n"
    assert problems_of(blocks) == ["unknown-block: there is no block called 'runtime.Nothing'"]
    # no robot: nothing about the dimensions it would have given
    blocks = "  j: {use: blocks.JointPD}\n"
    codes = [p.partition(":")[0] for p in problems_of(blocks, "rate: 1\nrobot: brute")]
    assert codes[0] == "robot" and "dimension" not in codes


def test_bad_parameters_do_not_hide_bad_wires() -> None:
    found = problems_of("  gain: {use: blocks.Gain, with: {n: 0}, in: {u: gain.x}}")
    assert [p.partition(":")[0] for p in found] == ["bad-parameter", "unknown-source"]


def test_a_crash_in_a_users_own_check_is_a_problem(tmp_path: Path) -> None:
    (tmp_path / "crashes.py").write_text(
        "from aloft.runtime.language.block import Block, Output\n"
        "from aloft.runtime.language.parameters import Parameters\n"
        "from aloft.blocks.general.vectors import Vector\n"
        "from pydantic import model_validator\n"
        "class Validator(Block):\n"
        "    class Params(Parameters):\n"
        "        n: int = 1\n"
        "        @model_validator(mode='after')\n"
        "        def check(self):\n"
        "            return {}['key']\n"
        "    y = Output(Vector)\n"
        "    def step(self): pass\n"
        "class Dimensions(Block):\n"
        "    y = Output(Vector)\n"
        "    def step(self): pass\n"
        "    @classmethod\n"
        "    def dimensions(cls, params, robot):\n"
        "        return {'n': robot.legs}\n"
    )
    (tmp_path / "graph.yaml").write_text(
        "rate: 1\nblocks:\n  a: {use: crashes:Validator}\n  b: {use: crashes:Dimensions}\n"
    )
    found = [
        f"{p.where.line} {p.code}: {p.message}" for p in check(tmp_path / "graph.yaml").problems
    ]
    assert found == [
        "3 block-declaration: checking the parameters of a failed: KeyError: 'key'",
        "4 dimension: the dimensions of b cannot be told: AttributeError: 'NoneType' object "
        + "has no attribute 'legs'",
    ]


def test_a_missing_file_and_a_folder_are_problems(tmp_path: Path) -> None:
    assert [p.code for p in check(tmp_path / "nowhere.yaml").problems] == ["file"]
    assert [p.code for p in check(tmp_path).problems] == ["file"]
    (tmp_path / "latin.yaml").write_bytes(b"rate: \xe9")
    assert "not UTF-8" in check(tmp_path / "latin.yaml").problems[0].message


def test_the_fix_of_a_rate_is_a_fraction_where_decimals_are_endless() -> None:
    block = "  one: {{use: blocks.Constant, with: {{value: [1.0]}}, rate: {}}}\n"
    with pytest.raises(LoadError) as caught:
        graph_of(block.format("34 Hz"))
    (problem,) = caught.value.report.problems
    assert problem.fix == "rate: 100/3 Hz"
    assert problem.nearest == ("100/3 Hz", "50 Hz"), "the nearest comes first"
    assert graph_of(block.format("100/3 Hz")).blocks[0].period_ticks == 3


def test_one_source_is_not_proposed_twice() -> None:
    wave = "  {}: {{use: blocks.SineWave}}\n"
    total = "  total: {use: blocks.Sum, in: {a: first.y}}\n"
    with pytest.raises(LoadError) as caught:
        graph_of(wave.format("first") + wave.format("second") + total)
    (problem,) = caught.value.report.problems
    assert problem.fix == "in: {b: second.y}"
    with pytest.raises(LoadError) as caught:
        graph_of(wave.format("first") + "  total: {use: blocks.Sum}\n")
    fixes = [problem.fix for problem in caught.value.report.problems]
    assert fixes == ["in: {a: first.y}", "in: {b: block.port}"]
    with pytest.raises(LoadError) as caught:
        graph_of(wave.format("first") + total)
    assert caught.value.report.problems[0].fix == "in: {b: block.port}"


def test_the_offset_of_a_use_shifts_faster_blocks_within_it(tmp_path: Path) -> None:
    inner = """
outputs: {y: fast.y}
blocks:
  slow: {use: blocks.SineWave}
  fast: {use: blocks.SineWave, rate: 50 Hz}
"""
    (tmp_path / "part.yaml").write_text(inner)
    use = "rate: 100 Hz\nblocks:\n  part: {use: part.yaml, rate: 10 Hz, offset: OFFSET}\n"
    graph = checked_text(use.replace("OFFSET", "5"), tmp_path / "graph.yaml")
    times = {spec.path: (spec.period_ticks, spec.offset_ticks) for spec in graph.blocks}
    assert times == {"part/slow": (10, 5), "part/fast": (2, 1)}
    again = checked_text(graph.text, tmp_path / "again.yaml")
    assert {s.path: (s.period_ticks, s.offset_ticks) for s in again.blocks} == times
    with pytest.raises(LoadError, match="part/slow runs every 10 ticks"):
        checked_text(use.replace("OFFSET", "10"), tmp_path / "graph.yaml")
    with pytest.raises(LoadError, match="offset"):
        checked_text(use.replace("OFFSET", "-1"), tmp_path / "graph.yaml")


def test_an_input_is_not_proposed_the_source_that_another_one_has(tmp_path: Path) -> None:
    path = tmp_path / "graph.yaml"
    path.write_text(
        "rate: 100 Hz\nblocks:\n"
        "  ref: {use: blocks.Step, with: {after: [1]}}\n"
        "  other: {use: blocks.Constant, with: {value: [1]}}\n"
        "  both: {use: blocks.Sum, in: {a: ref.y}}\n"
    )
    (problem,) = check(path).problems
    assert problem.message == "input 'b' of both is not wired"
    assert (problem.nearest, problem.fix) == (("other.y",), "in: {b: other.y}")
