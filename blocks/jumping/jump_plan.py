"""Plays back a planned jump: the whole-body plan of a task, from the library or the planner."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ...planner.library.jump_table import JumpTableReader
from ...runtime.language.block import Block, Context, Metric, Misfit, Output
from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, parameter
from ..signals import JumpReference

if TYPE_CHECKING:
    from ...planner.checking.validity import ValidityReport
    from ...planner.task.plan import JumpPlan as Plan
    from ...planner.task.task import JumpTask
    from ...robots.description import RobotDescription


class JumpPlan(Block):
    """The reference motion of a jump, found by the kino-dynamic planner (paper, III).

    The task is a file (``tasks/in_situ.yaml``; looked for beside the graph, then among the shipped
    graphs) or the task itself (``{rise: 12 cm, distance_x: 5 cm}``). Its plan comes from the plan
    library, where the task's hash is its key: the shipped plans need no solver. If there is none it
    is solved while the graph loads, starting from the nearest plan of the library, and kept.

    Every plan, also one from the library, must pass the validity check with exact dynamics
    (``planner/checking/validity``). With ``check: reported`` a plan that fails it is followed all
    the same, to compare the formulations ``paper`` and ``srbm``, whose plans always fail. Then the
    run's cautions name every test that failed, and the metrics have ``plan_valid`` and
    ``plan_tests_failed``. For those formulations the reference has the centre of mass and momentum
    of the plan's own simplified model. ``formulation`` plans the same task in another formulation,
    without the features that only ``full`` has: impacts, margins and limits of the motors.

    At the start the robot stands still for ``stand_time``; at the end it stays where the plan
    ended. Between the plan's knots the reference is read from a table of 2 ms steps
    (``planner/library/reference_table``); accelerations and torques are read ``lead`` ahead of
    time, because they are fed forward.

    The block follows time alone and does not depend on what the robot really does. It raises
    ``BlockError`` at load where the task cannot be read or is for another robot, where it cannot be
    planned, or where its plan must be valid and is not; the message says which constraint or test.
    """

    class Params(Parameters):
        task: str | Mapping[str, Any] = parameter(
            "tasks/in_situ.yaml", text="a task's file, or the task's parameters"
        )
        stand_time: float = parameter(
            0.4, unit="s", gt=0.0, text="standing before the plan, for the estimator to settle"
        )
        lead: float = parameter(
            0.002,
            unit="s",
            ge=0.0,
            le=0.02,
            text="delay from sensing to torque that is compensated",
        )
        library: str = parameter(
            "", text="folder where new plans are kept; the user's cache if empty"
        )
        solve: bool = parameter(True, text="whether a missing plan may be solved")
        check: Literal["required", "reported"] = parameter(
            "required", text="whether the plan must be valid, or is followed and called invalid"
        )
        formulation: Literal["full", "paper", "srbm"] | None = parameter(
            None, text="the planner's formulation, in place of the task's"
        )

    needs = ("floating base", "feet")
    params: Params
    reference = Output(JumpReference, text="the plan at the present instant")

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """Report a task that cannot be read, or is for another robot or actuator profile."""
        from ...planner.library.shipped import shipped_graphs
        from ...planner.task.task import TaskError

        assert isinstance(params, cls.Params) and context.robot is not None
        robot = context.robot
        try:
            task = read_or_make_task(params.task, context)
        except TaskError as error:
            for line in str(error).splitlines():
                place, _, rest = line.partition(": ")
                key = rest.partition(": ")[0] if place == "task" else ""
                yield Misfit(
                    f"the task cannot be used: {rest if key else line}",
                    parameter=f"task.{key}" if key else "task",
                )
            return
        except LookupError as error:
            there = sorted(
                f"tasks/{path.name}" for path in (shipped_graphs() / "tasks").glob("*.yaml")
            )
            near = get_close_matches(str(params.task), there, 3)
            yield Misfit(
                str(error.args[0]),
                parameter="task",
                expected="a task's file, relative to the graph, or one of the "
                f"{len(there)} that ship, such as tasks/in_situ.yaml",
                found=str(params.task),
                nearest=tuple(near),
                fix=f"task: {near[0]}" if near else "",
            )
            return
        if task.robot != robot.name:
            yield Misfit(
                f"the task {task.name!r} is for {task.robot}, but the graph's robot is "
                f"{robot.name}",
                parameter="task",
                expected=f"a task for {robot.name}",
                found=f"a task for {task.robot}",
                fix=f"robot: {task.robot}, as a key of the graph",
            )
        elif task.profile and task.profile != robot.motors.profile:
            yield Misfit(
                f"the task {task.name!r} is planned with the actuators {task.profile}, but the "
                f"graph runs with {robot.motors.profile}",
                parameter="task",
                expected="one actuator profile for the plan and the graph",
                found=f"profile: {task.profile} in the task",
                fix=f"actuators: {task.profile}, as a key of the graph",
            )

    def setup(self) -> None:
        from ...planner.library.reference_table import reference_table

        robot, task = self.robot, self._task()
        plan = self._plan(task, robot)
        self._report = self._report_validity(plan)
        self._reader = JumpTableReader(reference_table(plan, robot, self.params.stand_time))

    def step(self) -> None:
        self._reader.read(self.time, self.reference, self.params.lead)

    def metrics(self) -> Mapping[str, Metric]:
        report = self._report
        if report is None:
            return {}
        return {"plan_valid": report.valid, "plan_tests_failed": len(report.failed)}

    def cautions(self) -> Sequence[str]:
        report = self._report
        if report is None or report.valid:
            return ()
        return (
            "THE PLAN IS NOT VALID and is followed all the same (check: reported):\n"
            + report.explain(),
        )

    def _report_validity(self, plan: Plan) -> ValidityReport | None:
        """The validity report of a plan that need not be valid; ``None`` if it must be valid."""
        if self.params.check == "required":
            return None
        from ...planner.checking.validity import PlanTest, ValidityReport

        report = ValidityReport(tuple(PlanTest(**test) for test in plan.report["tests"]))
        broken = [test for test in report.failed if test.name in ("arrays", "phases")]
        if broken:
            raise BlockError(f"the plan {plan.task.name!r} is broken: {broken[0].where}")
        return report

    def _task(self) -> JumpTask:
        task = read_or_make_task(self.params.task, self.context)
        chosen = self.params.formulation
        if chosen is None:
            return task
        impact = task.impact and chosen == "full"
        return task.model_copy(update={"formulation": chosen, "impact": impact})

    def _plan(self, task: JumpTask, robot: RobotDescription) -> Plan:
        from ...planner.library.library import PlanLibrary
        from ...planner.task.errors import TaskError
        from ...planner.task.plan import PlanFileError

        folder = Path(self.params.library) if self.params.library else None
        library = PlanLibrary(robot, folder)
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
        except (TaskError, PlanFileError) as error:
            raise BlockError(str(error)) from error
        kept = library.path_of(task)
        self.files_read = (kept,) if kept is not None else ()
        return plan


def read_or_make_task(wanted: str | Mapping[str, Any], context: Context) -> JumpTask:
    """The task of a graph, which gives the name of its file or its parameters.

    Raises:
        LookupError: there is no file of that name beside the graph or among the shipped tasks.
        TaskError: it cannot be read as a task.
    """
    from ...planner.library.shipped import shipped_graphs
    from ...planner.task.read_task import read_task
    from ...planner.task.task import make_task

    if not isinstance(wanted, str):
        robot = {"robot": context.robot.name} if context.robot is not None else {}
        return make_task({"name": context.path, **robot, **wanted})
    places = [folder / wanted for folder in (context.folder, Path(), shipped_graphs())]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise LookupError(f"there is no task {wanted!r} beside the graph or among the shipped ones")
    return read_task(found)
