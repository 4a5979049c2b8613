"""Prints the result of a run: its metrics, the time each block took, and the verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from ...runtime.language.errors import ExitCode
from ..shared.output import number, say, table

if TYPE_CHECKING:
    from rich.console import Console

    from ...runtime.running.run_result import RunResult


def print_result(out: Console, name: str, result: RunResult, *, times: bool = True) -> None:
    """Print the metrics and the times of a run."""
    metrics = [(key, number(value)) for key, value in result.metrics.items()]
    if metrics:
        out.print(table(f"{name}: metrics", ("metric", ">value"), metrics))
    rows = [
        (path, str(t.calls), f"{t.p50_us:.1f}", f"{t.p99_us:.1f}", f"{t.max_us:.1f}")
        for path, t in result.blocks.items()
    ]
    columns = ("block", ">runs", ">median [us]", ">99 % [us]", ">longest [us]")
    if times:
        out.print(table(f"{name}: time a run of each block takes", columns, rows))
    speed = result.duration_s / result.wall_time_s if result.wall_time_s else 0.0
    say(
        out,
        f"{result.ticks} ticks, {result.duration_s:.3f} s of the graph in "
        f"{result.wall_time_s:.2f} s ({speed:.1f} x real time); run hash {result.run_hash}",
    )
    if result.overruns:
        say(out, f"{result.overruns} overruns, {result.skipped_periods} periods skipped")


def print_verdict(result: RunResult) -> None:
    """Print whether the run succeeded and why, also with ``--quiet``."""
    if result.success:
        typer.secho(f"success: {result.reason}", fg=typer.colors.GREEN)
    else:
        typer.secho(f"no success: {result.reason}", fg=typer.colors.RED, err=True)


def code_with_recording(code: ExitCode, problem: str) -> ExitCode:
    """The exit code of a run whose own is ``code``, where ``problem`` says what of its recording is
    missing: a run that failed by itself keeps its own."""
    return ExitCode.NOT_RECORDED if problem and code is ExitCode.SUCCESS else code
