"""A file that is no graph is recognised, and what it is for is named."""

from pathlib import Path

import pytest

from aloft.robots.description import path_of
from aloft.runtime.loading import check
from aloft.runtime.loading.reading.files import addresses_like, graph_path

ROOT = Path(__file__).parents[3]
PART = "inputs: {u: a signal}\noutputs: {y: gain.y}\nblocks:\n  gain: {use: blocks.Gain}\n"


@pytest.mark.parametrize(
    ("file", "kind", "fix"),
    [
        ("graphs/studies/formulations.yaml", "a study", "aloft study {}"),
        ("graphs/studies/paper.yaml", "a study", "aloft study {}"),
        ("graphs/tasks/in_situ.yaml", "a task of the jump planner", "aloft plan {}"),
        ("graphs/tasks/go2_in_situ_10cm.yaml", "a task of the jump planner", "aloft plan {}"),
        ("robots/bruce/bruce.yaml", "a robot's description", "in a graph: robot: {}"),
        ("robots/go2/go2.yaml", "a robot's description", "in a graph: robot: {}"),
        (
            "graphs/hardware/bruce.yaml",
            "a robot's hardware",
            "in a graph: robot: {{use: hal.BearRobot, with: {{hardware: {}}}}}",
        ),
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


@pytest.mark.parametrize(
    ("file", "missing"),
    [
        ("graphs/controllers/bruce_gains.yaml", "joint_pd, weight, safety, switches, landing"),
        ("graphs/controllers/whole_body.yaml", "robot, plan"),
        ("graphs/trials/standard.yaml", "robot"),
    ],
)
def test_shipped_parts_that_graphs_include(file: str, missing: str) -> None:
    path = ROOT / file
    (problem,) = check(path).problems
    assert problem.message == (f"{path} is a part that graphs include, not a graph that can be run")
    assert f"blocks that are not here: {missing}" in problem.found
    assert problem.fix == f"in a graph with such blocks: include: {path}"


def test_a_graph_without_its_rate_and_with_one_wrong_name_is_a_graph(tmp_path: Path) -> None:
    path = tmp_path / "graph.yaml"
    path.write_text(
        "blocks:\n  wave: {use: blocks.SineWave}\n  twice: {use: blocks.Gain, in: {u: wav.y}}\n"
    )
    messages = [problem.message for problem in check(path).problems]
    assert "the graph does not say its rate" in messages
    assert any("there is no block 'wav'" in message for message in messages)


def test_a_file_that_changes_a_graph_it_includes_is_a_graph(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text("rate: 10 Hz\nblocks: {wave: {use: blocks.SineWave}}\n")
    path = tmp_path / "changed.yaml"
    path.write_text("include: base.yaml\nset: {wave.amplitude: 2, wove.amplitude: 3}\n")
    (problem,) = check(path).problems
    assert problem.message == "'wove.amplitude': there is no block 'wove'"


def test_a_graph_with_a_key_too_many_is_a_graph(tmp_path: Path) -> None:
    path = tmp_path / "graph.yaml"
    path.write_text(f"rate: 100 Hz\n{PART}")
    assert any(
        "'inputs' belongs to the file of a sub-graph" in p.message for p in check(path).problems
    )


def test_addresses_like_a_missing_file_are_its_own_or_the_nearest() -> None:
    for name in ("jump.yaml", "graphs/jump.yaml", "graphs/jump", "aloft:jump"):
        assert addresses_like(Path(name)) == ("aloft:jump",)
    assert "aloft:jump" in addresses_like(Path("jmup.yaml"))
    assert addresses_like(Path("nothing_of_the_kind_at_all.yaml")) == ()


def test_shipped_files_are_included_by_their_address_from_any_folder(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("include: [aloft:jump, aloft:trials/robust]\nset: {robot.seed: 3}\n")
    report = check(path)
    assert report.ok, report.text()
    for wrong, near in (
        ("jump.yaml", "aloft:jump"),
        ("aloft:trials/robost", "aloft:trials/robust"),
    ):
        path.write_text(f"include: {wrong}\n")
        (problem,) = check(path).problems
        assert problem.fix == near


def test_an_address_leads_to_no_file_outside_of_the_shipped_graphs() -> None:
    assert graph_path("aloft:jump.yaml") == graph_path("aloft:jump")
    assert not graph_path("aloft:../tests/cli/count").is_file()
    assert graph_path("a.yaml", Path("b")) == Path("b/a.yaml")


def test_a_task_beside_the_loaded_graph_may_name_the_robot_by_its_file(tmp_path: Path) -> None:
    """As a user's own robot is: the graph includes a shipped one, which lies in another folder."""
    text = path_of("bruce").read_text().replace("name: bruce\n", "name: mine\n", 1)
    (tmp_path / "mine.yaml").write_text(text)
    (tmp_path / "hop.yaml").write_text("robot: mine.yaml\nrise: 10 cm\n")
    path = tmp_path / "graph.yaml"
    path.write_text("include: aloft:robots/jump\nrobot: mine.yaml\nset: {plan.task: hop.yaml}\n")
    assert not [p for p in check(path).problems if p.at == "plan.task"]
    (tmp_path / "hop.yaml").write_text("robot: go2\nrise: 10 cm\n")
    (problem,) = [p for p in check(path).problems if p.at == "plan.task"]
    assert "is for go2, but the graph's robot is mine" in problem.message
