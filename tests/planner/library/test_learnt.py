"""What a robot learns from its own jumps: kept in a file, and applied to the next jump."""

from pathlib import Path

import pytest

from aloft.planner.library.learnt import (
    MOST,
    LearntFileError,
    LearntJumps,
    Lesson,
    launch_of,
    read_learnt,
    write_learnt,
)
from aloft.planner.library.library import SHIPPED
from aloft.planner.library.rehearsed import ZERO
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import make_task
from aloft.runtime.graph import load
from aloft.runtime.language.errors import AloftError

JUMP = SHIPPED.parent / "jump.yaml"
TASK = read_task(SHIPPED.parent / "tasks" / "in_situ_12cm.yaml")
LAUNCH = launch_of(TASK)
assert LAUNCH is not None
LESSON = Lesson("", LAUNCH, (-0.05, 0.01, 0.0), (0.0, 0.02, 0.0), (0.02, 0.0), (0.0, -0.1, 0.0))


def corrections(*settings: str) -> list[list[float]]:
    """The corrections in a graph."""
    params = load(JUMP, settings).checked.block("targets").params.model_dump()
    return [list(params[f"{kind}_correction"]) for kind in ("velocity", "momentum")]


def test_launches_are_those_of_a_throw() -> None:
    assert pytest.approx((0.0, 0.0, 1.534, 0.0), abs=1e-3) == LAUNCH
    down = launch_of(make_task({"name": "", "rise": 0.1, "landing_height": -0.15, "twist": 0.5}))
    assert down is not None
    assert down[2] == pytest.approx((2 * 9.81 * 0.1) ** 0.5)
    flight = (2 * 0.1 / 9.81) ** 0.5 + (2 * 0.25 / 9.81) ** 0.5
    assert down[3] == pytest.approx(0.1 * 0.5 / flight)


def test_a_row_has_the_launch_of_its_jumps_and_somersaults_have_none() -> None:
    tasks = SHIPPED.parent / "tasks"
    single = launch_of(make_task({"name": "", "rise": 0.06}))
    assert launch_of(read_task(tasks / "hops_10.yaml")) == single
    assert launch_of(read_task(tasks / "hops_rough_10.yaml")) is None
    assert launch_of(read_task(tasks / "somersault.yaml")) is None
    assert LearntJumps("bruce", (LESSON,)).correction(None) == (ZERO, ZERO)


def test_each_lesson_brings_the_correction_nearer_to_what_is_needed() -> None:
    learnt, found = LearntJumps("bruce"), []
    for _ in range(8):
        found.append(learnt.correction(LAUNCH)[0][0])
        learnt = learnt.with_lesson(LESSON)
    assert found[0] == 0.0
    assert found == sorted(found, reverse=True)
    assert -0.05 < found[-1] < -0.8 * 0.05


def test_the_last_jumps_count_most() -> None:
    other = Lesson("", LAUNCH, (0.05, 0.01, 0.0), ZERO, (0.0, 0.0), ZERO)
    learnt = LearntJumps("bruce", (LESSON, LESSON, other, other))
    assert learnt.correction(LAUNCH)[0][0] > 0.0
    assert LearntJumps("bruce", (other, other, LESSON, LESSON)).correction(LAUNCH)[0][0] < 0.0


def test_likelier_jumps_profit_more() -> None:
    learnt = LearntJumps("bruce", (LESSON,))
    shares = [
        learnt.correction((ahead, 0.0, LAUNCH[2], 0.0))[0][0] / LESSON.velocity[0]
        for ahead in (0.0, 0.6, 5.0)
    ]
    assert shares[0] > shares[1] > 0.3
    assert shares[2] < 0.01


def test_no_more_than_the_last_lessons_are_kept() -> None:
    learnt = LearntJumps("bruce")
    for number in range(MOST + 3):
        learnt = learnt.with_lesson(Lesson(str(number), LAUNCH, ZERO, ZERO, (0.0, 0.0), ZERO))
    assert [learnt.lessons[0].task, learnt.lessons[-1].task] == ["3", str(MOST + 2)]


def test_what_is_written_is_read(tmp_path: Path) -> None:
    learnt = LearntJumps("bruce", (LESSON, LESSON))
    write_learnt(tmp_path / "mine.json", learnt)
    assert read_learnt(tmp_path / "mine.json", "bruce") == learnt


def test_files_that_are_not_there_damaged_or_another_robots_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    with pytest.raises(LearntFileError, match="there is no such file; `aloft jump --learn mine"):
        read_learnt(file, "bruce")
    write_learnt(file, LearntJumps("go2", (LESSON,)))
    with pytest.raises(LearntFileError, match="this was learnt by go2, not by bruce"):
        read_learnt(file, "bruce")
    for wrong in ("", "{}", '{"format": 2}', file.read_text().replace("-0.05", "NaN")):
        file.write_text(wrong)
        with pytest.raises(LearntFileError, match="found a damaged file"):
            read_learnt(file, "go2")


def test_a_graph_takes_it_into_use(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    write_learnt(file, LearntJumps("bruce", (LESSON,)))
    assert corrections() == [[0.0] * 3] * 2
    velocity, momentum = corrections(f"plan.learnt={file}")
    expected = LearntJumps("bruce", (LESSON,)).correction(LAUNCH)
    assert (tuple(velocity), tuple(momentum)) == expected
    with pytest.raises(AloftError, match="there is no such file"):
        corrections(f"plan.learnt={tmp_path / 'none.json'}")
