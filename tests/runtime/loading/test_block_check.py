"""Blocks that do not fit the robot or the graph are in the load report; see also the wrong graphs."""

import shutil
from pathlib import Path

import pytest

from aloft.robots.description import RobotDescription, find_robot
from aloft.runtime.language.block import Clock, Context, UnmetRequirement
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.language.registry import find_block
from aloft.runtime.language.requirements import fix_without_robot, has, unmet_requirements
from aloft.runtime.loading import LoadError, checked_text
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.bench import BlockBench

WRONG = Path(__file__).parents[2] / "graphs" / "wrong"
BRUCE = find_robot("bruce")


@pytest.fixture(autouse=True)
def _in_the_folder_of_wrong_graphs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(WRONG)


def blocks(text: str, head: str = "rate: 500 Hz\nrobot: bruce") -> str:
    return f"{head}\nblocks:\n  {text}\n"


def test_what_a_robot_has() -> None:
    bare = BRUCE.model_copy(update={"base_joint": "planar", "feet": (), "contacts": ()})
    assert all(has(BRUCE, need) for need in ("robot", "floating base", "feet", "imu", "switches"))
    assert has(bare, "imu") and has(bare, "robot")
    assert not any(has(bare, need) for need in ("floating base", "feet", "switches"))


def test_all_shipped_robots_are_in_the_fix() -> None:
    assert all(name in fix_without_robot() for name in ("bruce", "go2"))


def test_a_block_learns_the_period_and_the_folder() -> None:
    Picky = find_block("parts:Picky", WRONG)
    seen: list[Context] = []

    class Curious(Picky):  # type: ignore[misc]
        """Says what it was told."""

        @classmethod
        def requires(cls, params: Parameters, context: Context) -> list[UnmetRequirement]:
            seen.append(context)
            return []

    BlockBench(Curious, robot=BRUCE, rate=500.0, period_ticks=2, folder=WRONG)
    assert seen[0].period == pytest.approx(0.004)
    assert seen[0].folder == WRONG and seen[0].robot is BRUCE


def test_the_bench_refuses_what_a_load_refuses() -> None:
    Springs, Walker = (find_block(f"parts:{name}", WRONG) for name in ("Springs", "Walker"))
    with pytest.raises(Exception, match="Walker: it needs a robot, and the graph names none"):
        BlockBench(Walker, dimensions={"n_joints": 1})
    with pytest.raises(Exception, match=r"Springs: stiffness: bruce has no joint '\*_kne'"):
        BlockBench(Springs, {"stiffness": {"*": 1, "*_kne": 2}}, robot="bruce")


def test_values_per_joint_may_change_while_a_graph_runs() -> None:
    graph = BoundGraph(checked_text(blocks("soft: {use: parts:LiveSprings}"), WRONG / "graph.yaml"))
    found = adjust(graph.blocks, ["soft.stiffness.*_knee=60"])
    stiffness = found.params["soft"].stiffness  # type: ignore[attr-defined]
    assert stiffness.root == {"*": 40.0, "*_knee": 60.0}
    with pytest.raises(LoadError) as caught:
        adjust(graph.blocks, ["soft.stiffness.*_kne=60"])
    text = str(caught.value)
    assert "unmet-requirement: soft: stiffness: bruce has no joint '*_kne'" in text
    assert "nearest    *_knee" in text
    with pytest.raises(LoadError, match="by joint name, not by position"):
        adjust(graph.blocks, ["soft.stiffness=[1, 2, 3, 4, 5]"])


def robot_of(head: str, *overrides: str) -> RobotDescription:
    text = f"rate: 500 Hz\n{head}\nblocks:\n  one: {{use: blocks.Constant, with: {{value: [1]}}}}\n"
    robot = checked_text(text, WRONG / "graph.yaml", overrides).robot
    assert robot is not None
    return robot


def test_the_profile_in_use() -> None:
    assert robot_of("robot: bruce").motors.profile == "koala"
    assert robot_of("robot: bruce\nactuators: relaxed").motors.profile == "relaxed"
    assert robot_of("robot: bruce", "actuators=relaxed").motors.profile == "relaxed"
    assert robot_of("robot: bruce\nactuators: relaxed", "actuators=koala").profile in ("", "koala")
    assert robot_of("robot: bruce", "robot=pieces/arm.yaml").name == "arm"


def test_the_profile_is_in_the_flattened_text() -> None:
    text = blocks("one: {use: blocks.Constant, with: {value: [1]}}")
    graph = checked_text(text, WRONG / "graph.yaml", ["actuators=relaxed"])
    assert "robot: bruce\nactuators: relaxed\n" in graph.text
    assert checked_text(graph.text, WRONG / "graph.yaml").robot == graph.robot


@pytest.mark.parametrize("robot", ["../own/hopper.yaml", "package://own/hopper.yaml"])
def test_a_robot_of_a_file_is_found_again_from_the_flattened_text(
    tmp_path: Path, robot: str
) -> None:
    """So that a seed may change and a recording be replayed; a package is no folder."""
    for folder in ("own", "pieces", "graphs"):
        (tmp_path / folder).mkdir()
    shutil.copyfile(WRONG / "pieces" / "arm.yaml", tmp_path / "own" / "hopper.yaml")
    (tmp_path / "pieces" / "arm.yaml").write_text(
        blocks("one: {use: blocks.Constant, with: {value: [1]}}", f"robot: {robot}")
    )
    graph = checked_text(
        "rate: 500 Hz\ninclude: [../pieces/arm.yaml]\n", tmp_path / "graphs" / "graph.yaml"
    )
    again = checked_text(graph.text, tmp_path / "graphs" / "graph.yaml")
    assert again.robot == graph.robot is not None and again.text == graph.text


def test_unmet_requirements_needs_no_file() -> None:
    Picky = find_block("parts:Picky", WRONG)
    context = Context("picky", Clock(0.002), robot=BRUCE)
    assert unmet_requirements(Picky, Picky.Params(), context) == ()
    (unmet,) = unmet_requirements(Picky, Picky.Params(legs=4), context)
    assert unmet.message == "bruce has 2 legs"
