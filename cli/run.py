"""``aloft run``: run a graph once, or once for each of many seeds."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .running.run_output import code_with_recording, print_result, print_verdict
from .shared.options import CompletedOverrides, JsonBesideTables, NoRecord, Quiet
from .shared.output import (
    console,
    errors_reported,
    number,
    print_error,
    print_json,
    print_place,
    print_warning,
    say,
    table,
)
from .shared.stopping import stopped_by_signals

if TYPE_CHECKING:
    from rich.console import Console

    from ..logs.viewing.viewer import Viewer
    from ..runtime.language.stages import CheckedGraph
    from ..runtime.live.parameter_endpoint import ParameterEndpoint
    from ..runtime.running.real_time import RealTime
    from ..runtime.running.run_result import RunResult
    from ..runtime.running.sinks import Sink
    from ..studies.batch.seeds import SeedRow

MOST_METRIC_COLUMNS = 5


class Live(StrEnum):
    """Where a run is shown while it goes on."""

    NONE = "none"
    LIVE = "live"
    WEB = "web"


def run(
    graph: Annotated[Path, typer.Argument(help="The graph file.")],
    overrides: CompletedOverrides = None,
    seeds: Annotated[
        str, typer.Option(help="Run once a seed: 0:20 or 1,5,7. Sets every parameter 'seed'.")
    ] = "",
    duration: Annotated[
        str, typer.Option(help="How long [s of the graph's time]; the same as --set duration=.")
    ] = "",
    record: Annotated[
        Path | None,
        typer.Option(help="Where the recording goes; by default recordings/NAME.rrd."),
    ] = None,
    rerun: Annotated[
        Live, typer.Option(help="Show the run while it goes on: in a window, in a browser.")
    ] = Live.NONE,
    keep: Annotated[
        int, typer.Option(min=0, help="How many earlier recordings of that name are kept.")
    ] = 0,
    split: Annotated[
        str,
        typer.Option(help="Go on in a new recording after this time of the graph, e.g. '10 min'."),
    ] = "",
    no_record: NoRecord = False,
    params: Annotated[
        str,
        typer.Option(
            help="Let `aloft params` reach this run by that name; a run in real time is reached "
            "by its graph's name anyway. 'none': not at all."
        ),
    ] = "",
    as_json: JsonBesideTables = False,
    quiet: Quiet = False,
    traceback: Annotated[
        bool, typer.Option("--traceback", help="Print the whole traceback of a block that fails.")
    ] = False,
    machine: Annotated[
        str, typer.Option(help="Run only the part of this machine, together with the others.")
    ] = "",
    local: Annotated[
        bool, typer.Option("--local", help="Run the parts of all machines as processes here.")
    ] = False,
    keys: Annotated[
        Path | None,
        typer.Option(help="The folder of `aloft keys`, or this machine's own: links over TLS."),
    ] = None,
    plain: Annotated[
        bool,
        typer.Option("--plain", help="Compile nothing: slower, with the same bytes."),
    ] = False,
    fuse: Annotated[
        bool, typer.Option(help="Run blocks of kernels that follow each other as one call.")
    ] = True,
    cpu: Annotated[
        int | None, typer.Option(min=0, help="Pin the control thread to this processor.")
    ] = None,
    priority: Annotated[
        int | None,
        typer.Option(help="Run the control thread with SCHED_FIFO at this priority, 1 to 99."),
    ] = None,
    lock_memory: Annotated[
        bool, typer.Option("--lock-memory", help="Keep all memory in the machine's (mlockall).")
    ] = False,
) -> None:
    """Run a graph; print its metrics and the time each block took; write a recording."""
    from ..runtime.graph import load
    from ..runtime.running.real_time import NO_WISHES, RealTime
    from ..studies.batch.seeds import parse_seeds

    settings = [*(overrides or []), *([f"duration={duration}"] if duration else [])]
    out = console(to_stderr=as_json, quiet=quiet)
    with errors_reported(as_json, traceback=traceback):
        if seeds and record is not None:
            raise AloftError("--record is for one run; with --seeds nothing is recorded")
        if seeds and rerun is not Live.NONE:
            raise AloftError("--rerun is for one run; with --seeds nothing is shown")
        if (machine or local) and (seeds or (machine and local)):
            raise AloftError("choose one of --machine, --local and --seeds")
        if keys is not None and not (machine or local):
            raise AloftError("--keys is for links between machines: --machine NAME, or --local")
        wishes_of_thread = RealTime(cpu, priority, lock_memory)
        if wishes_of_thread != NO_WISHES and (seeds or local):
            raise AloftError("--cpu, --priority and --lock-memory are for one run, in one process")
        if local:
            from .running.run_local import Wishes, run_local

            place = None if no_record else record
            wishes = Wishes(
                settings, place, not no_record, params, as_json, traceback, plain, keys, fuse
            )
            code = run_local(graph, wishes, out)
        elif seeds:
            code = run_many(
                graph, settings, parse_seeds(seeds), out, as_json, plain=plain, fuse=fuse
            )
        else:
            loaded: Runs = load(graph, settings)
            name = loaded.checked.name
            if machine:
                from .running.run_part import Part

                loaded, name = Part(loaded.checked, machine, keys), f"{name}-{machine}"
            default = Path("recordings") / f"{name}.rrd"
            endpoint = open_endpoint(loaded, params, name)
            sinks = [endpoint] if endpoint is not None else []
            place = None if no_record else record or default
            said: list[str] = []
            viewer = open_viewer(rerun, said)
            code = run_once(
                loaded, place, out, as_json, sinks, viewer,
                keep=keep, split=split_time(split), said=said, traceback=traceback, plain=plain,
                fuse=fuse, real_time=wishes_of_thread,
            )  # fmt: skip
            if viewer is not None:
                leave_viewer(viewer, wait=not as_json and sys.stdin.isatty())
    raise typer.Exit(code)


def split_time(text: str) -> float:
    """The time [s] in ``--split``; zero if it is empty. Raises ``AloftError``."""
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


def open_viewer(live: Live, said: list[str]) -> Viewer | None:
    """Open the viewer that shows the run. Without a viewer the run is not shown, and ``said`` gets
    the reason."""
    from ..logs.viewing.viewer import ViewerError, start_viewer
    from .shared.viewing import open_page

    if live is Live.NONE:
        return None
    try:
        viewer = start_viewer("web" if live is Live.WEB else "window")
    except ViewerError as error:
        said.append(f"the run is not shown: {error}")
        print_warning(said[-1])
        return None
    if live is Live.WEB:
        typer.echo(f"live view: {viewer.page}", err=True)
        open_page(viewer.page)
    return viewer


def leave_viewer(viewer: Viewer, *, wait: bool) -> None:
    """Leave the viewer open after the run: a window until it is closed, a page until Ctrl-C."""
    from .shared.viewing import keep_open

    if viewer.kind != "web":
        return
    if wait and viewer.lives():
        keep_open(viewer)
    else:
        viewer.stop()


def open_endpoint(graph: Runs, name: str, default: str) -> ParameterEndpoint | None:
    """Open the endpoint at which ``aloft params`` reaches the run. Unless it was asked for, it may fail."""
    from .shared import endpoints

    if name == "none" or not (name or graph.checked.clock.kind != "free"):
        return None
    try:
        return endpoints.open_endpoint(name or default)
    except AloftError as error:
        if name:
            raise
        print_warning(f"`aloft params` cannot reach this run: {error}")
        return None


class Runs(Protocol):
    """What ``run_once`` runs: a graph, or one machine's part of it."""

    @property
    def checked(self) -> CheckedGraph:
        """The graph that runs."""

    def run(
        self, *, sinks: Sequence[Sink], log: bool, plain: bool, fuse: bool, real_time: RealTime
    ) -> RunResult:
        """Run it once."""

    def about(self) -> Mapping[str, Any]:
        """What the JSON object says beside the result of the run."""


def run_once(
    graph: Runs,
    record: Path | None,
    out: Console,
    as_json: bool,
    sinks: Sequence[Sink] = (),
    viewer: Viewer | None = None,
    *,
    keep: int = 0,
    split: float = 0.0,
    said: Sequence[str] = (),
    also: Mapping[str, Any] | None = None,
    times: bool = True,
    traceback: bool = False,
    plain: bool = False,
    fuse: bool = True,
    real_time: RealTime | None = None,
) -> ExitCode:
    """Run the graph, record and show it, and print the result; ``said`` are warnings so far,
    ``also`` is what else the JSON object has, and ``times`` says whether those of blocks are
    printed."""
    from ..logs.recording.recorder import Recorder
    from ..runtime.running.freeze_guard import FreezeGuard
    from ..runtime.running.real_time import NO_WISHES
    from .running.last_words import LastWords
    from .shared.progress import TickCounter, compiling_shown, progress_bar
    from .shared.viewing import how_to_view

    name = graph.checked.name
    recorder = None
    if record is not None or viewer is not None:
        live = viewer.source if viewer is not None else ""
        recorder = Recorder(record, keep=keep, split=split, live=live, on_warning=print_warning)
    with (
        progress_bar(out, f"running {name}", graph.checked.ticks) as (progress, task),
        compiling_shown(progress),
    ):
        counter = TickCounter(progress, task)
        recorders = [recorder] if recorder is not None else []
        last_words = LastWords(name, as_json)
        with FreezeGuard(graph.checked, as_json=as_json) as guard:
            result = graph.run(
                sinks=[*recorders, counter, last_words, *sinks, guard], log=False, plain=plain,
                fuse=fuse, real_time=real_time or NO_WISHES,
            )  # fmt: skip
    recording = recorder.recording if recorder is not None else None
    problem = recorder.problem if recorder is not None and record is not None else ""
    code = code_with_recording(result.exit_code, problem)
    print_result(out, name, result, times=times)
    if recorder is not None and recording is not None:
        missing = f" ({recorder.missing} ticks are not in it)" if recorder.missing else ""
        say(out, f"recording: {recording}{missing}; to see it: {how_to_view(recording)}")
        if recorder.files:
            say(out, f"the recording is in {len(recorder.files)} files: "
                f"{', '.join(file.name for file in recorder.files)}")  # fmt: skip
        if recorder.before:
            say(out, recorder.before)
    for problem in (*result.cautions, *result.stop_problems):
        print_warning(problem)
    if as_json:
        shown = str(recording) if recording else None
        overrides = dict(graph.checked.overrides)
        warnings = [*said, *result.warnings]
        files = [str(file) for file in recorder.files] if recorder is not None else []
        about = {**result.to_json(), "warnings": warnings, "recording": shown, "files": files}
        about |= {"exit_code": int(code), "recording_problem": problem or None}
        print_json(
            {"graph": name, "overrides": overrides, **(also or {}), **about, **graph.about()}
        )
    else:
        print_verdict(result)
        if result.error is not None:
            print_place(result.error, traceback=traceback)
    if problem:
        print_error(problem)
    return code


def run_many(
    path: Path,
    overrides: list[str],
    seeds: list[int],
    out: Console,
    as_json: bool,
    *,
    plain: bool = False,
    fuse: bool = True,
) -> ExitCode:
    """Run the graph once with each seed; print a row for each, and how many succeeded."""
    from ..studies.batch.seeds import run_seeds
    from .shared.progress import progress_bar

    rows: list[SeedRow] = []
    with (
        stopped_by_signals() as received,
        progress_bar(out, f"running {len(seeds)} seeds", len(seeds)) as (progress, task),
        closing(run_seeds(path, overrides, seeds, plain=plain, fuse=fuse)) as results,
    ):
        for row in results:
            rows.append(row)
            progress.advance(task)
    successes = sum(row.success for row in rows)
    reason = f"{successes} of {len(rows)} seeds succeeded"
    success = successes == len(seeds)
    code = ExitCode.SUCCESS if success else ExitCode.NOT_SUCCESSFUL
    if received:
        success, code = False, ExitCode(128 + received[0])
        reason = f"stopped by {received[0].name} after {len(rows)} of {len(seeds)} seeds"
    print_rows(out, rows)
    if as_json:
        summary = {"n": len(rows), "successes": successes, "seeds": seeds}
        outcome: dict[str, Any] = {"success": success, "reason": reason, "recording": None}
        outcome |= {"overrides": overrides, "summary": summary}
        print_json({**outcome, "rows": [vars(row) for row in rows]})
    else:
        typer.secho(reason, fg=typer.colors.GREEN if success else typer.colors.RED)
    return code


def print_rows(out: Console, rows: list[SeedRow]) -> None:
    """Print one line for each seed, with the first few metrics that differ between seeds."""
    values: dict[str, list[Any]] = {}
    for row in rows:
        for name, value in row.metrics.items():
            values.setdefault(name, []).append(value)
    differing = [name for name, found in values.items() if len(set(found)) > 1]
    names = differing[:MOST_METRIC_COLUMNS]
    out.print(
        table(
            "",
            (">seed", "success", *(f">{name}" for name in names), "reason"),
            [
                (
                    str(row.seed),
                    "yes" if row.success else "no",
                    *(number(row.metrics.get(name, "")) for name in names),
                    row.reason,
                )
                for row in rows
            ],
        )
    )
