"""Units and frames through the general blocks: what arrives, what is refused, and what is said."""

from pathlib import Path

import pytest

from aloft.files.problems import Problem
from aloft.runtime.language.block import Block
from aloft.runtime.language.registry import all_blocks
from aloft.runtime.loading import LoadError, check, checked_file, checked_text

SENSOR = """\
from aloft import Block, Field, Input, Output, Parameters, Signal, parameter
from aloft.blocks.general.vectors import Vector

class Millimetres(Signal):
    value = Field("n", unit="mm", frame="body", text="a position")

class Metres(Signal):
    value = Field("n", unit="m", frame="body", text="a position")

class World(Signal):
    value = Field("n", unit="m", frame="world", text="a position")

class Unsaid(Signal):
    value = Field("n", text="a number")

class Sized(Parameters):
    n: int = parameter(1, text="elements")

class Sensor(Block):
    Params = Sized
    mm = Output(Millimetres, text="in mm, body")
    m = Output(Metres, text="in m, body")
    w = Output(World, text="in m, world")
    unsaid = Output(Unsaid, text="no unit")
    def step(self): ...

class Reader(Block):
    Params = Sized
    m = Input(Metres, text="in m, body", default={"value": 0.0})
    w = Input(World, text="in m, world", default={"value": 0.0})
    def step(self): ...

class Silent(Block):
    Params = Sized
    u = Input(Vector, text="any")
    y = Output(Vector, text="any")
    def step(self): ...
"""


def problems_of(tmp_path: Path, blocks: str) -> list[Problem]:
    (tmp_path / "parts.py").write_text(SENSOR)
    head = "rate: 100 Hz\nblocks:\n  s: {use: parts:Sensor}\n"
    (tmp_path / "graph.yaml").write_text(head + blocks)
    return list(check(tmp_path / "graph.yaml").problems)


def one(tmp_path: Path, blocks: str) -> Problem:
    found = problems_of(tmp_path, blocks)
    assert len(found) == 1, "\n".join(p.text() for p in found)
    return found[0]


def test_units_and_frames_pass_through_a_gain(tmp_path: Path) -> None:
    blocks = "  g: {use: blocks.Gain, in: {u: s.mm}}\n  r: {use: parts:Reader, in: {m: g.y}}\n"
    problem = one(tmp_path, blocks)
    assert problem.code == "unit"
    assert problem.message == "r.m does not fit g.y: field 'value' has another scale"
    assert (problem.expected, problem.found) == ("m", "mm")
    assert problem.fix.endswith("1 mm is 0.001 m; blocks.Gain with {gain: 0.001, unit: m/mm}")


def test_a_constant_has_its_own_unit_where_a_block_takes_any(tmp_path: Path) -> None:
    written = "  g: {use: blocks.Gain, in: {u: {value: %s}}}\n"
    read = "  r: {use: parts:Reader, in: {m: g.y}}\n"
    problem = one(tmp_path, written % "[3 mm]" + read)
    assert (problem.code, problem.expected, problem.found) == ("unit", "m", "mm")
    assert not problems_of(tmp_path, written % "[3 m]" + read)
    assert one(tmp_path, written % "[3.0]" + read).code == "unit"  # a plain number has no unit


def test_a_constant_of_a_declared_field_has_the_fields_unit(tmp_path: Path) -> None:
    assert not problems_of(tmp_path, "  r: {use: parts:Reader, in: {m: {value: [3 mm]}}}\n")
    assert not problems_of(tmp_path, "  r: {use: parts:Reader, in: {m: {value: [3.0]}}}\n")


def test_the_fix_of_another_scale_is_one(tmp_path: Path) -> None:
    blocks = (
        "  g: {use: blocks.Gain, with: {gain: 0.001, unit: m/mm}, in: {u: s.mm}}\n"
        "  r: {use: parts:Reader, in: {m: g.y}}\n"
    )
    assert not problems_of(tmp_path, blocks)


def test_a_frame_arrives_behind_a_chain_written_backwards(tmp_path: Path) -> None:
    blocks = (
        "  r: {use: parts:Reader, in: {w: c.y}}\n"
        "  c: {use: blocks.Saturation, in: {u: b.y}}\n"
        "  b: {use: blocks.LowPass, with: {cutoff: 5}, in: {u: a.y}}\n"
        "  a: {use: blocks.UnitDelay, in: {u: s.m}}\n"
    )
    problem = one(tmp_path, blocks)
    assert (problem.code, problem.at) == ("frame", "r.w")
    assert (problem.expected, problem.found) == ("world", "body")


def test_a_sum_wants_one_quantity(tmp_path: Path) -> None:
    problem = one(tmp_path, "  e: {use: blocks.Sum, in: {a: s.m, b: s.mm}}\n")
    assert problem.message == "e.b is in mm in body: a and b must be the same quantity"
    assert (problem.other, problem.expected) == ("e.a", "m in body")
    assert problem.fix == "blocks.Gain with {gain: 0.001, unit: m/mm} between"
    problem = one(tmp_path, "  e: {use: blocks.Sum, in: {a: s.m, b: s.w}}\n")
    assert (problem.code, problem.expected, problem.found) == ("frame", "m in body", "m in world")


def test_a_plain_number_is_no_length_and_the_fix_says_so(tmp_path: Path) -> None:
    blocks = (
        "  c: {use: blocks.Constant, with: {value: [1.0]}}\n"
        "  r: {use: parts:Reader, in: {m: c.y}}\n"
    )
    problem = one(tmp_path, blocks)
    assert (problem.expected, problem.found) == ("m", "1")
    assert problem.fix == "say what its numbers are: with: {unit: m}"
    assert not problems_of(tmp_path, blocks.replace("[1.0]", "[1.0], unit: m"))
    assert not problems_of(tmp_path, blocks.replace("[1.0]", "[1.0 m]"))
    assert not problems_of(tmp_path, blocks.replace("[1.0]", "[1.0], unit: unchecked"))


def test_numbers_with_units_are_converted_to_the_first_one() -> None:
    text = "rate: 1\nblocks:\n  c: {use: blocks.Constant, with: {value: [1 m, 20 cm]}}\n"
    spec = checked_text(text, Path("g.yaml")).block("c")
    assert spec.params.value == [1.0, 0.2]  # type: ignore[attr-defined]
    assert str(spec.quantities["y.value"]) == "m"


def test_constants_on_wires_have_units(tmp_path: Path) -> None:
    sums = "  e: {use: blocks.Sum, in: {a: s.mm, b: {value: {value: %s}}}}\n"
    assert not problems_of(tmp_path, sums % "20 mm")
    assert not problems_of(tmp_path, sums % "0")  # zero is zero in every unit
    assert one(tmp_path, sums % "2 cm").found == "cm"
    assert one(tmp_path, sums % "20").found == "plain numbers"


def test_a_ring_has_the_units_that_enter_it(tmp_path: Path) -> None:
    ring = (
        "  e: {use: blocks.Sum, with: {weights: [1, -1]}, in: {a: s.m, b: x.y}}\n"
        "  k: {use: blocks.Gain, with: {gain: 4 %s}, in: {u: e.y}}\n"
        "  x: {use: blocks.Integrator, in: {u: k.y}}\n"
    )
    assert not problems_of(tmp_path, ring % "1/s")
    problem = one(tmp_path, ring % "")
    assert problem.message == "e.b is in m s in body: a and b must be the same quantity"


def test_a_ring_that_nothing_enters_must_not_contradict_itself(tmp_path: Path) -> None:
    ring = (
        "  k: {use: blocks.Gain, with: {gain: -1 %s}, in: {u: x.y}}\n"
        "  x: {use: blocks.Integrator, in: {u: k.y}}\n"
    )
    assert not problems_of(tmp_path, ring % "1/s")
    problem = one(tmp_path, ring % "")
    assert "is in a ring of blocks that makes" in problem.message
    assert problem.fix == "a gain with unit: 1/s in the ring"


@pytest.mark.parametrize(
    ("blocks", "unit"),
    [
        ("y: {use: blocks.Integrator, in: {u: s.m}}", "m s in body"),
        ("y: {use: blocks.TrapezoidalIntegrator, in: {u: s.m}}", "m s in body"),
        ("y: {use: blocks.FilteredDerivative, in: {u: s.m}}", "m/s in body"),
        ("y: {use: blocks.Product, in: {a: s.m, b: s.mm}}", "m mm in body"),
        (
            "y: {use: blocks.Product, with: {operation: divide}, in: {a: s.m, b: s.m}}",
            "1 in body",
        ),
        ("y: {use: blocks.Expression, with: {expression: a ** 2}, in: {a: s.m}}", "m^2 in body"),
        ("y: {use: blocks.Gain, with: {gain: 60 N/m}, in: {u: s.m}}", "N in body"),
        ("y: {use: blocks.MatrixGain, with: {matrix: [[2 N/m]]}, in: {u: s.m}}", "N"),
        (
            "y: {use: blocks.LookupTable, with: {points: [0, 1], values: [0, 2 N]}, in: {u: s.m}}",
            "N",
        ),
        ("y: {use: blocks.Expression, with: {expression: a / t}, in: {a: s.m}}", "m/s in body"),
        ("y: {use: parts:Silent, in: {u: s.m}}", "a unit that is not checked"),
        ("y: {use: blocks.Switch, in: {condition: {value: {}}, a: s.m, b: s.m}}", "m in body"),
    ],
)
def test_what_blocks_make_of_units(tmp_path: Path, blocks: str, unit: str) -> None:
    (tmp_path / "parts.py").write_text(SENSOR)
    text = f"rate: 1\nblocks:\n  s: {{use: parts:Sensor}}\n  {blocks}\n"
    graph = checked_text(text, tmp_path / "graph.yaml")
    assert str(graph.block("y").quantities["y.value"]) == unit


def test_mistakes_in_formulas(tmp_path: Path) -> None:
    for formula, mistake in (
        ("sin(a)", "sin takes rad, not m"),
        ("sqrt(a)", "the square root of m has no unit"),
        ("a + t", "a is in m and t in s"),
    ):
        block = (
            f"  y: {{use: blocks.Expression, with: {{expression: {formula}}}, in: {{a: s.m}}}}\n"
        )
        assert one(tmp_path, block).message == f"y.a is in m in body: in '{formula}' {mistake}"


def test_vectors_are_turned_from_the_frame_they_are_in(tmp_path: Path) -> None:
    blocks = (
        "  s3: {use: parts:Sensor, with: {n: 3}}\n"
        "  t: {use: blocks.RotateVector, in: {rotation: {value: {value: [0, 0, 0, 1]}}, u: s3.%s}}\n"
        "  r: {use: parts:Reader, with: {n: 3}, in: {w: t.y}}\n"
    )
    assert not problems_of(tmp_path, blocks % "m")
    assert "the block turns vectors from body" in one(tmp_path, blocks % "w").message


def test_a_unit_that_is_not_checked_is_said(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(SENSOR)
    text = (
        "rate: 1\nblocks:\n  s: {use: parts:Sensor}\n  u: {use: parts:Silent, in: {u: s.mm}}\n"
        "  r: {use: parts:Reader, in: {m: u.y, w: s.unsaid}}\n"
    )
    graph = checked_text(text, tmp_path / "graph.yaml")
    assert graph.unchecked == (
        "u.y does not say its unit, and r.m reads value in m",
        "s.unsaid does not say its unit, and r.w reads value in m",
    )


@pytest.mark.parametrize("name", ["jump", "hops", "robots/go2_jump"])
def test_shipped_graphs_leave_no_unit_unchecked(name: str) -> None:
    assert checked_file(f"aloft:{name}").unchecked == ()


def test_every_shipped_block_says_what_it_carries() -> None:
    for name, block in all_blocks().items():
        carries = any(f.inferred for o in block.outputs.values() for f in o.signal.fields.values())
        assert not carries or block.infer_units.__func__ is not Block.infer_units.__func__, name


@pytest.mark.parametrize(
    ("value", "found", "fix"),
    [("3 A", "A", ""), ("20 degC", "K", ""), ("3", "1", "say what its numbers are")],
)
def test_a_source_that_says_its_unit_is_not_asked_for_it(value: str, found: str, fix: str) -> None:
    text = f"""
rate: 100 Hz
blocks:
  c: {{use: blocks.Constant, with: {{value: [{value}, 0, 0]}}}}
  e: {{use: blocks.EulerToQuaternion, in: {{u: c.y}}}}
"""
    with pytest.raises(LoadError) as caught:
        checked_text(text, Path("graph.yaml"))
    (problem,) = caught.value.report.problems
    assert (problem.expected, problem.found) == ("rad", found)
    assert problem.fix.startswith(fix) if fix else "say what" not in problem.fix


def test_a_plain_source_beside_a_measurement_is_asked_for_its_unit() -> None:
    text = """
rate: 100 Hz
blocks:
  target: {use: blocks.SineWave}
  angle: {use: blocks.SineWave, with: {unit: rad}}
  pid: {use: blocks.PID, in: {setpoint: target.y, measured: angle.y}}
"""
    with pytest.raises(LoadError) as caught:
        checked_text(text, Path("graph.yaml"))
    (problem,) = caught.value.report.problems
    assert (problem.expected, problem.found) == ("plain numbers", "rad")
    assert problem.fix == "say what target's numbers are: with: {unit: rad}"
    checked_text(text.replace("SineWave}", "SineWave, with: {unit: rad}}"), Path("graph.yaml"))


UNLIKE = """\
  v: {use: blocks.Constant, with: {value: [3 V]}}
  w: {use: blocks.Constant, with: {value: [1 rad/s]}}
  i: {use: blocks.Constant, with: {value: [2 A]}}
  m: {use: blocks.Mux, in: {a: v.y, b: w.y}}
  d: {use: blocks.Demux, with: {n_a: 1, n_b: 1}, in: {u: m.y}}
  s2: {use: blocks.Selector, with: {elements: [1, 1]}, in: {u: m.y}}
"""
SYSTEM = "time: continuous, a: [[-1, 0], [0, -2]], b: [[1, 0], [0, 1]], c: [[1, 0], [0, 1]]"


@pytest.mark.parametrize(
    ("blocks", "expected", "found"),
    [
        ("  e: {use: blocks.Sum, in: {a: m.y, b: {value: {value: [1 V, 2 V]}}}}\n", "[V, rad/s]", "V"),
        ("  e: {use: blocks.Sum, in: {a: m.y, b: [v.y, i.y]}}\n", "[V, rad/s]", "[V, A]"),
        ("  e: {use: blocks.Sum, in: {a: d.b, b: v.y}}\n", "rad/s", "V"),
        ("  e: {use: blocks.Sum, in: {a: s2.y, b: [w.y, i.y]}}\n", "rad/s", "[rad/s, A]"),
        ("  e: {use: blocks.Sum, in: {a: 'm.y.value[1]', b: v.y}}\n", "rad/s", "V"),
        ("  e: {use: blocks.Sum, in: {a: ['m.y.value[1]', v.y], b: [w.y, i.y]}}\n", "[rad/s, V]", "[rad/s, A]"),
        ("  g: {use: blocks.Integrator, in: {u: m.y}}\n  e: {use: blocks.Sum, in: {a: g.y, b: m.y}}\n",
         "[V s, rad]", "[V, rad/s]"),
        (("  p: {use: blocks.Product, in: {a: m.y, b: [i.y, i.y]}}\n"
         "  e: {use: blocks.Sum, in: {a: p.y, b: m.y}}\n"), "[V A, rad A/s]", "[V, rad/s]"),
        (f"  x: {{use: blocks.StateSpace, with: {{{SYSTEM}, input_units: [V, A]}}, in: {{u: m.y}}}}\n",
         "[V, A]", "[V, rad/s]"),
        ((f"  x: {{use: blocks.StateSpace, with: {{{SYSTEM}, input_units: [V, rad/s], output_units: [A, rad]}},"
         " in: {u: m.y}}\n  e: {use: blocks.Sum, in: {a: 'x.y.value[0]', b: v.y}}\n"), "A", "V"),
        (("  x: {use: blocks.TransferFunction, with: {numerator: [1], denominator: [1, 1], input_units: V,"
         " output_units: rad/s}, in: {u: i.y}}\n"), "V", "A"),
        (("  x: {use: blocks.TransferFunction, with: {numerator: [1], denominator: [1, 1], input_units: V,"
         " output_units: rad/s}, in: {u: v.y}}\n  e: {use: blocks.Sum, in: {a: x.y, b: v.y}}\n"), "rad/s", "V"),
        (("  x: {use: blocks.MatrixGain, with: {matrix: [[1, 2]], input_units: [V, rad/s], output_units: A},"
         " in: {u: m.y}}\n  e: {use: blocks.Sum, in: {a: x.y, b: v.y}}\n"), "A", "V"),
        (("  x: {use: blocks.Expression, with: {expression: 2 * a}, in: {a: m.y}}\n"
         "  e: {use: blocks.Sum, in: {a: 'x.y.value[1]', b: v.y}}\n"), "rad/s", "V"),
    ],
)  # fmt: skip
def test_elements_with_unlike_units_keep_their_own(
    tmp_path: Path, blocks: str, expected: str, found: str
) -> None:
    problem = one(tmp_path, UNLIKE + blocks)
    assert (problem.code, problem.expected, problem.found) == ("unit", expected, found)


@pytest.mark.parametrize("use", ["StateSpace", "MatrixGain"])
def test_unlike_units_in_one_vector_are_questioned_until_it_is_said(
    tmp_path: Path, use: str
) -> None:
    head = "rate: 100 Hz\nblocks:\n" + UNLIKE
    given = SYSTEM if use == "StateSpace" else "matrix: [[1, 2]]"
    block = "  x: {{use: blocks.{}, with: {{{}}}, in: {{u: m.y}}}}\n"
    asked = checked_text(head + block.format(use, given), tmp_path / "graph.yaml").unchecked
    said = "input_units: [V, rad/s]"
    assert asked == (f"x.u joins [V, rad/s] in one vector: if that is meant, say so: {said}",)
    answered = block.format(use, f"{given}, {said}")
    assert checked_text(head + answered, tmp_path / "graph.yaml").unchecked == ()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("input_units: [V, V, V]", "input_units has 3 units for 2 elements"),
        ("output_units: [V]", "output_units has 1 units for 2 elements"),
        ("unit: V, output_units: V", "unit and output_units both say what the outputs are"),
        ("input_units: furlong", "furlong"),
    ],
)
def test_units_of_elements_that_do_not_fit(tmp_path: Path, given: str, message: str) -> None:
    block = f"  x: {{use: blocks.StateSpace, with: {{{SYSTEM}, {given}}}, in: {{u: [v.y, v.y]}}}}\n"
    assert message in one(tmp_path, UNLIKE + block).message


def test_a_rotation_mixes_elements(tmp_path: Path) -> None:
    blocks = """\
  q: {use: blocks.Constant, with: {value: [0, 0, 0, 1]}}
  r: {use: blocks.RotateVector, in: {rotation: q.y, u: [v.y, w.y, i.y]}}
"""
    assert "a rotation mixes its elements" in one(tmp_path, UNLIKE + blocks).message


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("Saturation, with: {upper: 5}", "upper is 5"),
        ("Saturation, with: {upper: [5, 10]}", ""),
        ("Saturation, with: {lower: 0}", ""),
        ("UnitDelay", ""),
        ("UnitDelay, with: {initial: 2}", "initial is 2"),
        ("Integrator, with: {lower: -1}", "lower is -1"),
        ("RateLimiter, with: {rising: [1, 2], falling: 3}", "falling is 3"),
        ("Assertion, with: {upper: 9}", "upper is 9"),
    ],
)
def test_one_number_for_unlike_units_is_questioned(tmp_path: Path, block: str, said: str) -> None:
    text = f"rate: 100 Hz\nblocks:\n{UNLIKE}  x: {{use: blocks.{block}, in: {{u: m.y}}}}\n"
    fix = "for all; give a list with one number for each element"
    expected = (f"x.u joins [V, rad/s] in one vector: {said} {fix}",) if said else ()
    assert checked_text(text, tmp_path / "graph.yaml").unchecked == expected
