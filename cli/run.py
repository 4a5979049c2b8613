"""``aloft run``: run a graph once, or once for each of many seeds."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..runtime.language.errors import AloftError
from .shared.live_view import Live, Record, Rerun, leave_viewer, open_viewer, recorder_started
from .shared.options import (
    CompletedOverrides,
    JsonBesideTables,
    NoRecord,
    Quiet,
    expand_option_groups,
)
from .shared.output import (
    console,
    errors_reported,
    print_warning,
)
from .shared.run_graph import OneRunOptions, RunnableGraph, run_many, run_once

if TYPE_CHECKING:
    from ..runtime.live.parameter_endpoint import ParameterEndpoint


@dataclass(frozen=True)
class GraphOptions:
    """The options that change the graph, and the number and the duration of its runs."""

    overrides: CompletedOverrides = None
    seeds: Annotated[
        str, typer.Option(help="Run once per seed: 0:20 or 1,5,7. Sets every parameter 'seed'.")
    ] = ""
    duration: Annotated[
        str, typer.Option(help="Duration [s of the graph's time]; the same as --set duration=.")
    ] = ""


@dataclass(frozen=True)
class ObservationOptions:
    """The options of recording, showing and reaching a run."""

    record: Record = None
    rerun: Rerun = Live.NONE
    keep: Annotated[
        int, typer.Option(min=0, help="How many earlier recordings of the same name to keep.")
    ] = 0
    split: Annotated[
        str,
        typer.Option(
            help="Continue in a new recording after every such time of the graph, e.g. '10 min'."
        ),
    ] = ""
    no_record: NoRecord = False
    params: Annotated[
        str,
        typer.Option(
            help="The name by which `aloft params` reaches this run; by default that of the graph if "
            "the run is in real time. 'none': not at all."
        ),
    ] = ""
    paused: Annotated[
        bool,
        typer.Option(
            "--paused",
            help="Begin paused and wait at the end: the page of `aloft graph --live` lets the run go "
            "on, step and go back.",
        ),
    ] = False


@dataclass(frozen=True)
class PrintingOptions:
    """The options of printing."""

    as_json: JsonBesideTables = False
    quiet: Quiet = False
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print all metrics and the times of blocks.")
    ] = False
    traceback: Annotated[
        bool, typer.Option("--traceback", help="Print the whole traceback of a block that fails.")
    ] = False


@dataclass(frozen=True)
class PartOptions:
    """The options that choose the parts of a graph on several machines that run here."""

    machine: Annotated[
        str, typer.Option(help="Run only the part of this machine, together with the others.")
    ] = ""
    local: Annotated[
        bool, typer.Option("--local", help="Run the parts of all machines as processes here.")
    ] = False
    keys: Annotated[
        Path | None,
        typer.Option(
            help="Links over TLS: the folder that `aloft keys` wrote, or this machine's part of it."
        ),
    ] = None


@dataclass(frozen=True)
class CompilingOptions:
    """The options of compiling."""

    plain: Annotated[
        bool,
        typer.Option("--plain", help="Compile nothing: slower, with the same bytes."),
    ] = False
    check_bounds: Annotated[
        bool,
        typer.Option(
            "--check-bounds",
            help="Compile nothing and check every index of a kernel: one beyond its array fails.",
        ),
    ] = False
    fuse: Annotated[bool, typer.Option(help="Run consecutive compiled blocks as one call.")] = True


@dataclass(frozen=True)
class ThreadOptions:
    """The control thread's requests to the operating system."""

    cpu: Annotated[
        int | None, typer.Option(min=0, help="Pin the control thread to this processor.")
    ] = None
    priority: Annotated[
        int | None,
        typer.Option(help="Run the control thread with SCHED_FIFO at this priority, 1 to 99."),
    ] = None
    lock_memory: Annotated[
        bool, typer.Option("--lock-memory", help="Lock all memory (mlockall).")
    ] = False


@expand_option_groups
def run(
    graph: Annotated[Path, typer.Argument(help="The graph file.")],
    changes: GraphOptions,
    observation: ObservationOptions,
    printing: PrintingOptions,
    parts: PartOptions,
    compiling: CompilingOptions,
    thread: ThreadOptions,
) -> None:
    """Run a graph, print the verdict and the first metrics, and write a recording."""
    from ..runtime.graph import load
    from ..runtime.running.real_time import NO_REAL_TIME, RealTimeOptions

    as_json, traceback = printing.as_json, printing.traceback
    plain = compiling.plain or compiling.check_bounds
    duration = [f"duration={changes.duration}"] if changes.duration else []
    settings = [*(changes.overrides or []), *duration]
    out = console(to_stderr=as_json, quiet=printing.quiet)
    with errors_reported(as_json, traceback=traceback):
        thread_options = RealTimeOptions(thread.cpu, thread.priority, thread.lock_memory)
        check_combination(changes.seeds, observation, parts, thread_options != NO_REAL_TIME)
        if parts.local:
            from .shared.run_machines import RunOptions, run_local

            recorded = not observation.no_record
            options = RunOptions(
                settings, observation.record if recorded else None, recorded, observation.params,
                as_json, traceback, plain, parts.keys, compiling.fuse,
            )  # fmt: skip
            code = run_local(graph, options, out)
        elif changes.seeds:
            from ..studies.batch.seeds import parse_seeds

            seeds = parse_seeds(changes.seeds)
            code = run_many(graph, settings, seeds, out, as_json, plain=plain, fuse=compiling.fuse)
        else:
            with recorder_started(wanted=not observation.no_record) as link:
                loaded: RunnableGraph = load(graph, settings)
                name = loaded.checked.name
                if parts.machine:
                    from .shared.run_machines import MachineRun

                    loaded = MachineRun(loaded.checked, parts.machine, parts.keys)
                    name = f"{name}-{parts.machine}"
                endpoint = open_endpoint(
                    loaded, observation.params, name, paused=observation.paused
                )
                if observation.paused:
                    page = f"`aloft graph --live --run {observation.params or name}`"
                    typer.echo(f"the run begins paused; {page} shows where it goes on", err=True)
                messages: list[str] = []
                viewer = open_viewer(observation.rerun, messages)
                default = Path("recordings") / f"{name}.rrd"
                one_run = OneRunOptions(
                    record=None if observation.no_record else observation.record or default,
                    keep=observation.keep, split=split_time(observation.split), as_json=as_json,
                    verbose=printing.verbose, traceback=traceback, plain=plain, fuse=compiling.fuse, real_time=thread_options,
                )  # fmt: skip
                sinks = [endpoint] if endpoint is not None else []
                code = run_once(
                    loaded, one_run, out, sinks=sinks, viewer=viewer, link=link, messages=messages
                )
                if viewer is not None:
                    leave_viewer(viewer, wait=not as_json and sys.stdin.isatty())
    raise typer.Exit(code)


def check_combination(
    seeds: str, observation: ObservationOptions, parts: PartOptions, real_time: bool
) -> None:
    """Raise ``AloftError`` where options do not go together."""
    if seeds and observation.record is not None:
        raise AloftError("--record is for one run; with --seeds nothing is recorded")
    if seeds and observation.rerun is not Live.NONE:
        raise AloftError("--rerun is for one run; with --seeds nothing is shown")
    if observation.paused and (seeds or parts.machine or parts.local):
        raise AloftError(
            "--paused is for one run in one process, without --seeds, --machine and --local"
        )
    if observation.paused and observation.params == "none":
        raise AloftError("--paused needs the page; --params none lets nobody reach the run")
    if (parts.machine or parts.local) and (seeds or (parts.machine and parts.local)):
        raise AloftError("choose one of --machine, --local and --seeds")
    if parts.keys is not None and not (parts.machine or parts.local):
        raise AloftError("--keys is for links between machines: --machine NAME, or --local")
    if real_time and (seeds or parts.local):
        raise AloftError("--cpu, --priority and --lock-memory are for one run, in one process")


def split_time(text: str) -> float:
    """Parse the time [s] in ``--split``; zero if it is empty. Raises ``AloftError``."""
    from ..runtime.language.errors import UnitError
    from ..runtime.language.units import parse_quantity

    if not text:
        return 0.0
    try:
        found = parse_quantity(text, "s")
    except UnitError as error:
        raise AloftError(f"--split {text}: {error}") from error
    if found <= 0.0:
        raise AloftError(f"--split {text}: expected a time above zero, e.g. '10 min'")
    return found


def open_endpoint(
    graph: RunnableGraph, name: str, default: str, *, paused: bool = False
) -> ParameterEndpoint | None:
    """Open the endpoint at which ``aloft params`` reaches the run. Unless it was asked for, it may fail."""
    from .shared import running_graphs

    if name == "none" or not (name or paused or graph.checked.clock.kind != "free"):
        return None
    try:
        return running_graphs.open_endpoint(name or default, paused=paused)
    except AloftError as error:
        if name or paused:
            raise
        print_warning(f"`aloft params` cannot reach this run: {error}")
        return None
