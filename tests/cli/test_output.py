"""What the command line says while it works."""

import io

import pytest
from rich.console import Console

from aloft.cli.shared.output import MANY_KERNELS, compiling_shown, progress_bar
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
