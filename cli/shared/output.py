"""Prints what the verbs have to say: tables for people, one JSON object for programs, progress, and errors."""

from __future__ import annotations

import json
import math
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import typer

from ...files.problems import LoadError
from ...runtime.language.errors import AloftError, ExitCode, RunError
from .plain_console import AS_IT_IS, NoProgress, PlainConsole, Table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID


SET_HELP = "Set a parameter: block.parameter=value. Repeatable."


def console(*, to_stderr: bool = False, quiet: bool = False) -> Console:
    """Return Rich's console on standard output, or on standard error where JSON goes to the former; where that is no
    terminal, one that prints what is simple without Rich."""
    made = PlainConsole(to_stderr, quiet)
    return cast("Console", made) if made.suffices() else made.rich


table = Table
"""Makes a table from its title, its columns and the texts of its rows."""


def say(out: Console, text: str) -> None:
    """Print a line as it is, without markup and without wrapping."""
    out.print(text, **AS_IT_IS)


def number(value: Any) -> str:
    """Format a metric for a table: floats with four significant digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def plain(value: Any) -> Any:
    """Convert ``value`` to one that JSON can hold: numbers that are not finite become null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if hasattr(value, "tolist"):
        return plain(value.tolist())  # NumPy's scalars and arrays
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def print_json(value: Mapping[str, Any]) -> None:
    """Print one JSON object on one line of its own: the last thing on standard output."""
    sys.stdout.write(json.dumps(plain(value), allow_nan=False) + "\n")
    sys.stdout.flush()


def print_error(message: str) -> None:
    """Print an error for a person, on standard error."""
    typer.secho("error: ", fg=typer.colors.RED, bold=True, nl=False, err=True)
    typer.echo(message, err=True)


def print_warning(message: str) -> None:
    """Print a warning on standard error."""
    typer.secho("warning: ", fg=typer.colors.YELLOW, bold=True, nl=False, err=True)
    typer.echo(message, err=True)


def print_location(error: RunError, *, traceback: bool) -> None:
    """Print, on standard error, where a block failed: the line, or the whole traceback."""
    if traceback and error.traceback:
        typer.echo(error.traceback, err=True)
    elif error.where:
        typer.echo(f"  raised at {error.where}; --traceback shows how it came there", err=True)


@contextmanager
def errors_reported(as_json: bool, *, traceback: bool = False) -> Iterator[None]:
    """Turn what aloft raises on purpose into a message and the exit code that belongs to it."""
    try:
        yield
    except LoadError as error:
        if as_json:
            print_json(
                {"success": False, "reason": error.report.headline(), **error.report.as_json()}
            )
        else:
            console(to_stderr=True).print(error.report.rich(), soft_wrap=True)
        raise typer.Exit(ExitCode.BAD_INPUT) from error
    except AloftError as error:
        code = error.exit_code if isinstance(error, RunError) else ExitCode.BAD_INPUT
        where = getattr(error, "where", "")  # of a module that cannot be imported
        if as_json:
            details = error.to_json() if isinstance(error, RunError) else {}
            details |= {"where": str(where)} if where else {}
            print_json({"success": False, "reason": str(error), **details})
        else:
            print_error(f"{where}: {error}" if where else str(error))
            if traceback and isinstance(error, RunError):
                print_location(error, traceback=True)
        raise typer.Exit(code) from error


@contextmanager
def progress_bar(out: Console, text: str, total: int | None) -> Iterator[tuple[Progress, TaskID]]:
    """Show a progress bar that disappears at the end. It is not drawn if the output is no terminal."""
    if not out.is_terminal:
        yield cast("Progress", NoProgress(out)), cast("TaskID", 0)
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(
        *columns,
        TimeElapsedColumn(),
        console=out,
        transient=True,
        refresh_per_second=5,
    ) as progress:
        yield progress, progress.add_task(text, total=total)


MANY_KERNELS = 10
"""Least number of kernels whose compilation is announced; fewer take some seconds only."""


@contextmanager
def compiling_shown(progress: Progress) -> Iterator[None]:
    """Show a second bar while kernels are compiled, which only the first run on a machine does; a line
    where there is no terminal."""
    from ...mathematics.compiling.compile_calls import watchers

    bars: list[TaskID] = []

    def watch(done: int, total: int) -> None:
        if not bars:
            if not progress.console.is_terminal and total >= MANY_KERNELS:
                say(progress.console, f"compiling {total} kernels, on the first run only")
            bars.append(progress.add_task("compiling, on the first run only", total=total))
        progress.update(bars[0], completed=done, visible=done < total)

    watchers.append(watch)
    try:
        yield
    finally:
        watchers.remove(watch)


@contextmanager
def stopped_by_signals() -> Iterator[list[signal.Signals]]:
    """Leave the block at the first SIGINT or SIGTERM; the list then holds that signal.

    Within the block it is a ``KeyboardInterrupt``, so what is under way can clean up. Compiled code
    that calls back makes another error of it (pydantic a ``PydanticSerializationError``), so once a
    signal came, any error that leaves the block counts as its consequence.
    """
    received: list[signal.Signals] = []

    def stop(number: int, _: object) -> None:
        received.append(signal.Signals(number))
        raise KeyboardInterrupt

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    except (Exception, KeyboardInterrupt):
        if not received:
            raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
