"""How soon the command line answers: a check, the first tick of a jump, and the very first run."""

from __future__ import annotations

import tempfile
from pathlib import Path

from .aloft_process import time_process
from .rows import Row
from .tick.controller import GRAPH

FEW_TICKS = ("--duration", "0.01 s", "--no-record")
"""A run that ends before it has begun to jump: what is left is its start and its end."""
CHECK_GOAL, WARM_GOAL, COLD_GOAL = 0.5, 1.5, 20.0


def startup(repeats: int = 5, first: bool = True) -> list[Row]:
    """The rows: each the least of ``repeats`` processes, but for the ``first`` run, which is one.

    The first run finds an empty cache: it compiles all kernels, on all processors, and checks the plan
    and makes its table besides.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        check = time_process(["check", str(GRAPH)], folder, repeats)
        # one that ends before the jump has not jumped, which is exit code 1
        short = ["run", str(GRAPH), *FEW_TICKS]
        warm = time_process(short, folder, repeats, codes=(0, 1))
        rows = [
            Row("aloft check graphs/jump.yaml, processor time", check.user, "s", goal=CHECK_GOAL),
            Row("aloft check graphs/jump.yaml", check.wall, "s"),
            Row(
                "aloft run graphs/jump.yaml, start and end", warm.wall, "s", goal=WARM_GOAL,
                note=f"{FEW_TICKS[1]} of the graph; {warm.user:.2f} s of processor time",
            ),
        ]  # fmt: skip
        if first:
            empty = {"XDG_CACHE_HOME": str(folder / "cache")}
            cold = time_process(short, folder, 1, codes=(0, 1), variables=empty, warm=False)
            rows.append(
                Row(
                    "the same on a new machine", cold.wall, "s", goal=COLD_GOAL,
                    note=f"all kernels are compiled; {cold.user:.0f} s of processor time",
                )
            )  # fmt: skip
    return rows
