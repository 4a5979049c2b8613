"""What one run teaches a robot, by the robot's own estimates."""

from collections.abc import Iterator

import numpy as np
import pytest

from aloft.mathematics.arrays import Array
from aloft.planner.library.learnt import LARGEST
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.rehearsed import ZERO
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot
from aloft.runtime.graph import load
from aloft.runtime.running.run_result import RunResult
from aloft.studies.rehearsing.learning import lesson_of

GRAPHS = SHIPPED.parent
BRUCE = find_robot("bruce")
MASS = BRUCE.total_mass


@pytest.fixture(scope="module")
def plan() -> PlannedJump:
    found = PlanLibrary(BRUCE, SHIPPED).find(read_task(GRAPHS / "tasks" / "in_situ_12cm.yaml"))
    assert found is not None
    return found


@pytest.fixture(scope="module")
def run() -> Iterator[RunResult]:
    yield load(GRAPHS / "jump.yaml", ["robot.seed=3"]).run()


class Shifted:
    """The signals of a run whose feet end elsewhere, and whose torso leans after touchdown."""

    def __init__(self, run: RunResult, ahead: float, pitch: float) -> None:
        self.run, self.ahead, self.pitch, self.names = run, ahead, pitch, set[str]()

    def __call__(self, name: str) -> Array:
        self.names.add(name)
        values = np.array(self.run.signal(name))
        flying = int(np.searchsorted(self.run.signal("plan.reference.time"), self.landed - 0.1))
        if name == "dynamics.terms.foot_position":
            values[flying:, :, 0] += self.ahead
        if name == "estimator.base.orientation":
            values[flying:] = [0.0, np.sin(0.5 * self.pitch), 0.0, np.cos(0.5 * self.pitch)]
        return values

    @property
    def landed(self) -> float:
        return float(self.run.signal("plan.reference.touchdown_time")[0])


def test_what_a_run_found_of_itself_is_near_the_truth(run: RunResult, plan: PlannedJump) -> None:
    lesson = lesson_of(run.signal, plan, MASS, (ZERO, ZERO))
    assert lesson is not None
    moved = [float(run.metrics[f"jump_distance_{axis}_m"]) for axis in "xy"]  # type: ignore[arg-type]
    np.testing.assert_allclose(lesson.place, moved, atol=0.015)
    assert np.abs(lesson.tilt).max() < np.radians(float(run.metrics["peak_tilt_deg"]) + 2.0)  # type: ignore[arg-type]


def test_the_truth_is_not_looked_at(run: RunResult, plan: PlannedJump) -> None:
    signals = Shifted(run, 0.0, 0.0)
    lesson_of(signals, plan, MASS, (ZERO, ZERO))
    assert not [name for name in signals.names if "truth" in name]


def test_corrections_act_against_the_errors_and_add_up(run: RunResult, plan: PlannedJump) -> None:
    near = lesson_of(Shifted(run, 0.0, -0.01), plan, MASS, (ZERO, ZERO))
    far = lesson_of(Shifted(run, 0.03, -0.01), plan, MASS, (ZERO, ZERO))
    had = lesson_of(Shifted(run, 0.03, -0.01), plan, MASS, ((-0.02, 0.0, 0.0), (0.0, 0.01, 0.0)))
    level = lesson_of(Shifted(run, 0.0, 0.01), plan, MASS, (ZERO, ZERO))
    assert near is not None and far is not None and had is not None and level is not None
    assert far.place[0] - near.place[0] == pytest.approx(0.03, abs=1e-4)
    assert far.velocity[0] < near.velocity[0]
    assert near.momentum[1] > level.momentum[1]
    assert had.momentum[1] == pytest.approx(far.momentum[1] + 0.01, abs=1e-4)
    assert had.velocity[0] == pytest.approx(max(far.velocity[0] - 0.02, -LARGEST), abs=1e-4)


def test_a_measured_place_comes_before_the_estimate(run: RunResult, plan: PlannedJump) -> None:
    lesson = lesson_of(run.signal, plan, MASS, (ZERO, ZERO), (0.05, -0.02))
    assert lesson is not None
    np.testing.assert_allclose(lesson.place, [0.05, -0.02], atol=1e-4)


def test_corrections_are_bounded(run: RunResult, plan: PlannedJump) -> None:
    lesson = lesson_of(run.signal, plan, MASS, (ZERO, ZERO), (5.0, 0.0))
    assert lesson is not None and lesson.velocity[0] == -LARGEST


def test_a_run_without_a_landing_teaches_nothing(run: RunResult, plan: PlannedJump) -> None:
    def standing(name: str) -> Array:
        values = np.array(run.signal(name))
        return np.ones_like(values) if name == "contacts.state.active" else values

    def ends_early(name: str) -> Array:
        return np.asarray(run.signal(name)[:400])

    assert lesson_of(standing, plan, MASS, (ZERO, ZERO)) is None
    assert lesson_of(ends_early, plan, MASS, (ZERO, ZERO)) is None


def test_somersaults_are_not_learnt(run: RunResult) -> None:
    plan = PlanLibrary(BRUCE, SHIPPED).find(read_task(GRAPHS / "tasks" / "somersault.yaml"))
    assert plan is not None
    assert lesson_of(run.signal, plan, MASS, (ZERO, ZERO)) is None
