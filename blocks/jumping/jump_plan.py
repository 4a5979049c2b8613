"""Plays back a planned jump: the whole-body plan of a task, from the library or the planner."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...mathematics.kernel import kernel
from ...planner.library.jump_table import (
    FlightRotation,
    JumpTable,
    TableRows,
    flight_rotation,
    table_rows,
)
from ...runtime.language.block import Block, Context, Input, Metric, Output, State, UnmetRequirement
from ...runtime.language.context import Clock
from ...runtime.language.errors import BlockError, MissingExtraError
from ...runtime.language.parameters import Parameters, parameter
from ..signals import DelayEstimate, DynamicsTerms, JumpReference, Phase, PhaseState
from .plan_progress import (
    PlanProgress,
    ProgressConstants,
    ProgressParameters,
    follow_plan,
)
from .table_reading import read_table

if TYPE_CHECKING:
    from ...planner.checking.validity import ValidityReport
    from ...planner.library.library import PlanLibrary
    from ...planner.library.rehearsed import Vector
    from ...planner.task.plan import PlannedJump
    from ...planner.task.task import JumpTask
    from ...robots.description import RobotDescription


class JumpPlan(Block):
    """The reference motion of a jump, found by the kino-dynamic planner (paper, III).

    The task is a file (``tasks/in_situ.yaml``; looked for beside the graph, then among the shipped
    graphs), the task itself (``{rise: 12 cm, distance_x: 5 cm}``), or a file with changes
    (``{file: tasks/in_situ.yaml, rise: 12 cm}``). Its plan comes from the plan
    library, where the task's hash is its key: the shipped plans need no solver. If there is none it
    is solved while the graph loads, starting from the nearest plan of the library, and kept.

    Every plan, also one from the library, must pass the validity check with exact dynamics
    (``planner/checking/validity``). With ``check: reported`` a plan that fails it is followed all
    the same, to compare the formulations ``paper`` and ``srbm``, whose plans always fail. Then the
    warnings of the run name every test that failed, and the metrics have ``plan_valid`` and
    ``plan_tests_failed``. For those formulations the reference has the centre of mass and momentum
    of the plan's own simplified model. ``formulation`` plans the same task in another formulation,
    without the keys for which that has nothing, such as impacts; the warnings of the run name them.

    The plan begins with the run; that of a ``TriggeredJumpPlan`` when the robot has been put down.
    At the start the robot stands still for ``stand_time``; at the end it stays where the plan
    ended. Between the plan's knots the reference is read from a table of 2 ms steps
    (``planner/library/reference_table``); accelerations and torques are read ``lead`` ahead of
    time, because they are fed forward. Where the controller works ahead of time by ``delay.ahead``
    (``StatePredictor``), all of the plan is read so much ahead, and they by the rest.

    **Progress.** With ``by: clock``, as in the paper, the thrust ends at the planned time. With
    ``by: progress``, and ``terms`` wired, it ends when the state of take-off is reached. In the last
    ``progress_time`` before lift-off let e be how much too fast the centre of mass is for the
    planned apex, of its measured velocity v and height z above the feet (``plan_progress``)::

        e = v - v_plan + g (z - z_plan) / v_plan,     delay' = -progress_gain e / z''_plan

    The plan is read later by this delay, which is within ``progress_limit``; so a robot that is too
    slow is pushed longer, as far as its legs reach. Everything behind, flight and landing too, is
    shifted with it, and ``reference.time`` with them. For this the feedforward is the mean over the
    tick in which the command holds: a thrust may end between two ticks. A flight whose toes land
    first (``reference.toes_first``) must end when the robot lands, because its toes slow down in the
    last 10 ms only. With f the time in which the measured centre of mass falls to its planned height
    at touchdown, there ``delay' = toes_gain (f - touchdown_time + time)``.

    **Somersaults.** With ``turning`` a plan that turns over is timed in flight by how far the robot has
    turned and how long it will fly (``plan_progress.follow_turn``). Other plans are followed as without.

    It exports to other blocks of the graph what follows from the task: the ``scene`` with its steps, for
    the simulator, and for the score the number of ``jumps`` and, of the last one, where it ends:
    ``landing_height``, ``distance`` [m, forward and left], ``yaw`` [rad], and ``rise`` [m] where the
    task gives it for a single jump. It also exports the ``velocity_correction`` [m/s] and the
    ``momentum_correction`` [N m s] that a rehearsal of the plan with this controller has learnt
    (``aloft plan --rehearse``), which are zero where there was none, or with ``rehearsed: false``. To
    them is added what the robot itself has learnt from its last jumps of this and of other tasks
    (``aloft jump --learn``), if ``learnt`` names the file. And it exports the ``load``: of every motor the
    integral of its squared torque over the plan [N^2 m^2 s], from which a driver tells what the jump heats its
    winding; none where the plan has yet to be solved.

    But for this, the progress and the rotation the block follows time alone. It raises ``BlockError`` at
    load where the task cannot be read or is for another robot, where it cannot be planned, or where its
    plan must be valid and is not; the message says which constraint or test.
    """

    class Params(ProgressParameters):
        task: str | Mapping[str, Any] = parameter(
            "tasks/in_situ.yaml",
            text="a task's file, the task's parameters, or a file and parameters that change it",
        )
        stand_time: float = parameter(
            0.4, unit="s", gt=0.0, text="standing before the plan, for the estimator to settle"
        )
        lead: float | None = parameter(
            None,
            unit="s",
            ge=0.0,
            le=0.02,
            text="delay from sensing to torque that is compensated; none: the one at `delay`",
        )
        library: str = parameter(
            "", text="folder where new plans are kept; the user's cache if empty"
        )
        solve: bool = parameter(True, text="solve a missing plan")
        check: Literal["required", "reported"] = parameter(
            "required", text="refuse an invalid plan, or follow it and report it as invalid"
        )
        formulation: Literal["full", "paper", "srbm"] | None = parameter(
            None, text="the planner's formulation, in place of the task's"
        )
        rehearsed: bool = parameter(
            True, text="export to the graph what a rehearsal of this plan has learnt"
        )
        learnt: str = parameter(
            "", text="file of what the robot has learnt from its own jumps; none: nothing"
        )

    Constants = ProgressConstants
    needs = ("floating base", "feet")
    files_folder = "library"
    params: Params
    constants: ProgressConstants
    terms = Input(DynamicsTerms, default={}, text="the measured motion, for by: progress")
    delay = Input(DelayEstimate, default={"delay": 0.002}, text="the delay that is compensated")
    reference = Output(JumpReference, text="the plan at the present instant")
    progress = State(PlanProgress, text="delay of the plan")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a task that cannot be read, or is for another robot or actuator profile."""
        from ...planner.library.library import shipped_tasks
        from ...planner.task.task import JumpTaskError

        assert isinstance(params, cls.Params) and context.robot is not None
        robot = context.robot
        try:
            task = read_or_make_task(params.task, context)
        except JumpTaskError as error:
            for line in str(error).splitlines():
                place, _, rest = line.partition(": ")
                key = rest.partition(": ")[0] if place == "task" else ""
                yield UnmetRequirement(
                    f"the task cannot be used: {rest if key else line}",
                    parameter=f"task.{key}" if key else "task",
                )
            return
        except LookupError as error:
            there = shipped_tasks()
            near = get_close_matches(str(params.task), there, 3)
            yield UnmetRequirement(
                str(error.args[0]),
                parameter="task",
                expected="a task's file, relative to the graph, or one of the "
                f"{len(there)} that ship, such as tasks/in_situ.yaml",
                found=str(params.task),
                nearest=tuple(near),
                fix=f"task: {near[0]}" if near else "",
            )
            return
        if task.robot != robot.name and not _is_file_of(task.robot, context):
            yield UnmetRequirement(
                f"the task {task.name!r} is for {task.robot}, but the graph's robot is "
                f"{robot.name}",
                parameter="task",
                expected=f"a task for {robot.name}",
                found=f"a task for {task.robot}",
                fix=f"robot: {task.robot}, as a key of the graph",
            )
        elif task.profile and task.profile != robot.motors.profile:
            yield UnmetRequirement(
                f"the task {task.name!r} is planned with the actuators {task.profile}, but the "
                f"graph runs with {robot.motors.profile}",
                parameter="task",
                expected="one actuator profile for the plan and the graph",
                found=f"profile: {task.profile} in the task",
                fix=f"actuators: {task.profile}, as a key of the graph",
            )
        else:
            yield from cls._missing_planner(params, context)

    @classmethod
    def _missing_planner(cls, params: Params, context: Context) -> Iterable[UnmetRequirement]:
        """Report a task that no stored plan is for, where the library that makes one is not installed."""
        from ...planner.task.files import need_planner

        try:
            need_planner()
        except MissingExtraError as error:
            assert context.robot is not None
            task = planned_task(params, context)
            if params.solve and plan_library(params, context.robot).path_of(task) is None:
                reason, _, line = str(error).rpartition(": ")
                yield UnmetRequirement(
                    f"no stored plan is for the task {task.name!r}, and {reason}",
                    parameter="task",
                    expected="a task with a plan, as those that ship, or the library",
                    fix=line,
                )

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Export the ground, the goals of the score and the corrections that follow from the task."""
        from ...planner.task.ground import scene_of
        from ...planner.task.task import JumpTaskError

        assert isinstance(params, cls.Params) and context.robot is not None
        task = read_or_make_task(params.task, context)
        try:
            scene = scene_of(task, context.robot)
        except JumpTaskError as error:
            scene = UnmetRequirement(
                str(error), fix="robot.ground.scene: flat, or a floor and boxes"
            )
        end, hops = task.places()[-1], task.hops()
        velocity, momentum = None, None
        if {"velocity_correction", "momentum_correction"} & context.asked:
            velocity, momentum = cls._corrections(task, params, context)
        load = None
        if "load" in context.asked:
            library = plan_library(params, context.robot)
            load = library.load_of(_as_planned(task, params.formulation))
        return {
            "scene": scene,
            "jumps": len(hops),
            "slope": list(task.places()[0].slope),
            "landing_height": round(end.z, 9),
            "distance": [round(end.x, 9), round(end.y, 9)],
            "yaw": end.heading,
            "rise": hops[0].rise if len(hops) == 1 else None,
            "velocity_correction": velocity,
            "momentum_correction": momentum,
            "load": load,
        }

    @classmethod
    def _corrections(cls, task: JumpTask, params: Params, context: Context) -> tuple[Any, Any]:
        """Return the sum of the corrections from rehearsals and from the robot's own jumps; for both the same
        ``UnmetRequirement`` where a file is damaged."""
        from ...planner.library.rehearsed import ZERO, RehearsalFileError

        try:
            rehearsed = cls._rehearsed(task, params, context)
        except RehearsalFileError as error:
            damaged = UnmetRequirement(str(error), fix=f"{context.path}.rehearsed: false")
            return damaged, damaged
        learnt = ZERO, ZERO
        if params.learnt:
            from ...planner.library.learnt import LearntFileError

            try:
                learnt = cls._learnt(task, params, context)
            except LearntFileError as error:
                damaged = UnmetRequirement(str(error), parameter="learnt")
                return damaged, damaged
        velocity, momentum = (
            [a + b for a, b in zip(first, second, strict=True)]
            for first, second in zip(rehearsed, learnt, strict=True)
        )
        return velocity, momentum

    @classmethod
    def _rehearsed(cls, task: JumpTask, params: Params, context: Context) -> tuple[Vector, Vector]:
        """Return the corrections that a rehearsal has learnt."""
        from ...planner.library.rehearsed import ZERO, controller_hash, find_rehearsed

        assert context.robot is not None
        if not params.rehearsed:
            return ZERO, ZERO
        rate = 1.0 / context.clock.base_period
        controller = controller_hash(context.graph, rate, context.path)
        task = _as_planned(task, params.formulation)
        found = find_rehearsed(plan_library(params, context.robot), task, controller)
        if found is None:
            return ZERO, ZERO
        return found.velocity_correction, found.momentum_correction

    @classmethod
    def _learnt(cls, task: JumpTask, params: Params, context: Context) -> tuple[Vector, Vector]:
        """Return the corrections that the robot itself has learnt."""
        from ...planner.library.learnt import launch_of, read_learnt

        assert context.robot is not None
        beside = context.folder / params.learnt
        path = beside if beside.is_file() else context.graph_folder / params.learnt
        return read_learnt(path, context.robot.name).correction(launch_of(task))

    def setup(self) -> None:
        from ...planner.library.validation_cache import cached_reference_table

        robot, task = self.robot, planned_task(self.params, self.context)
        self._left_out = self._keys_left_out()
        plan = self._plan(task, robot)
        self._report = self._report_validity(plan)
        table = cached_reference_table(plan, robot, self.params.stand_time)
        self.table = table_rows(table)
        self.rotation = self._time_progress(table)

    def _time_progress(self, table: JumpTable) -> FlightRotation:
        """Write the constants; returns the rotation of the flight, empty where it is not followed."""
        p, constants, turning = self.params, self.constants, self.params.turning
        measured = "terms" in self.context.wired
        rotation = flight_rotation(table, self.robot) if measured and turning is not None else None
        constants.lead = -1.0 if p.lead is None else p.lead
        constants.follows_motion = measured and p.by == "progress"
        constants.follows_turn = rotation is not None
        constants.period = self.period
        constants.foot_of_point[:] = self.robot.foot_of_contact()
        if turning is not None:
            constants.gain, constants.aim = turning.gain, turning.aim
            constants.early, constants.late = turning.early, turning.late
        return rotation or FlightRotation(*(np.zeros(size) for size in (1, 1, 1, 4)))

    @kernel
    @staticmethod
    def step(
        terms: DynamicsTerms,
        delay: DelayEstimate,
        reference: JumpReference,
        progress: PlanProgress,
        table: TableRows,
        rotation: FlightRotation,
        params: Params,
        constants: ProgressConstants,
        clock: Clock,
    ) -> None:
        now = clock.base_period * clock.tick
        follow_plan(
            now, terms, delay, reference, progress, table, rotation, params, constants
        )  # fmt: skip

    def metrics(self) -> Mapping[str, Metric]:
        report = self._report
        if report is None:
            return {}
        return {"plan_valid": report.valid, "plan_tests_failed": len(report.failed)}

    def warnings(self) -> Sequence[str]:
        report = self._report
        found = []
        if self._left_out:
            found.append(
                f"formulation {self.params.formulation} has nothing for {', '.join(self._left_out)} of the task, "
                "which are left out"
            )
        if report is None or report.valid:
            return found
        return (
            *found,
            "THE PLAN IS NOT VALID and is followed all the same (check: reported):\n"
            + report.explain(),
        )

    def _keys_left_out(self) -> list[str]:
        """Return the keys of the task for which the formulation that is chosen in its place has nothing."""
        if self.params.formulation is None:
            return []
        from ...planner.task.boundary_set import in_formulation

        return in_formulation(
            read_or_make_task(self.params.task, self.context), self.params.formulation
        )[1]

    def _report_validity(self, plan: PlannedJump) -> ValidityReport | None:
        """Return the validity report of a plan that need not be valid; ``None`` if it must be valid."""
        if self.params.check == "required":
            return None
        from ...planner.checking.validity import PlanTest, ValidityReport

        report = ValidityReport(tuple(PlanTest(**test) for test in plan.report["tests"]))
        broken = [test for test in report.failed if test.name in ("arrays", "phases")]
        if broken:
            raise BlockError(f"the plan {plan.task.name!r} is broken: {broken[0].where}")
        return report

    def _plan(self, task: JumpTask, robot: RobotDescription) -> PlannedJump:
        from ...planner.task.files import JumpTaskError
        from ...planner.task.plan import PlanFileError

        library = plan_library(self.params, robot)
        if not self.params.solve and library.path_of(task) is None:
            raise BlockError(
                f"there is no plan for the task {task.name!r}; make one with 'aloft plan', or set "
                "solve: true"
            )
        try:
            if self.params.check == "reported":
                plan = library.attempt(task)
            else:
                plan, _ = library.plan(task)
        except (JumpTaskError, PlanFileError) as error:
            raise BlockError(str(error)) from error
        kept = library.path_of(task)
        self.files_read = (kept,) if kept is not None else ()
        return plan


class TriggeredJumpPlan(JumpPlan):
    """A ``JumpPlan`` that begins when the robot stands, and not with the run.

    While the ``phase`` of the tick before is HANG the reference is the beginning of the plan, and
    ``reference.time`` is negative. Wire it with ``{from: phase.phase, delay: 1, initial: {phase: -1}}``.
    """

    phase = Input(PhaseState, text="the phase; the plan begins after HANG")

    @kernel
    @staticmethod
    def step(  # type: ignore[override]  # it has another port
        terms: DynamicsTerms,
        delay: DelayEstimate,
        phase: PhaseState,
        reference: JumpReference,
        progress: PlanProgress,
        table: TableRows,
        rotation: FlightRotation,
        params: JumpPlan.Params,
        constants: ProgressConstants,
        clock: Clock,
    ) -> None:
        now = clock.base_period * clock.tick
        if phase.phase == Phase.HANG:
            progress.late = now + clock.base_period
            read_table(table, -constants.period, 0.0, constants.period, reference)
            return
        follow_plan(
            now, terms, delay, reference, progress, table, rotation, params, constants
        )  # fmt: skip


def plan_library(params: JumpPlan.Params, robot: RobotDescription) -> PlanLibrary:
    """Return the library in which a block looks for its plan."""
    from ...planner.library.library import PlanLibrary

    return PlanLibrary(robot, Path(params.library) if params.library else None)


def planned_task(params: JumpPlan.Params, context: Context) -> JumpTask:
    """Return the task of a block, in the formulation that is planned.

    Raises:
        LookupError, JumpTaskError: as ``read_or_make_task``.
    """
    return _as_planned(read_or_make_task(params.task, context), params.formulation)


def _as_planned(task: JumpTask, chosen: Literal["full", "paper", "srbm"] | None) -> JumpTask:
    """Return the task in the formulation ``chosen``, if there is one."""
    if chosen is None:
        return task
    from ...planner.task.boundary_set import in_formulation

    return in_formulation(task, chosen)[0]


def _is_file_of(name: str, context: Context) -> bool:
    """Check that a task names the graph's robot by its file."""
    from ...robots.description import find_robot

    folder = context.graph_folder
    if not Path(name).suffix or not (folder / name).is_file() or context.robot is None:
        return False
    return find_robot(name, folder).name == context.robot.name


def read_or_make_task(wanted: str | Mapping[str, Any], context: Context) -> JumpTask:
    """Return the task of a graph, which gives the name of its file, its parameters, or both.

    Raises:
        LookupError: there is no file of that name beside the graph or among the shipped tasks.
        JumpTaskError: it cannot be read as a task.
    """
    from ...planner.library.library import find_task

    changes = {} if isinstance(wanted, str) else dict(wanted)
    file = wanted if isinstance(wanted, str) else changes.pop("file", None)
    robot, told = _SameRobot(context.robot), json.dumps(changes)
    if file is None:
        return _made_task(told, robot)
    found = find_task(str(file), context.folder, context.graph_folder, Path())
    return _read_task(found, found.read_bytes(), told, robot)


class _SameRobot:
    """A description as the key of a cache: equal to itself alone."""

    def __init__(self, robot: RobotDescription | None) -> None:
        self.robot = robot

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _SameRobot) and other.robot is self.robot

    def __hash__(self) -> int:
        return id(self.robot)


@lru_cache(maxsize=32)
def _made_task(told: str, robot: _SameRobot) -> JumpTask:
    """Return the task that a graph itself gives."""
    from ...planner.task.read_task import spoken_name
    from ...planner.task.task import make_task

    own = {"robot": robot.robot.name} if robot.robot is not None else {}
    return spoken_name(make_task({"name": "", **own, **json.loads(told)}))


@lru_cache(maxsize=32)
def _read_task(file: Path, content: bytes, told: str, robot: _SameRobot) -> JumpTask:
    """Return the task in a file of that content, with changes; a graph that is loaded and run reads it once."""
    from ...planner.task.read_task import changed_task, read_task

    changes = json.loads(told)
    return changed_task(file, changes) if changes else read_task(file)
