"""``aloft trim`` on the command line."""

from pathlib import Path

import pytest
from tests.cli.conftest import run_for_json, run_here

GRAPH = """
rate: 1 kHz
blocks:
  f: {use: blocks.Constant, with: {value: [0.0]}}
  a: {use: blocks.Expression, with: {expression: "a - k * b", constants: {k: 50}, units: {k: 1/s}}, in: {a: f.y, b: x.y}}
  x: {use: blocks.Integrator, in: {u: a.y}}
"""


@pytest.fixture
def spring(tmp_path: Path) -> str:
    (tmp_path / "spring.yaml").write_text(GRAPH)
    return str(tmp_path / "spring.yaml")


def test_an_operating_point_as_json(spring: str) -> None:
    told = run_for_json("trim", spring, "--free", "f.y", "--free", "x.x.*", "--hold", "x.y == 0.1")
    assert told["success"] is True
    assert told["values"]["f.y.value[0]"] == pytest.approx(5.0)
    assert told["settings"] == {"f.value": [pytest.approx(5.0)]}
    assert {each["name"] for each in told["conditions"]} == {"x.x.value[0]", "x.y.value[0]"}


def test_what_cannot_hold_is_named_and_exits_with_1(spring: str) -> None:
    asked = ("--free", "f.y=0:4", "--free", "x.x.value", "--hold", "x.y == 0.1")
    out = run_here("trim", spring, *asked, code=1).stdout
    assert "conditions cannot hold: x.y.value[0] == 0.1 s" in " ".join(out.split())
    assert "at a bound: f.y.value[0]" in " ".join(out.split())


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--free", "f.z"], "there is no signal 'f.z'"),
        (["--free", "x.x.value", "--tolerance", "0"], "the tolerance is 0; it must be above 0"),
    ],
)
def test_wrong_questions(spring: str, arguments: list[str], text: str) -> None:
    assert text in run_here("trim", spring, *arguments, code=2).stderr
