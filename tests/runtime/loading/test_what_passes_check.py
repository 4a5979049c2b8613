"""A graph that passes the check is set up, or one clear error says which block could not be.

Graphs and robots that ship are changed at random; nothing but ``LoadError`` and ``RunError`` may come
of it.
"""

import copy
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from aloft.runtime.language.errors import RunError
from aloft.runtime.loading import LoadError, checked_file
from aloft.runtime.running.memory import BoundGraph

from ...cli.conftest import run_here

ROOT = Path(__file__).parents[3]
VALUES: tuple[Any, ...] = (
    0, -1, 1, 1e-9, 1e-300, 1e9, 1e300, 10**30, "text", "", [], [1], [1, 2, 3], {}, {"a": 1}, True,
    None, float("nan"), float("inf"), "1 m",
)  # fmt: skip
STAND = """\
rate: 500 Hz
robot: mine.yaml
blocks:
  robot: {use: hal.MujocoRobot, in: {command: safety.command}}
  contacts: {use: blocks.ContactDetector, in: {switches: robot.contacts}}
  estimator:
    use: blocks.StateEstimator
    in: {imu: robot.imu, joints: robot.joints, contacts: contacts.state}
  dynamics: {use: blocks.Dynamics, in: {base: estimator.base, joints: robot.joints}}
  stand: {use: blocks.StandReference}
  safety:
    use: blocks.SafetyMonitor
    in: {desired: {value: {}}, base: estimator.base, joints: robot.joints, wbc: {value: {}}}
"""
BROKEN = """\
from aloft import Block, Field, Output, Parameters, Signal, State, parameter
class Number(Signal):
    value = Field("n", text="a number")
class Broken(Block):
    class Params(Parameters):
        n: int = parameter(1, text="how many")
        fail_in: str = parameter("setup", text="where")
    params: Params
    y = Output(Number, text="a number")
    x = State(Number, text="a number")
    @classmethod
    def state_dimensions(cls, params, robot):
        return {"n": 1 // (params.fail_in != "sizes"), **({"n": 10**12} if params.fail_in == "huge" else {})}
    def setup(self):
        if self.params.fail_in == "setup":
            [1, 2][5]
    def step(self): ...
"""


def outcome(path: Path, overrides: dict[str, Any] | None = None) -> str:
    """Load and set up a graph; anything but the two errors is not caught."""
    try:
        graph = checked_file(path, overrides or {})
    except LoadError as error:
        assert error.report.problems
        return "report"
    try:
        BoundGraph(graph)
    except RunError as error:
        assert error.block in {spec.path for spec in graph.blocks}
        assert "\n" not in str(error)
        return "error"
    return "bound"


JUMP = ROOT / "graphs" / "jump.yaml"


@pytest.fixture(scope="module")
def names() -> list[str]:
    """All parameters of a shipped graph but one: another task may have to be solved."""
    parameters = [
        f"{spec.path}.{name}"
        for spec in checked_file(JUMP).blocks
        for name in type(spec.params).model_fields
    ]
    return [each for each in parameters if each != "plan.task"]


@pytest.mark.parametrize("seed", range(12))
def test_parameters_of_a_shipped_graph(names: list[str], seed: int) -> None:
    rng = random.Random(seed)
    overrides = {rng.choice(names): rng.choice(VALUES) for _ in range(rng.randint(1, 2))}
    assert outcome(JUMP, overrides) in ("report", "error", "bound")


def _places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if path:
        yield path
    items: Any = ()
    if isinstance(node, (dict, list)):
        items = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in items:
        yield from _places(value, (*path, key))


@pytest.mark.parametrize("seed", range(12))
def test_descriptions_of_a_shipped_robot(seed: int, tmp_path: Path) -> None:
    data = yaml.safe_load((ROOT / "robots" / "bruce" / "bruce.yaml").read_text())
    rng = random.Random(seed)
    *way, last = rng.choice(list(_places(data)))
    node = data
    for key in way:
        node = node[key]
    match rng.choice(["delete", "set", "scale", "copy"]):
        case "delete":
            del node[last]
        case "scale" if isinstance(node[last], float):
            node[last] *= rng.choice([-1.0, 0.0, 1e-6, 1e6, 100.0])
        case "copy" if isinstance(node, list):
            node.append(copy.deepcopy(node[last]))
        case _:
            node[last] = rng.choice(VALUES)
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    (tmp_path / "graph.yaml").write_text(STAND)
    assert outcome(tmp_path / "graph.yaml") in ("report", "error", "bound")


@pytest.mark.parametrize(
    ("fail_in", "words"),
    [
        (
            "setup",
            "graph.yaml:3:3: block 'one' failed in setup: IndexError: list index out of range",
        ),
        ("sizes", "graph.yaml:3:3: block 'one' failed in state_dimensions: ZeroDivisionError: "),
        ("huge", "the states of the graph need 8e+03 GB of memory; the largest is one.x.value"),
    ],
)
def test_a_block_that_fails_ends_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fail_in: str, words: str
) -> None:
    (tmp_path / "broken_block.py").write_text(BROKEN)
    (tmp_path / "graph.yaml").write_text(
        f"rate: 100 Hz\nblocks:\n  one: {{use: broken_block:Broken, with: {{fail_in: {fail_in}}}}}\n"
    )
    monkeypatch.chdir(tmp_path)
    code = (
        2 if fail_in in ("setup", "sizes") else 3
    )  # before anything moves it is a mistake of the graph
    done = run_here("run", "graph.yaml", "--no-record", code=code)
    assert words in done.stderr and "Traceback" not in done.stderr
    assert done.stderr.count("\n") == 1
    if fail_in == "setup":
        assert f"(at {tmp_path / 'broken_block.py'}:16)" in done.stderr
