"""What the command line says while it works."""

import io
from typing import Any

import pytest
from rich.console import Console

from aloft.cli.shared.output import MANY_KERNELS, compiling_shown, console, progress_bar, say, table
from aloft.cli.shared.plain_console import WIDE, PlainConsole
from aloft.mathematics.compiling.compile_calls import watchers


@pytest.mark.parametrize(
    ("total", "text"),
    [
        (MANY_KERNELS, f"compiling {MANY_KERNELS} kernels, on the first run only\n"),
        (MANY_KERNELS - 1, ""),
    ],
)
def test_without_a_terminal_many_kernels_are_announced_once(total: int, text: str) -> None:
    out = Console(file=io.StringIO(), width=100)
    with progress_bar(out, "running", None) as (progress, _), compiling_shown(progress):
        for done in range(total):
            watchers[-1](done, total)
    assert out.file.getvalue() == text  # type: ignore[attr-defined]
    assert not watchers


TABLES = [
    ("", ("a", ">b"), [("one", "2")]),
    ("metrics", ("metric", ">value"), [("height_m", "0.12"), ("a_longer_name", "1e-05")]),
    ("a title that is wider than all", (">x",), [("1",)]),
    ("t", ("", ""), [("file", "x.rrd"), ("", "[bold]5[/]")]),
    ("units", ("block", ">mean"), [("wbc", "7 µs"), (":boom: x", "1")]),
    ("wide", ("a", "b"), [("x" * 150, "y" * 80)]),
    ("edges", ("a", "b", "c"), [(" left", "right ", ""), ("two\nlines", "b", "c")]),
    ("no rows", ("a", "b"), []),
    ("", ("order", "block", ">rate"), [("1", "robot", "500 Hz"), ("2", "estimator", "500 Hz")]),
]


@pytest.fixture(autouse=True)
def _nobody_asks_for_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(("title", "columns", "rows"), TABLES)
def test_a_table_in_a_pipe_is_rich_s_own(
    title: str, columns: tuple[str, ...], rows: list[tuple[str, ...]], capsys: Any
) -> None:
    made = table(title, columns, rows)
    rich = Console(file=io.StringIO(), width=WIDE, highlight=False)
    rich.print(made)
    console().print(made)
    assert capsys.readouterr().out == rich.file.getvalue()  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "text", ["plain", "[bold]as it is[/] :boom:", "two\nlines", "tab\tand\x07bell", "end\n", "x " * 150, ""]
)  # fmt: skip
def test_a_line_in_a_pipe_is_rich_s_own(text: str, capsys: Any) -> None:
    rich = Console(file=io.StringIO(), width=WIDE, highlight=False)
    say(rich, text)
    say(console(), text)
    say(console(quiet=True), text)
    assert capsys.readouterr().out == rich.file.getvalue()  # type: ignore[attr-defined]


def test_simple_tables_need_no_rich_and_others_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    simple = [made.text() is not None for made in (table(*given) for given in TABLES)]
    assert simple == [True, True, False, True, False, False, False, False, True]
    assert isinstance(console(), PlainConsole)
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert isinstance(console(), Console)
