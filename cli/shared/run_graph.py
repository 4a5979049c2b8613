"""Runs a graph once, or once for each of many seeds, and prints the result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import typer

from ...runtime.language.errors import ExitCode
from ...runtime.running.run_result import RunResult
from ...runtime.running.sink import Sink
from .output import (
    number,
    print_error,
    print_json,
    print_location,
    print_warning,
    say,
    stopped_by_signals,
    table,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from ...logs.recording.recorder import Recorder
    from ...logs.recording.recorder_link import RecorderLink
    from ...logs.viewing.viewer import Viewer
    from ...runtime.language.stages import CheckedGraph
    from ...runtime.running.real_time import RealTimeOptions
    from ...studies.batch.seeds import SeedRow
    from .plain_console import Table


class RunnableGraph(Protocol):
    """The object that ``run_once`` runs: a graph, or one machine's part of it."""

    @property
    def checked(self) -> CheckedGraph:
        """The graph that runs."""

    def run(
        self,
        *,
        sinks: Sequence[Sink],
        log: bool,
        plain: bool,
        fuse: bool,
        real_time: RealTimeOptions,
    ) -> RunResult:
        """Run it once."""

    def about(self) -> Mapping[str, Any]:
        """Return the entries of the JSON object beside the result of the run."""


@dataclass(frozen=True)
class OneRunOptions:
    """The options of recording, printing and computing one run.

    Attributes:
        record: where the recording goes; none: nowhere.
        keep: how many earlier recordings of that name are kept.
        split: the time of the graph after which a new recording begins [s]; zero: never.
        as_json: whether one JSON object is printed.
        verbose: whether all metrics and the times of blocks are printed.
        traceback: whether the whole traceback of a block that fails is printed.
        plain: whether nothing is compiled.
        fuse: whether blocks of kernels that follow each other are one call.
        real_time: what the control thread asks of the operating system.
    """

    record: Path | None = None
    keep: int = 0
    split: float = 0.0
    as_json: bool = False
    verbose: bool = False
    traceback: bool = False
    plain: bool = False
    fuse: bool = True
    real_time: RealTimeOptions | None = None


def run_once(
    graph: RunnableGraph,
    options: OneRunOptions,
    out: Console,
    *,
    sinks: Sequence[Sink] = (),
    viewer: Viewer | None = None,
    link: RecorderLink | None = None,
    messages: Sequence[str] = (),
    also: Mapping[str, Any] | None = None,
) -> ExitCode:
    """Run the graph, record and show it, and print the result; ``link`` is the recorder's process if
    it was started early, ``messages`` are warnings so far, and ``also`` is what else the JSON object
    has."""
    from ...runtime.running.freeze_guard import FreezeGuard
    from ...runtime.running.real_time import NO_REAL_TIME
    from .output import compiling_shown, progress_bar

    name, record, as_json = graph.checked.name, options.record, options.as_json
    recorder = None
    if record is not None or viewer is not None:
        from ...logs.recording.recorder import Recorder

        live = viewer.source if viewer is not None else ""
        recorder = Recorder(
            record, keep=options.keep, split=options.split, live=live, link=link,
            on_warning=print_warning,
        )  # fmt: skip
    with (
        progress_bar(out, f"running {name}", graph.checked.ticks) as (progress, task),
        compiling_shown(progress),
    ):
        counter = TickCounter(progress, task)
        recorders = [recorder] if recorder is not None else []
        last_words = CrashReporter(name, as_json)
        with FreezeGuard(graph.checked, as_json=as_json) as guard:
            result = graph.run(
                sinks=[*recorders, counter, last_words, *sinks, guard], log=False,
                plain=options.plain, fuse=options.fuse,
                real_time=options.real_time or NO_REAL_TIME,
            )  # fmt: skip
    kept = _kept_recording(recorder, record) if recorder is not None else KeptRecording()
    files = [str(file) for file in recorder.files] if recorder is not None else []
    return report_run(
        out, graph.checked, result, kept, as_json=as_json, traceback=options.traceback,
        verbose=options.verbose, first=also or {},
        last={"warnings": [*messages, *result.warnings], "files": files, **graph.about()},
    )  # fmt: skip


@dataclass(frozen=True)
class KeptRecording:
    """The recording of a run, as it is reported.

    Attributes:
        path: where it is, if there is one.
        problem: what of it is missing, as an error; empty if nothing is.
        missing: printed behind the path.
        lines: printed below that.
    """

    path: Path | None = None
    problem: str = ""
    missing: str = ""
    lines: Sequence[str] = ()


def _kept_recording(recorder: Recorder, record: Path | None) -> KeptRecording:
    problem = recorder.problem if record is not None else ""
    if recorder.recording is None:
        return KeptRecording(problem=problem)
    missing = f" ({recorder.missing} ticks are not in it)" if recorder.missing else ""
    lines = [recorder.before] if recorder.before else []
    if recorder.files:
        names = ", ".join(file.name for file in recorder.files)
        lines.insert(0, f"the recording is in {len(recorder.files)} files: {names}")
    return KeptRecording(recorder.recording, problem, missing, lines)


def report_run(
    out: Console,
    graph: CheckedGraph,
    result: RunResult,
    recording: KeptRecording,
    *,
    as_json: bool,
    traceback: bool,
    verbose: bool = True,
    tables: Sequence[Table] = (),
    warnings: Sequence[str] = (),
    first: Mapping[str, Any] = {},
    last: Mapping[str, Any] = {},
) -> ExitCode:
    """Print the result of a run, in one process or on several machines, for people or as JSON.

    Args:
        recording: its recording.
        verbose: whether all metrics and the times of blocks are printed.
        tables: printed behind the metrics.
        warnings: printed beside those of the blocks.
        first: what the JSON object has before the result.
        last: what it has behind the result, or in place of entries of it.

    Returns:
        The exit code.
    """
    from .viewing import how_to_view

    path, problem = recording.path, recording.problem
    code = code_with_recording(result.exit_code, problem)
    print_result(out, graph.name, result, verbose=verbose)
    for each in tables:
        out.print(each)
    if path is not None:
        say(out, f"recording: {path}{recording.missing}; to see it: {how_to_view(path)}")
    for line in recording.lines:
        say(out, line)
    for warning in (*result.block_warnings, *result.stop_problems, *warnings):
        print_warning(warning)
    if as_json:
        about = {**result.to_json(), "recording": str(path) if path else None}
        about |= {"exit_code": int(code), "recording_problem": problem or None, **last}
        print_json({"graph": graph.name, "overrides": dict(graph.overrides), **first, **about})
    else:
        print_verdict(result)
        if result.error is not None:
            print_location(result.error, traceback=traceback)
    if problem:
        print_error(problem)
    return code


MOST_METRIC_COLUMNS = 5


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
    from ...studies.batch.seeds import run_seeds
    from .output import progress_bar

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


FIRST_METRICS = 6
"""Metrics that are printed without --verbose, of those that are not zero; those of blocks that judge the
run come first."""


def print_result(out: Console, name: str, result: RunResult, *, verbose: bool) -> None:
    """Print the metrics and the times of a run; the first few metrics only, unless ``verbose``."""
    metrics = [(key, number(value)) for key, value in result.metrics.items()]
    if metrics:
        nonzero = [(key, number(value)) for key, value in result.metrics.items() if value]
        shown = metrics if verbose else nonzero[:FIRST_METRICS]
        out.print(table(f"{name}: metrics", ("metric", ">value"), shown))
        if left := len(metrics) - len(shown):
            say(out, f"{left} more metrics, and the times of blocks: --verbose")
    rows = [
        (path, str(t.calls), f"{t.p50_us:.1f}", f"{t.p99_us:.1f}", f"{t.max_us:.1f}")
        for path, t in result.blocks.items()
    ]
    columns = ("block", ">runs", ">median [us]", ">99 % [us]", ">longest [us]")
    if verbose:
        out.print(table(f"{name}: time a run of each block takes", columns, rows))
    speed = result.duration_s / result.wall_time_s if result.wall_time_s else 0.0
    say(
        out,
        f"{result.ticks} ticks, {result.duration_s:.3f} s of the graph in "
        f"{result.wall_time_s:.2f} s ({speed:.1f} x real time); run hash {result.run_hash}",
    )
    if result.lateness is not None:
        say(out, f"{result.lateness}; {result.skipped_periods} periods skipped")


def print_verdict(result: RunResult) -> None:
    """Print whether the run succeeded and why, also with ``--quiet``."""
    if result.success:
        typer.secho(f"success: {result.reason}", fg=typer.colors.GREEN)
    else:
        typer.secho(f"no success: {result.reason}", fg=typer.colors.RED, err=True)


def code_with_recording(code: ExitCode, problem: str) -> ExitCode:
    """Return the exit code of a run whose own is ``code``, where ``problem`` says what of its
    recording is missing: a run that failed by itself keeps its own."""
    return ExitCode.NOT_RECORDED if problem and code is ExitCode.SUCCESS else code


class CrashReporter(Sink):
    """A sink that prints the JSON object of an abandoned run; it records nothing.

    Args:
        name: what the graph is called.
        as_json: whether the object is printed; the reason goes to standard error in any case.
    """

    def __init__(self, name: str, as_json: bool) -> None:
        self._name = name
        self._as_json = as_json

    def abandoned(self, result: RunResult) -> None:
        """Print the result."""
        if self._as_json:
            print_json({"graph": self._name, **result.to_json()})


TICKS_A_STEP = 100
"""Ticks between two updates of the bar: the control thread pays microseconds for each."""


class TickCounter(Sink):
    """A sink that moves a progress bar."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress = progress
        self._task = task

    def record(self, tick: int) -> None:
        """Move the bar now and then."""
        if tick % TICKS_A_STEP == 0:
            self._progress.update(self._task, completed=tick)
