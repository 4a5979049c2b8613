"""A file that is no graph is recognised, and what it is for is named."""

from pathlib import Path

import pytest

from aloft.runtime.loading import check

ROOT = Path(__file__).parents[3]
PART = "inputs: {u: a signal}\noutputs: {y: gain.y}\nblocks:\n  gain: {use: blocks.Gain}\n"


@pytest.mark.parametrize(
    ("file", "kind", "fix"),
    [
        ("graphs/studies/controller.yaml", "a study", "aloft study {}"),
        ("graphs/studies/paper.yaml", "a study", "aloft study {}"),
        ("graphs/tasks/in_situ.yaml", "a task of the jump planner", "aloft plan {}"),
        ("graphs/tasks/go2_in_situ_10cm.yaml", "a task of the jump planner", "aloft plan {}"),
        ("robots/bruce/bruce.yaml", "a robot's description", "in a graph: robot: {}"),
        ("robots/go2/go2.yaml", "a robot's description", "in a graph: robot: {}"),
    ],
)
def test_shipped_files_that_are_no_graphs(file: str, kind: str, fix: str) -> None:
    path = ROOT / file
    (problem,) = check(path).problems
    assert problem.message == f"{path} is {kind}, not a graph that can be run"
    assert problem.fix == fix.format(path)


def test_a_sub_graph(tmp_path: Path) -> None:
    path = tmp_path / "part.yaml"
    path.write_text(PART)
    (problem,) = check(path).problems
    assert "is a sub-graph, a part of a graph" in problem.message
    assert problem.fix == f"in a graph: blocks: {{part: {{use: {path}}}}}"


def test_a_graph_with_a_key_too_many_is_a_graph(tmp_path: Path) -> None:
    path = tmp_path / "graph.yaml"
    path.write_text(f"rate: 100 Hz\n{PART}")
    assert any(
        "'inputs' belongs to the file of a sub-graph" in p.message for p in check(path).problems
    )
