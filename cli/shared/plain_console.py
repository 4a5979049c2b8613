"""Prints lines and tables where nothing is a terminal: in a pipe, a file, a service.

Rich makes the same text, but its import takes a twentieth of a short run. What is not as simple as most of what is
printed, such as markup, wide characters and tables beyond the width, goes through Rich here as well.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

WIDE = 200
"""Width of what has no edge to wrap at."""
AS_IT_IS: Mapping[str, Any] = {"markup": False, "emoji": False, "soft_wrap": True}
"""The options of Rich with which a text is printed without a change."""
_ASKS_FOR_A_TERMINAL = ("FORCE_COLOR", "TTY_COMPATIBLE")
"""Variables of the environment by which Rich takes anything, or nothing, for a terminal."""
_NOT_SIMPLE = re.compile(r"[^ -~]|:\S+:|^ | $")
"""Anything in a cell that Rich may change: what is not ASCII, a name of an emoji, space at an end."""
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f]|\n$")


@dataclass(frozen=True)
class Table:
    """A table without boxes. Columns whose name starts with ``>`` are aligned to the right."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    def __rich__(self) -> RichTable:
        from rich import box
        from rich.markup import escape
        from rich.table import Table as RichTable

        made = RichTable(
            title=self.title or None, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False
        )
        for column in self.columns:
            right = column.startswith(">")
            made.add_column(
                escape(column.removeprefix(">")),
                justify="right" if right else "left",
                overflow="fold",
            )
        for row in self.rows:
            made.add_row(*(escape(cell) for cell in row))
        return made

    def text(self) -> str | None:
        """Return what Rich makes of it, without its help; ``None`` where it is not that simple."""
        lines = [[name.removeprefix(">") for name in self.columns], *self.rows]
        cells = [self.title, *(cell for line in lines for cell in line)]
        count = len(self.columns)
        if len(lines) < 2 or any(len(line) != count for line in lines):
            return None
        widths = [max(len(line[k]) for line in lines) for k in range(count)]
        inner = sum(widths) + 3 * (count - 1)
        if any(map(_NOT_SIMPLE.search, cells)) or inner + 2 > WIDE or len(self.title) > inner + 2:
            return None
        right = [name.startswith(">") for name in self.columns]
        shown = [
            "   ".join(
                cell.rjust(width) if at_right else cell.ljust(width)
                for cell, width, at_right in zip(line, widths, right, strict=True)
            )
            for line in lines
        ]
        head, *body = (f" {line} " for line in shown)
        title = [self.title.ljust(inner + 2)] if self.title else []
        blank = " " * (inner + 2)
        return "\n".join([*title, blank, head, f" {'─' * inner} ", *body, blank])


class PlainConsole:
    """Stands for Rich's console on a stream that is no terminal.

    Args:
        to_stderr: whether it prints on standard error.
        quiet: whether it prints nothing.
    """

    is_terminal = False

    def __init__(self, to_stderr: bool, quiet: bool) -> None:
        self._to_stderr, self._quiet = to_stderr, quiet

    def suffices(self) -> bool:
        """Return whether its stream is no terminal, and Rich is not told otherwise."""
        asked = any(name in os.environ for name in _ASKS_FOR_A_TERMINAL)
        return not asked and not self.stream().isatty()

    @cached_property
    def rich(self) -> Console:
        """Rich's own console."""
        from rich.console import Console

        made = Console(stderr=self._to_stderr, quiet=self._quiet, highlight=False)
        if not made.is_terminal:
            made.width = WIDE
        return made

    def stream(self) -> Any:
        """Return the stream that it prints on now."""
        return sys.stderr if self._to_stderr else sys.stdout

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as Rich's console does."""
        text: str | None = None
        if len(objects) == 1 and isinstance(objects[0], Table) and not options:
            text = objects[0].text()
        elif len(objects) == 1 and isinstance(objects[0], str) and options == AS_IT_IS:
            text = None if _CONTROL.search(objects[0]) else objects[0]
        if text is None:
            self.rich.print(*objects, **options)
        elif not self._quiet:
            self.stream().write(text + "\n")
            self.stream().flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich, name)


class NoProgress:
    """Stands for Rich's bars of progress where none is drawn."""

    def __init__(self, out: Console) -> None:
        self.console = out

    def add_task(self, *_: Any, **__: Any) -> int:
        """Return the number of a bar that is nowhere."""
        return 0

    def update(self, *_: Any, **__: Any) -> None:
        """Draw nothing."""

    advance = update
