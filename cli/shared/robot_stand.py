"""``aloft robot stand``: lets any robot stand, squat, and be pushed as it stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from ...runtime.language.errors import AloftError
from .options import JsonBesideTables, Quiet, expand_option_groups
from .output import console, errors_reported, say
from .robot_trials import (
    RecordOptions,
    TrialOptions,
    about_robot,
    quantity,
    require_one_or_many,
    robot_setting,
    trial_settings_of,
)
from .run_graph import OneRunOptions, run_many, run_once


@dataclass(frozen=True)
class StandOptions:
    """The options of standing."""

    squat: Annotated[
        str,
        typer.Option(
            help="Depth of a squat, down and up again: 6cm; by default the robot stands still."
        ),
    ] = ""
    push: Annotated[
        str,
        typer.Option(
            help="Push the torso forwards for 0.1 s, so that the robot's speed changes by this: 0.1m/s."
        ),
    ] = ""


@expand_option_groups
def stand(
    asked: StandOptions,
    running: TrialOptions,
    recording: RecordOptions,
    as_json: JsonBesideTables = False,
    quiet: Quiet = False,
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="The robot, as after --robot.", show_default=False)
    ] = "",
) -> None:
    """Let a robot stand in its trial, or squat: aloft robot stand go1.urdf --squat 6cm."""
    from ...runtime.graph import load
    from ...runtime.loading.reading.files import PREFIX, shipped_graphs
    from ...studies.batch.seeds import overrides_for, parse_seeds

    out = console(to_stderr=as_json, quiet=quiet)
    with errors_reported(as_json):
        require_one_or_many(running, recording)
        robot = named_once(name, running.robot)
        depth = quantity("squat", asked.squat, "m", "6cm") if asked.squat else 0.0
        speed = quantity("push", asked.push, "m/s", "0.1m/s") if asked.push else 0.0
        path = running.graph or shipped_graphs()[f"{PREFIX}robots/stand"]
        own = [] if running.graph else [robot_setting(robot)]
        about = about_robot(robot, "stand", out) if own else {}
        settings = [
            *own, *trial_settings_of(running),
            f"plan.squat_depth={depth!r}", f"push.speed_change={speed!r}", *(running.overrides or []),
        ]  # fmt: skip
        loaded = load(path, settings)
        assert loaded.checked.robot is not None
        does = f"squats by {100.0 * depth:g} cm" if depth else "stands"
        say(out, f"{loaded.checked.robot.name} {does}")
        if running.seeds:
            code = run_many(path, settings, parse_seeds(running.seeds), out, as_json)
        else:
            loaded = load(path, overrides_for(loaded, settings, running.seed))
            options = OneRunOptions(record=recording.path_for("stand"), as_json=as_json)
            also = {"asked": {"squat_depth": depth, "push_speed": speed}, **about}
            code = run_once(loaded, options, out, also=also)
    raise typer.Exit(code)


def named_once(name: str, option: str) -> str:
    """Return the robot of the argument or, without one, of the option. Raises ``AloftError`` for two."""
    if name and option not in (TrialOptions.robot, name):
        raise AloftError(f"two robots: {name} and --robot {option}; name one")
    return name or option
