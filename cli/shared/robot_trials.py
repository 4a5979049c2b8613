"""Common parts of the verbs that run a robot in its trial: robot, trial and seeds, and the
recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...runtime.language.errors import AloftError, UnitError
from .options import NoRecord, Overrides
from .output import say

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True)
class TrialOptions:
    """The options that choose the graph and its trial."""

    robot: Annotated[
        str, typer.Option(help="The robot: its name, or a URDF, MJCF or YAML file.")
    ] = "bruce"
    graph: Annotated[
        Path | None, typer.Option(help="The graph; by default the robot's shipped one.")
    ] = None
    trial: Annotated[
        str,
        typer.Option(
            help="nominal, standard, robust, real, warm or uneven; by default as the graph says."
        ),
    ] = ""
    seed: Annotated[int, typer.Option(min=0, help="The seed of the trial.")] = 0
    seeds: Annotated[
        str, typer.Option(help="Run once per seed: 0:20 or 1,5,7; nothing is recorded.")
    ] = ""
    overrides: Overrides = None


@dataclass(frozen=True)
class RecordOptions:
    """The options of recording a run."""

    record: Annotated[
        Path | None,
        typer.Option(help="Where the recording goes; by default recordings/ and the verb's name."),
    ] = None
    no_record: NoRecord = False

    def path_for(self, verb: str) -> Path | None:
        """Return the path of the recording; ``None`` without one."""
        return None if self.no_record else self.record or Path("recordings") / f"{verb}.rrd"


def require_one_or_many(running: TrialOptions, recording: RecordOptions) -> None:
    """Raise ``AloftError`` where many seeds are to be run with an option for one run only."""
    if running.seeds and (recording.record is not None or running.seed):
        raise AloftError("--seeds runs many seeds and records nothing: leave out --seed, --record")


def trial_settings_of(running: TrialOptions) -> list[str]:
    """Return the overrides of a graph for the requested trial, before the user's own."""
    from ...files.nodes import text_of
    from ...studies.trials import trial_settings

    return [f"{key}={text_of(value)}" for key, value in trial_settings(running.trial).items()]


def graph_of(robot: str) -> tuple[Path, list[str]]:
    """Return the shipped graph in which a robot jumps, and the settings that name robot and task
    there.

    A robot without a graph of its own, also one in a URDF, MJCF or YAML file, jumps in that of all
    robots.

    Raises:
        AloftError: there is no such robot.
    """
    from ...runtime.loading.reading.files import PREFIX, shipped_graphs

    known = jump_graphs()
    if robot in known:
        return known[robot], []
    path = shipped_graphs()[f"{PREFIX}robots/jump"]
    return path, [robot_setting(robot), f"plan.task={{rise: {FIRST_RISE}}}"]


FIRST_RISE = 0.1
"""Default height of the jump of a robot without a task of its own [m]."""


def jump_graphs() -> dict[str, Path]:
    """Return the shipped graph in which each robot jumps, by the robot's name."""
    from ...runtime.loading.reading.files import PREFIX, shipped_graphs

    return {
        name.removeprefix(f"{PREFIX}robots/").removesuffix("_jump"): path
        for name, path in shipped_graphs().items()
        if name.endswith("_jump") and name.startswith(f"{PREFIX}robots/")
    } | {"bruce": shipped_graphs()[f"{PREFIX}jump"]}


def robot_setting(robot: str) -> str:
    """Return the override that gives a graph a robot, by its name or its file.

    Raises:
        AloftError: there is no such robot.
    """
    from ...files.nodes import text_of
    from ...robots.description import path_of

    try:
        found = path_of(robot)
    except LookupError as error:
        raise AloftError(f"--robot {robot}: {error.args[0]}; or give a file: robot.urdf") from error
    return f"robot={text_of(robot if found.stem == robot else str(found.resolve()))}"


def about_robot(name: str, doing: str, out: Console) -> dict[str, Any]:
    """Say what was guessed of a robot whose file says little, and return it for the JSON object.

    Raises:
        AloftError: the robot cannot stand, so it cannot do what is asked for; the message says why.
    """
    from ...robots.description import path_of, read
    from ...studies.check_up import obstacles_to_jumping

    found = read(path_of(name))
    for note in found.notes:
        say(out, f"  - {note}")
    wrong = obstacles_to_jumping(found.description)
    if wrong:
        raise AloftError(f"{found.description.name} cannot {doing}: {'; '.join(wrong)}")
    return {"guessed": list(found.notes)}


def quantity(name: str, text: str, unit: str, example: str) -> float:
    """Parse a quantity of the command line in ``unit``; it must say its own."""
    from ...runtime.language.units import parse_quantity

    try:
        float(text)
    except ValueError:
        pass
    else:
        raise AloftError(
            f"--{name} {text}: the unit is missing; expected such as --{name} {example}"
        )
    try:
        return parse_quantity(text, unit)
    except UnitError as error:
        raise AloftError(
            f"--{name} {text}: {error}; expected such as --{name} {example}"
        ) from error
