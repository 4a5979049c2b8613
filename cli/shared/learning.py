"""Jumps from which a robot learns, for ``aloft jump --learn``: made one after the other, kept and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...runtime.language.errors import AloftError, ExitCode
from .output import print_json, print_warning, say, table

if TYPE_CHECKING:
    from rich.console import Console

    from ...planner.library.learnt import LearntJumps, Lesson
    from ...planner.library.rehearsed import Vector
    from ...planner.task.plan import PlannedJump
    from ...runtime.graph import Graph
    from ...runtime.running.run_result import RunResult

NOISE_SEEDS = 1000
"""Jumps of one robot that differ in their noise."""


@dataclass(frozen=True)
class LearningOptions:
    """The options of learning from jumps."""

    learn: Annotated[
        Path | None,
        typer.Option(help="Correct the jump by the lessons in this file, and add this jump's."),
    ] = None
    times: Annotated[
        int,
        typer.Option(min=1, max=100, help="With --learn: number of jumps, each with fresh noise."),
    ] = 1
    ladder: Annotated[
        bool,
        typer.Option(
            "--ladder",
            help="With --learn: begin with smaller jumps: from 2 cm high in place, then half as far.",
        ),
    ] = False


@dataclass(frozen=True)
class ReadyJump:
    """A graph that is ready to jump, and what its robot is to do."""

    graph: Graph
    plan: PlannedJump


@dataclass(frozen=True)
class Attempt:
    """One jump: the corrections it had, how it ended, and what it teaches."""

    task: str
    velocity: Vector
    momentum: Vector
    success: bool
    reason: str
    lesson: Lesson | None


Prepare = Callable[[Mapping[str, float], Sequence[str]], ReadyJump]
"""Plans a task with these changes, and loads the graph with these further settings."""


def learn_jumps(
    prepare: Prepare, asked: Mapping[str, float], rise: float, options: LearningOptions, seed: int,
    record: Path, out: Console, as_json: bool,
) -> ExitCode:  # fmt: skip
    """Jump as often as asked; each jump is corrected by what those before it have taught.

    Args:
        prepare: makes a graph for a task.
        asked: what is asked for, as changes of the graph's task.
        rise: of the jump that is asked for [m].
        seed: of the robot, where it is simulated.
        record: where the recording of the last jump goes.

    Raises:
        AloftError: the graph may not run, or its robot is real and more than one jump is asked for.
    """
    assert options.learn is not None
    file = options.learn.absolute()
    from ...studies.rehearsing.learning import ladder

    tasks = [*(ladder(asked, rise) if options.ladder else ()), *[dict(asked)] * options.times]
    attempts: list[Attempt] = []
    code = ExitCode.SUCCESS
    for number, task in enumerate(tasks, 1):
        ready = prepare(task, [])
        simulated = "noise_seed" in type(ready.graph.checked.block("robot").params).model_fields
        if len(tasks) > 1 and not simulated:
            raise AloftError(
                "a real robot jumps once a command: leave out --times and --ladder, and ask for one "
                "jump after the other, the smallest first"
            )
        learnt = known(file, ready)
        settings = [f"plan.learnt={file}"] if file.is_file() else []
        if simulated:
            fresh = NOISE_SEEDS * seed + len(learnt.lessons) + number
            settings += [f"robot.seed={seed}", f"robot.noise_seed={fresh}"]
        name = ready.plan.task.name
        with out.status(f"jump {number} of {len(tasks)}: {name}"):
            result = recorded_run(prepare(task, settings).graph, record, as_json)
        attempt = taught(result, ready.plan, learnt)
        if attempt.lesson is not None:
            from ...planner.library.learnt import write_learnt

            write_learnt(file, learnt.with_lesson(attempt.lesson))
        attempts.append(attempt)
        say(out, f"jump {number}, {name}: {'success' if result.success else result.reason}")
        code = result.exit_code
        if code >= 128:  # stopped by a signal
            break
    show(attempts, out)
    say(out, f"learnt: {file}; a graph takes it into use with plan.learnt: {file.name}")
    if as_json:
        rows = [asdict(attempt) for attempt in attempts]
        last = {"success": attempts[-1].success, "reason": attempts[-1].reason}
        print_json({**last, "recording": str(record), "learnt": str(file), "jumps": rows})
    return code


def known(file: Path, ready: ReadyJump) -> LearntJumps:
    """Read the corrections that the robot has learnt so far."""
    from ...planner.library.learnt import LearntJumps, read_learnt

    robot = ready.graph.checked.robot
    assert robot is not None
    return read_learnt(file, robot.name) if file.is_file() else LearntJumps(robot.name)


def recorded_run(graph: Graph, record: Path, as_json: bool) -> RunResult:
    """Run a graph, record it, and keep its signals."""
    from ...logs.recording.recorder import Recorder
    from ...runtime.running.freeze_guard import FreezeGuard

    recorder = Recorder(record, on_warning=print_warning)
    with FreezeGuard(graph.checked, as_json=as_json) as guard:
        return graph.run(sinks=[recorder, guard])


def taught(result: RunResult, plan: PlannedJump, learnt: LearntJumps) -> Attempt:
    """Judge a jump that had the corrections in ``learnt``."""
    from ...planner.library.learnt import launch_of
    from ...studies.rehearsing.learning import lesson_of

    graph = result.graph
    assert graph is not None and graph.robot is not None
    applied = learnt.correction(launch_of(plan.task))
    lesson = lesson_of(result.signal, plan, graph.robot.total_mass, applied)
    return Attempt(plan.task.name, *applied, result.success, result.reason, lesson)


def show(attempts: Sequence[Attempt], out: Console) -> None:
    """Print a row for each jump."""
    rows = []
    for attempt in attempts:
        row = [attempt.task, "yes" if attempt.success else "no"]
        row += [f"{1e3 * value:.0f}" for value in attempt.velocity]
        row += [f"{1e3 * value:.0f}" for value in attempt.momentum]
        if attempt.lesson is None:
            row += ["", ""]
        else:
            row.append(" ".join(f"{1e3 * value:.0f}" for value in attempt.lesson.place))
            row.append(" ".join(f"{degrees(value):.1f}" for value in attempt.lesson.tilt))
        rows.append(tuple(row))
    columns = (
        "jump", "success", ">velocity x [mm/s]", ">y", ">z", ">momentum x [mN m s]", ">y", ">z",
        ">off its place [mm]", ">tilt, heading [deg]",
    )  # fmt: skip
    out.print(table("corrections of each jump, and what it found of itself", columns, rows))
