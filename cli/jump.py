"""``aloft jump``: plans and runs a jump that its options describe, in one line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .shared.learning import LearningOptions, Prepare, ReadyJump, learn_jumps
from .shared.options import JsonBesideTables, Quiet, expand_option_groups
from .shared.output import console, errors_reported, print_json, say
from .shared.rehearsal import REHEARSE_HELP, rehearsal
from .shared.robot_trials import (
    RecordOptions,
    TrialOptions,
    about_robot,
    graph_of,
    quantity,
    require_one_or_many,
    trial_settings_of,
)
from .shared.run_graph import OneRunOptions, run_many, run_once

if TYPE_CHECKING:
    from rich.console import Console

    from ..planner.library.library import PlanLibrary
    from ..planner.task.task import JumpTask
    from ..runtime.graph import Graph

ABOVE_A_STEP = 0.07
"""Default height of a jump onto a step above that step [m]."""
HELP = {
    "rise": "Apex of the centre of mass above standing: 12cm; by default what the graph's task says.",
    "forward": "How far ahead it lands: 20cm.",
    "back": "How far behind.",
    "left": "How far to the left.",
    "right": "How far to the right.",
    "up": "How much higher it lands; a step is put there.",
    "down": "How much lower; a platform is put under its start.",
    "turn": "How far it turns, to the left: 30deg; to the right: -30deg.",
}
FIELDS = {
    "forward": ("distance_x", 1.0), "back": ("distance_x", -1.0), "left": ("distance_y", 1.0),
    "right": ("distance_y", -1.0), "up": ("landing_height", 1.0), "down": ("landing_height", -1.0),
}  # fmt: skip
"""The lengths of the command line as parameters of a task, and their sign there."""


@dataclass(frozen=True)
class JumpOptions:
    """The requested jump."""

    rise: Annotated[str, typer.Option(help=HELP["rise"])] = ""
    forward: Annotated[str, typer.Option(help=HELP["forward"])] = ""
    back: Annotated[str, typer.Option(help=HELP["back"])] = ""
    left: Annotated[str, typer.Option(help=HELP["left"])] = ""
    right: Annotated[str, typer.Option(help=HELP["right"])] = ""
    up: Annotated[str, typer.Option(help=HELP["up"])] = ""
    down: Annotated[str, typer.Option(help=HELP["down"])] = ""
    turn: Annotated[str, typer.Option(help=HELP["turn"])] = ""


@dataclass(frozen=True)
class PlanningOptions:
    """The options of planning a jump."""

    nearest: Annotated[
        bool,
        typer.Option(
            help="Where a jump has no plan, search for the nearest one that has; about 6 s."
        ),
    ] = True
    rehearse: Annotated[bool, typer.Option("--rehearse", help=REHEARSE_HELP)] = False


@expand_option_groups
def jump(
    asked: JumpOptions,
    running: TrialOptions,
    recording: RecordOptions,
    planning: PlanningOptions,
    learning: LearningOptions,
    as_json: JsonBesideTables = False,
    quiet: Quiet = False,
) -> None:
    """Plan a jump and run it: aloft jump --forward 20cm --up 5cm --turn 30deg."""
    from ..runtime.loading import flatten
    from ..studies.batch.seeds import parse_seeds
    from ..studies.rehearsing.lift_off import corrected_parameters

    seeds, seed = running.seeds, running.seed
    out = console(to_stderr=as_json, quiet=quiet)
    with errors_reported(as_json):
        require_one_or_many(running, recording)
        path, own = (running.graph, []) if running.graph else graph_of(running.robot)
        lengths = {name: getattr(asked, name) for name in FIELDS}
        about = about_robot(running.robot, "jump", out) if own else {}
        changes = task_changes(lengths, asked.rise, asked.turn, path, own)
        chosen = settings_for(changes, running)
        settings = [*own, *chosen]
        many = parse_seeds(seeds) if seeds else []
        if learning.learn is not None:
            if seeds or recording.no_record or planning.rehearse:
                raise AloftError(
                    "--learn: a robot learns from one recorded jump after the other, so leave out "
                    "--seeds, --no-record and --rehearse"
                )
            corrected_parameters(flatten(path, settings))  # refuses a graph without them
            record = recording.path_for("jump")
            assert record is not None
            rise = changes.get("rise") or usual_rise(path, own) or 0.0
            prepare = planner_of(path, own, running, planning.nearest, console(quiet=True))
            raise typer.Exit(
                learn_jumps(prepare, changes, rise, learning, seed, record, out, as_json)
            )
        loaded = load_jump(path, settings, None if seeds else seed)
        task = task_of(loaded)
        say(out, f"{task.robot} jumps: {task.name}")
        planned = plan_of(task, loaded, planning.nearest, out)
        if not planned["success"]:
            if own:
                planned |= stronger_motors(task, loaded, out)
            if as_json:
                why = {"success": False, "reason": planned["reason"], "recording": None}
                print_json({"asked": changes, "plan": planned, **about, **why})
            raise typer.Exit(ExitCode.NOT_SUCCESSFUL)
        library = library_of(loaded)
        planned |= rehearsal(path, settings, task, library, planning.rehearse, out)
        if planning.rehearse:  # what was learnt is part of the graph
            loaded = load_jump(path, settings, None if seeds else seed)
        if many:
            code = run_many(path, settings, many, out, as_json)
        else:
            options = OneRunOptions(record=recording.path_for("jump"), as_json=as_json)
            code = run_once(loaded, options, out, also={"asked": changes, "plan": planned, **about})
    raise typer.Exit(code)


def stronger_motors(task: JumpTask, graph: Graph, out: Console) -> dict[str, Any]:
    """Say by which factor stronger motors would do, where they are what is in the way of a task."""
    from ..studies.check_up import torque_factor

    assert graph.checked.robot is not None
    factor = torque_factor(task, graph.checked.robot)
    if factor is not None:
        say(out, f"with motors {factor:g} times as strong and fast there is a plan")
    return {"motors_needed": factor}


def planner_of(
    path: Path, own: Sequence[str], running: TrialOptions, nearest: bool, out: Console
) -> Prepare:
    """Return a function that plans a task and loads its graph, with the trial and settings of the
    command line."""

    def prepare(changes: Mapping[str, float], further: Sequence[str]) -> ReadyJump:
        chosen = settings_for(changes, running)
        settings = [*own, *chosen, *further]
        loaded = load_jump(path, settings, None)
        task = task_of(loaded)
        planned = plan_of(task, loaded, nearest, out)
        plan = library_of(loaded).find(task)
        if plan is None:
            raise AloftError(f"{task.name}: {planned['reason']}")
        return ReadyJump(loaded, plan)

    return prepare


def task_changes(
    lengths: dict[str, str], rise: str, turn: str, path: Path, own: Sequence[str] = ()
) -> dict[str, float]:
    """Return the changes of the task by the command line, in SI units, by the task's parameters;
    ``own`` are settings that name the graph's robot.

    Raises:
        AloftError: a quantity has no unit or a wrong one, is beyond what a task may ask for, or two
            contradict each other.
    """
    found: dict[str, float] = {}
    option_of: dict[str, str] = {}
    for name, text in lengths.items():
        if not text:
            continue
        field, sign = FIELDS[name]
        if field in option_of:
            raise AloftError(f"--{option_of[field]} and --{name} contradict each other: give one")
        option_of[field] = name
        found[field] = sign * quantity(name, text, "m", "20cm")
        check_limits(name, text, field, found[field], "m")
    if turn:
        found["twist"] = quantity("turn", turn, "rad", "30deg")
        check_limits("turn", turn, "twist", found["twist"], "rad")
    if rise:
        found["rise"] = quantity("rise", rise, "m", "12cm")
        check_limits("rise", rise, "rise", found["rise"], "m")
    elif found.get("landing_height", 0.0) > 0.0:
        usual = usual_rise(path, own)
        needed = round(found["landing_height"] + ABOVE_A_STEP, 6)
        if usual is None or needed > usual:
            found["rise"] = needed
    return found


def check_limits(name: str, text: str, field: str, value: float, unit: str) -> None:
    """Raise ``AloftError`` for a quantity that is beyond the limits of the task's parameter."""
    from ..planner.task.task import JumpTask

    for limit in JumpTask.model_fields[field].metadata:
        most, least = getattr(limit, "le", math.inf), getattr(limit, "ge", -math.inf)
        if not least <= value <= most:
            edge = abs(most if value > most else least)
            shown = f"{math.degrees(edge):.0f} deg" if unit == "rad" else f"{edge:g} {unit}"
            raise AloftError(f"--{name} {text}: no jump is planned beyond {shown}")
        if value <= getattr(limit, "gt", -math.inf):
            raise AloftError(f"--{name} {text}: it must be more than {limit.gt:g} {unit}")


def usual_rise(path: Path, own: Sequence[str]) -> float | None:
    """Return the rise that the graph's own task asks for [m]."""
    return task_of(load_jump(path, [*own], None)).rise


def settings_for(asked: Mapping[str, float], running: TrialOptions) -> list[str]:
    """Return the overrides of a graph for the task, the trial and the other options."""
    task = [f"plan.task.{key}={value!r}" for key, value in asked.items()]
    return [*trial_settings_of(running), *task, *(running.overrides or [])]


def load_jump(path: Path, settings: list[str], seed: int | None) -> Graph:
    """Load the graph, which has a block ``plan`` for a task, with its seed set.

    Raises:
        LoadError: the graph may not run.
        AloftError: it does not plan.
    """
    from ..blocks.jumping.jump_plan import JumpPlan
    from ..runtime.graph import load
    from ..studies.batch.seeds import overrides_for

    loaded = load(path, settings)
    planning = [s.path for s in loaded.checked.blocks if issubclass(s.block_type, JumpPlan)]
    if planning != ["plan"]:
        raise AloftError(
            f"{path} does not jump by a plan: it needs a block 'plan' that uses blocks.JumpPlan"
        )
    return loaded if seed is None else load(path, overrides_for(loaded, settings, seed))


def task_of(graph: Graph) -> JumpTask:
    """Return the task that a graph's plan is for."""
    from ..blocks.jumping.jump_plan import JumpPlan, read_or_make_task
    from ..runtime.language.block import Clock, Context

    checked = graph.checked
    spec = checked.block("plan")
    context = Context("plan", Clock(checked.base_period), robot=checked.robot, folder=spec.folder)
    assert isinstance(spec.params, JumpPlan.Params)
    return read_or_make_task(spec.params.task, context)


def plan_of(task: JumpTask, graph: Graph, nearest: bool, out: Console) -> dict[str, Any]:
    """Plan the task as the graph will, show the plan, and return it as in ``aloft plan --json``."""
    from .shared.planning import plan_task

    row = plan_task(task, library_of(graph), False, None, nearest, out, tests=False)
    if row["success"]:
        say(out, f"the plan is valid: it passes all {len(row['tests'])} tests with exact dynamics")
    return row


def library_of(graph: Graph) -> PlanLibrary:
    """Return the library of a graph's plan."""
    from ..blocks.jumping.jump_plan import JumpPlan, plan_library

    params, robot = graph.checked.block("plan").params, graph.checked.robot
    assert isinstance(params, JumpPlan.Params) and robot is not None
    return plan_library(params, robot)
