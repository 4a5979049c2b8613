"""Shows the progress of a run: a sink counts ticks, and a bar reads the count now and then."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from ...runtime.running.memory import BoundGraph

TICKS_A_STEP = 100
"""Ticks between two updates of the bar: the control thread pays microseconds for each."""


class TickCounter:
    """A sink that moves a progress bar."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress = progress
        self._task = task

    def open(self, bound: BoundGraph) -> None:
        """No-op: there is nothing to prepare."""

    def record(self, tick: int) -> None:
        """Move the bar now and then."""
        if tick % TICKS_A_STEP == 0:
            self._progress.update(self._task, completed=tick)

    def close(self) -> None:
        """No-op: there is nothing to finish."""


@contextmanager
def progress_bar(out: Console, text: str, total: int | None) -> Iterator[tuple[Progress, TaskID]]:
    """A progress bar that disappears at the end. It is not drawn if the output is no terminal."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(
        *columns,
        TimeElapsedColumn(),
        console=out,
        transient=True,
        disable=not out.is_terminal,
        refresh_per_second=5,
    ) as progress:
        yield progress, progress.add_task(text, total=total)


@contextmanager
def compiling_shown(progress: Progress) -> Iterator[None]:
    """Show a second bar while kernels are compiled, which only the first run on a machine does."""
    from ...mathematics.compiling.compile_calls import watchers

    bars: list[TaskID] = []

    def watch(done: int, total: int) -> None:
        if not bars:
            bars.append(progress.add_task("compiling, on the first run only", total=total))
        progress.update(bars[0], completed=done, visible=done < total)

    watchers.append(watch)
    try:
        yield
    finally:
        watchers.remove(watch)
