"""JumpPlan: the shipped plans without a solver, inline tasks, and refusals that say why."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.blocks.jumping.jump_plan import JumpPlan, TriggeredJumpPlan
from aloft.blocks.signals import Phase
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import AloftError
from aloft.runtime.loading import check
from aloft.runtime.testing import BlockBench


def bench(**parameters: object) -> BlockBench:
    return BlockBench(JumpPlan, {"solve": False, **parameters}, robot="bruce", rate=500.0)


def test_it_plays_the_shipped_plan_through() -> None:
    block = bench(task="tasks/forward_10cm.yaml", stand_time=0.1)
    task = read_task(SHIPPED.parent / "tasks" / "forward_10cm.yaml")
    plan = PlanLibrary(find_robot("bruce"), Path("nowhere")).find(task)
    assert plan is not None
    phases, heights, reference = [], [], block.get("reference")
    for _ in range(round((plan.duration + 0.3) * 500)):
        block.step()
        phases.append(int(reference.phase))
        heights.append(float(reference.com[2]))
        assert reference.contact.any() == (phases[-1] != Phase.FLIGHT)
    order = [phase for k, phase in enumerate(phases) if k == 0 or phase != phases[k - 1]]
    assert order[:5] == [Phase.STAND, Phase.SQUAT, Phase.THRUST, Phase.FLIGHT, Phase.LANDING]
    assert max(heights) - heights[0] == pytest.approx(0.15, abs=1e-3)
    assert float(reference.foot_position[:, 0].mean()) == pytest.approx(0.1, abs=2e-3)
    np.testing.assert_allclose(reference.com_velocity, 0.0, atol=1e-3)


@pytest.mark.parametrize(("rise", "count"), [("8.13cm", 1), ("12cm", 0)])
def test_a_task_without_a_plan_is_refused_at_load_where_none_can_be_made(
    monkeypatch: pytest.MonkeyPatch, rise: str, count: int
) -> None:
    monkeypatch.setattr("aloft.runtime.language.errors.find_spec", lambda module: None)
    problems = check("aloft:jump", [f"plan.task.rise={rise}"]).problems
    assert [problem.at for problem in problems] == ["plan.task"] * count
    for problem in problems:
        assert "no stored plan is for the task" in problem.message
        assert problem.message.endswith("planning a jump needs the library casadi")
        assert problem.fix.startswith("pip install")


def test_an_inline_task_that_is_not_kept_is_refused_without_a_solver() -> None:
    with pytest.raises(AloftError, match=r"there is no plan for the task .*'aloft plan', or set"):
        bench(task={"rise": 0.0701})


def test_an_inline_task_finds_the_plan_of_the_same_task() -> None:
    block = bench(task={"rise": "15 cm"})
    block.step()
    assert float(block.get("reference").lift_off_time) > 0.5


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (
            "tasks/none.yaml",
            "there is no task 'tasks/none.yaml' beside the graph or among the shipped ones",
        ),
        ({"rise": -1}, "rise: expected more than 0 m, found -1"),
        ({"rise": 0.1, "robot": "atlas"}, "is for atlas, but the graph's robot is bruce"),
    ],
)
def test_what_cannot_be_asked_for_is_said(task: object, words: str) -> None:
    with pytest.raises(AloftError, match=words):
        bench(task=task)


def test_it_needs_a_robot() -> None:
    dimensions = {"n_joints": 10, "n_feet": 2, "n_contacts": 4, "n_velocities": 16}
    with pytest.raises(AloftError, match="it needs a robot, and the graph names none"):
        BlockBench(JumpPlan, {}, dimensions=dimensions)


def test_a_kept_plan_that_is_not_valid_never_starts(tmp_path: Path) -> None:
    robot = find_robot("bruce")
    task = read_task(SHIPPED.parent / "tasks" / "in_situ.yaml")
    plan = PlanLibrary(robot, Path("nowhere")).find(task)
    assert plan is not None
    PlanLibrary(robot, tmp_path).add(replace(plan, joint_torque=2.0 * plan.joint_torque))
    with pytest.raises(AloftError, match="is not valid:\njoint_torque"):
        bench(task="tasks/in_situ.yaml", library=str(tmp_path))


REDUCED = {"task": {"rise": "6 cm", "impact": True}, "formulation": "srbm", "solve": True}


@pytest.mark.long
def test_it_is_followed_where_that_is_asked_for_and_called_invalid(tmp_path: Path) -> None:
    block = bench(**REDUCED, library=str(tmp_path), check="reported")
    assert block.block.metrics() == {"plan_valid": False, "plan_tests_failed": 9}
    (warning,) = (each for each in block.block.warnings() if each.startswith("THE PLAN"))
    assert warning.startswith("THE PLAN IS NOT VALID and is followed all the same")
    assert "\nflight_rotation: the base's error at touchdown is" in warning
    kept = list(tmp_path.rglob("*.npz"))
    assert [path.parent for path in kept] == [tmp_path / "invalid"]
    # What the single rigid body believes of its momentum, not what the legs make of it.
    reference, momentum = block.get("reference"), []
    while float(reference.time) < float(reference.lift_off_time) or not momentum:
        block.step()
        momentum.append(float(reference.angular_momentum[1]))
    assert abs(momentum[-1]) < 0.01
    written = kept[0].stat().st_mtime_ns
    again = bench(**REDUCED, library=str(tmp_path), check="reported")
    assert again.block.warnings() == block.block.warnings()
    assert kept[0].stat().st_mtime_ns == written, "it was solved anew"
    # It is kept, but for nobody else.
    with pytest.raises(AloftError, match="is not valid:\nangular_momentum: its error at the knots"):
        bench(**REDUCED, library=str(tmp_path))
    assert list(tmp_path.rglob("*.npz")) == kept


def test_a_valid_plan_has_nothing_to_report(tmp_path: Path) -> None:
    block = bench(task="tasks/in_situ.yaml", check="reported", library=str(tmp_path))
    assert block.block.metrics() == {"plan_valid": True, "plan_tests_failed": 0}
    assert not block.block.warnings()


def follow(block: BlockBench, slower: float) -> float:
    """How much later than planned a robot lifts off that is so much slower than the plan [s]."""
    reference = block.get("reference")
    block.step()
    planned = float(reference.lift_off_time)
    for tick in range(1, 1000):
        step = 0.002 * reference.com_velocity, 0.002 * reference.com_acceleration
        block.set(
            "terms",
            com=reference.com + step[0],
            com_velocity=reference.com_velocity + step[1] - np.array([0.0, 0.0, slower]),
            foot_position=np.array(reference.foot_position),
        )
        block.step()
        if float(reference.time) >= planned:
            return tick / 500.0 - planned
    raise AssertionError("it never lifts off")


def test_plain_python_and_machine_code_follow_a_slow_robot_to_the_same_bytes() -> None:
    found = []
    for plain in (False, True):
        block = BlockBench(
            JumpPlan, {"solve": False, "task": "tasks/in_situ_12cm.yaml"},
            robot="bruce", rate=500.0, plain=plain,
        )  # fmt: skip
        assert follow(block, 0.1) > 0.0
        assert float(block.get("progress").late) > 0.0
        snapshot = block.snapshot()
        found.append((snapshot.tick, snapshot.bus, snapshot.state))
    assert found[0] == found[1]


@pytest.mark.parametrize(("slower", "least", "most"), [(0.0, -0.002, 0.001), (0.1, 0.004, 0.012),
                                                     (-0.1, -0.012, -0.004)])  # fmt: skip
def test_a_slow_robot_thrusts_longer_and_a_fast_one_shorter(slower, least, most) -> None:
    late = follow(bench(task="tasks/in_situ_12cm.yaml"), slower)
    assert least <= late < most + 0.002
    assert abs(follow(bench(task="tasks/in_situ_12cm.yaml", by="clock"), slower)) < 0.0021


def test_the_delay_is_the_parameter_or_the_one_at_the_input() -> None:
    def pushes(**parameters: object) -> list[float]:
        block = bench(task="tasks/in_situ_12cm.yaml", by="clock", **parameters)
        block.set("delay", delay=0.006)
        found = []
        for _ in range(560):
            block.step()
            found.append(float(block.get("reference").com_acceleration[2]))
        return found

    ahead, given, later = pushes(), pushes(lead="6 ms"), pushes(lead="0 ms")
    assert ahead == given
    np.testing.assert_allclose(ahead[:-3], later[3:], atol=1e-9)


@pytest.mark.parametrize("ahead", [0.0, 0.004])
def test_after_the_trigger_it_is_the_plan_of_a_run_that_begins(ahead: float) -> None:
    late = BlockBench(
        TriggeredJumpPlan,
        {"solve": False, "task": "tasks/in_situ_12cm.yaml"},
        robot="bruce",
        rate=500.0,
    )
    usual = BlockBench(
        JumpPlan, {"solve": False, "task": "tasks/in_situ_12cm.yaml"}, robot="bruce", rate=500.0
    )
    for bench in (late, usual):
        bench.set("delay", delay=0.005, ahead=ahead)
    late.set("phase", phase=Phase.HANG)
    for _ in range(300):
        late.step()
        assert float(late.get("reference").time) < 0.0
    late.set("phase", phase=Phase.STAND)
    for _ in range(800):
        late.step()
        usual.step()
        mine, other = late.get("reference"), usual.get("reference")
        assert float(mine.time) == pytest.approx(float(other.time), abs=1e-9)
        assert mine.phase == other.phase
        assert mine.com == pytest.approx(other.com, abs=1e-9)


def test_a_graph_that_is_loaded_and_run_reads_its_task_once(tmp_path, monkeypatch):
    from aloft.planner.task import read_task as reading

    graphs = Path(__file__).parents[3] / "graphs"
    task = (graphs / "tasks" / "in_situ.yaml").read_text()
    (tmp_path / "mine.yaml").write_text(task)
    read = []
    read_located = reading.read_located
    monkeypatch.setattr(
        reading, "read_located", lambda path, text: read.append(path) or read_located(path, text)
    )
    own = {"plan.task": str(tmp_path / "mine.yaml")}
    aloft.load(graphs / "jump.yaml", own).run(0.01, log=False)
    assert [path.name for path in read] == ["mine.yaml"]
    (tmp_path / "mine.yaml").write_text(task + "# another content\n")
    aloft.load(graphs / "jump.yaml", own).run(0.01, log=False)
    assert len(read) == 2
