"""``aloft sensitivity`` on the command line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.needed import needs

needs("SALib")

GRAPH = """
rate: 100 Hz
duration: 0.1 s
blocks:
  counter: {use: "counter:Scaled", with: {seed: 5, slope: 2.0, other: 3.0, unused: 4.0}}
"""
SCALED = '''

class Scaled(Counter):
    """Its metric is a function of its parameters."""

    class Params(Counter.Params):
        slope: float = parameter(1.0, le=2.2, text="a factor")
        other: float = parameter(1.0, text="a factor")
        unused: float = parameter(1.0, text="nothing")
        nothing: float = parameter(0.0, text="zero")

    def metrics(self) -> dict[str, float | bool | str]:
        return {"product": self.params.slope * self.params.other, "success": True, "reason": ""}
'''


@pytest.fixture
def ranked(folder: Path) -> Path:
    with (folder / "counter.py").open("a") as file:
        file.write(SCALED)
    (folder / "scaled.yaml").write_text(GRAPH)
    (folder / "study.yaml").write_text("graph: scaled.yaml\nseeds: 1000\n")
    return folder / "study.yaml"


@pytest.mark.long
def test_parameters_are_ranked_and_drawn(
    ranked: Path, call_json: Callable[..., dict[str, Any]]
) -> None:
    asked = ("sensitivity", "study.yaml", "product", "--workers", "1", "--spread", "0.1")
    told = call_json(*asked, "--sobol", "2", "--samples", "32")
    effects = {each["key"]: each for each in told["effects"]}
    # d(slope other) over the whole of either range: 2 * 0.1 * 2.0 * 3.0 about the middle
    for key in ("counter.slope", "counter.other"):
        assert effects[key]["mean_size"] == pytest.approx(1.2, rel=0.12)
        assert effects[key]["first"] == pytest.approx(0.5, abs=0.2)
    assert "counter.unused" in told["without_effect"]
    assert "counter.nothing" in told["not_varied"]
    assert (ranked.parent / told["plots"]["png"]).read_bytes()[:4] == b"\x89PNG"
    assert "counter.slope" in (ranked.parent / told["plots"]["svg"]).read_text()
    again = call_json(*asked)
    assert again["effects"][0]["mean_size"] == told["effects"][0]["mean_size"]


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        (["products"], "there is product"),
        (["product", "--samples", "33"], "--samples 33 is no power of two"),
        (["product", "--vary", "counter.slope"], "fewer than two numeric parameters"),
    ],
)  # fmt: skip
def test_wrong_questions(
    ranked: Path, call: Callable[..., Any], asked: list[str], text: str
) -> None:
    done = call("sensitivity", "study.yaml", *asked, "--workers", "1", code=2)
    assert text in " ".join(done.stderr.split())
