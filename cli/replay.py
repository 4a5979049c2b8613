"""``aloft replay``: executes a recorded run again, and prints where it differs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .shared.options import GraphFolder, JsonBesideTables, Quiet, Trust, opened_recording
from .shared.output import (
    SET_HELP,
    console,
    errors_reported,
    print_json,
    print_warning,
    say,
)
from .shared.replayed import as_data, print_differences, write_runs

if TYPE_CHECKING:
    from rich.console import Console

    from ..logs.replay.opened_run import OpenedRun
    from ..logs.replay.replay import Replayed


def replay(
    recording: Annotated[Path, typer.Argument(help="The recording, a .rrd file.")],
    check: Annotated[
        bool, typer.Option("--check", help="Exit with 1 unless every byte is the same.")
    ] = False,
    inputs: Annotated[
        Literal["auto", "seed", "recorded"],
        typer.Option(
            help="seed: run everything again; recorded: take what came from outside the graph, from a "
            "robot or simulator, from the recording; auto: seed for a simulation, else recorded."
        ),
    ] = "auto",
    first: Annotated[
        int | None, typer.Option("--from-tick", help="Begin at the last keyframe before this tick.")
    ] = None,
    until: Annotated[int | None, typer.Option("--until-tick", help="End before this tick.")] = None,
    swap: Annotated[
        list[str] | None,
        typer.Option(
            help="BLOCK=USE: run another block in the place of one, e.g. wbc=mypkg:MyWbc, and feed "
            "all others from the recording. Repeatable."
        ),
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", help=f"{SET_HELP} Runs that block alone, as --swap does."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Write recorded and replayed signals side by side to this .rrd file.",
        ),
    ] = None,
    folder: GraphFolder = None,
    trust: Trust = False,
    as_json: JsonBesideTables = False,
    quiet: Quiet = False,
) -> None:
    """Re-run a recording and check that it is bit-identical."""
    out = console(to_stderr=as_json, quiet=quiet)
    with errors_reported(as_json):
        opened = opened_recording(recording, folder, trust=trust)
        changed = changed_blocks(opened, swap or [], overrides or [])
        if changed and output is None:
            output = recording.with_name(f"{recording.stem}-replay.rrd")
        done = execute(opened, changed, inputs, first, until, output is not None, out)
        if not done.signals.compared:
            done.result.raise_if_failed()
        written = write_runs(output, opened, done) if output is not None else None
    for kept in opened.restored.said:
        print_warning(kept)
    other = opened.changed_dependencies() if done.first is not None else []
    verdict = describe(opened, done)
    print_differences(out, done)
    for note in done.notes:
        print_warning(note)
    for difference in other:
        print_warning(f"since the recording was made: {difference}")
    if written is not None:
        say(out, f"recorded and replayed side by side: {written}")
    if as_json:
        restored = list(opened.restored.said)
        print_json(as_data(recording, done, verdict, other, restored, written))
    else:
        same = done.identical
        color = typer.colors.GREEN if same else typer.colors.YELLOW
        typer.secho(verdict, fg=color, err=check and not same)
    raise typer.Exit(ExitCode.NOT_SUCCESSFUL if check and not done.identical else ExitCode.SUCCESS)


def changed_blocks(opened: OpenedRun, swaps: list[str], sets: list[str]) -> dict[str, list[str]]:
    """Return the changes as overrides, by block. Raises ``AloftError``."""
    from ..runtime.language.registry import find_block

    changed: dict[str, list[str]] = {}
    known = opened.file.header.order
    for text, form, suffix in (
        *((text, "--swap block=mypkg:MyBlock", ".use") for text in swaps),
        *((text, "--set block.parameter=value", "") for text in sets),
    ):
        name, equals, value = text.partition("=")
        block = name if suffix else name.partition(".")[0]
        if not equals or not value or (not suffix and "." not in name):
            raise AloftError(f"{text!r} changes nothing; write {form}")
        if block not in known:
            raise AloftError(f"the recorded graph has no block {block!r}; it has {_list(known)}")
        if suffix and ":" in value:
            find_block(value, Path.cwd())  # also a file in this folder
        changed.setdefault(block, []).append(f"{name}{suffix}={value}")
    return changed


def _list(names: tuple[str, ...]) -> str:
    return ", ".join(name for name in names if "~" not in name)


def execute(
    opened: OpenedRun,
    changed: dict[str, list[str]],
    inputs: Literal["auto", "seed", "recorded"],
    first: int | None,
    until: int | None,
    keep: bool,
    out: Console,
) -> Replayed:
    """Replay, with a progress bar. Raises ``AloftError``."""
    from ..logs.replay.replay import replay as replay_run
    from .shared.output import progress_bar
    from .shared.run_graph import TickCounter

    if first is not None and until is not None and until <= first:
        raise AloftError(
            f"--from-tick {first} --until-tick {until} is no stretch of the run: the end must lie behind the "
            f"beginning, e.g. --from-tick {first} --until-tick {first + 100}"
        )
    settings = [text for texts in changed.values() for text in texts]
    graph = opened.changed(settings) if settings else opened.graph
    end = min(until or int(opened.ticks[-1]) + 1, int(opened.ticks[-1]) + 1)
    total = end - max(int(opened.ticks[0]), first or 0)
    with progress_bar(out, f"replaying {graph.name}", total) as (progress, task):
        return replay_run(
            opened,
            graph=graph,
            inputs=None if inputs == "auto" else inputs,
            run=list(changed) or None,
            first_tick=first,
            last_tick=until,
            keep=keep,
            sinks=[TickCounter(progress, task)],
        )


def describe(opened: OpenedRun, done: Replayed) -> str:
    """Describe the verdict in one line."""
    ticks, states = done.signals.compared, done.states.compared
    ran = "all blocks" if len(done.ran) == len(done.bound.blocks) else ", ".join(done.ran)
    what = f"{ticks} ticks from {done.first_tick} on"
    if done.first is not None:
        return f"differs first at {done.first}"
    if done.notes:
        return f"equal where it can be compared, but: {done.notes[0]}"
    also = f", and the state at {states} keyframe{'s' * (states != 1)}" if states else ""
    cut = ""
    if opened.file.outcome is None:
        cut = f"; the recording was cut off after tick {int(opened.ticks[-1])}"
    return f"identical: every byte of {what}{also} ({ran}){cut}"
