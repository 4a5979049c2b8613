"""The unit that every general block gives what it computes: by the physics of its equation.

Each output is wired to an input in kg, whose load report says what unit arrives.
"""

from pathlib import Path

import pytest

from aloft.blocks.general.sources import Constant
from aloft.runtime.loading import check
from aloft.runtime.testing import BlockBench

PARTS = """\
from aloft import Block, Field, Input, Output, Parameters, Signal, parameter

class Length(Signal):
    value = Field("n", unit="m", text="a length")

class Time(Signal):
    value = Field("n", unit="s", text="a time")

class Mass(Signal):
    value = Field("n", unit="kg", text="a mass")

class Sized(Parameters):
    n: int = parameter(1, text="elements")

class Sensor(Block):
    Params = Sized
    m = Output(Length, text="a length")
    s = Output(Time, text="a time")
    def step(self): ...

class Reader(Block):
    Params = Sized
    kg = Input(Mass, text="a mass")
    def step(self): ...
"""
CASES = [
    ("Gain", "gain: 2", "u: s.m", "y", "m"),
    ("Gain", "gain: 2, unit: N/m", "u: s.m", "y", "N"),
    ("Sum", "", "a: s.m, b: s.m", "y", "m"),
    ("Product", "", "a: s.m, b: s.s", "y", "m s"),
    ("Product", "operation: divide", "a: s.m, b: s.s", "y", "m/s"),
    ("Integrator", "", "u: s.m", "y", "m s"),
    ("DoubleIntegrator", "", "u: s.m", "y", "m s^2"),
    ("DoubleIntegrator", "", "u: s.m", "rate", "m s"),
    ("TrapezoidalIntegrator", "", "u: s.m", "y", "m s"),
    ("FilteredDerivative", "time_constant: 0.1", "u: s.m", "y", "m/s"),
    ("LowPass", "cutoff: 5", "u: s.m", "y", "m"),
    ("HighPass", "cutoff: 5", "u: s.m", "y", "m"),
    ("BandStop", "centre: 5, width: 1", "u: s.m", "y", "m"),
    ("MovingAverage", "samples: 3", "u: s.m", "y", "m"),
    ("Saturation", "", "u: s.m", "y", "m"),
    ("DeadZone", "lower: -1, upper: 1", "u: s.m", "y", "m"),
    ("Backlash", "width: 0.1", "u: s.m", "y", "m"),
    ("Quantiser", "interval: 0.1", "u: s.m", "y", "m"),
    ("RateLimiter", "rising: 1, falling: -1", "u: s.m", "y", "m"),
    ("UnitDelay", "", "u: s.m", "y", "m"),
    ("Delay", "samples: 2", "u: s.m", "y", "m"),
    ("ZeroOrderHold", "", "u: s.m", "y", "m"),
    ("PID", "kp: 1", "setpoint: s.m, measured: s.m", "u", "m"),
    ("PID", "kp: 1, unit: N/m", "setpoint: s.m, measured: s.m", "u", "N"),
    ("MatrixGain", "matrix: [[1.0]], unit: 1/s", "u: s.m", "y", "m/s"),
    ("Expression", "expression: a * b, units: {}", "a: s.m, b: s.s", "y", "m s"),
    ("Expression", "expression: a / b", "a: s.m, b: s.s", "y", "m/s"),
    ("Expression", "expression: a + a", "a: s.m", "y", "m"),
    ("Constant", "value: [1.0], unit: N m", "", "y", "N m"),
    ("Ramp", "slope: 1, unit: rad", "", "y", "rad"),
    ("SineWave", "frequency: 1, unit: rad", "", "y", "rad"),
    ("Expression", "expression: abs(a)", "a: s.m", "y", "m"),
    ("Expression", "expression: a ** 2", "a: s.m", "y", "m^2"),
    ("Expression", "expression: 1 / a", "a: s.m", "y", "1/m"),
    ("Expression", "expression: -round(a)", "a: s.m", "y", "m"),
]


@pytest.mark.parametrize(("block", "params", "inputs", "output", "unit"), CASES)
def test_the_unit_of_an_output(
    tmp_path: Path, block: str, params: str, inputs: str, output: str, unit: str
) -> None:
    (tmp_path / "parts.py").write_text(PARTS)
    (tmp_path / "graph.yaml").write_text(
        "rate: 100 Hz\nblocks:\n  s: {use: parts:Sensor}\n"
        f"  b: {{use: blocks.{block}, with: {{{params}}}, in: {{{inputs}}}}}\n"
        f"  r: {{use: parts:Reader, in: {{kg: b.{output}}}}}\n"
    )
    problems = list(check(tmp_path / "graph.yaml").problems)
    text = "\n".join(problem.text() for problem in problems)
    assert [(p.code, p.at, p.expected) for p in problems] == [("unit", "r.kg", "kg")], text
    assert problems[0].found == unit, text


def test_numbers_may_be_written_in_other_units_of_the_same_dimension() -> None:
    for params, values in (
        ({"value": ["3 m", "20 cm"]}, [3.0, 0.2]),
        ({"value": ["20 cm", "3 m"]}, [20.0, 300.0]),
        ({"value": ["3 m", "20 cm"], "unit": "mm"}, [3000.0, 200.0]),
        ({"value": ["3 m", 7.0], "unit": "mm"}, [3000.0, 7.0]),
        ({"value": [3.0, 7.0], "unit": "mm"}, [3.0, 7.0]),
    ):
        bench = BlockBench(Constant, params)
        bench.step()
        assert bench.get("y").value.tolist() == pytest.approx(values)
