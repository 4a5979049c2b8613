"""Start-up time of the command line: a check, the first tick of a jump, and the very first run."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from .rows import Row
from .tick.controller import GRAPH

TIMEOUT = 600.0


@dataclass(frozen=True)
class ProcessTimes:
    """The least of several processes: ``wall`` [s], and the time of processors in user mode, its
    child processes included, ``user`` [s]. ``output`` is what the last one printed."""

    wall: float
    user: float
    output: str


def time_process(
    arguments: Sequence[str],
    folder: Path,
    repeats: int,
    *,
    codes: Sequence[int] = (0,),
    variables: Mapping[str, str] | None = None,
    warm: bool = True,
) -> ProcessTimes:
    """Run ``aloft`` with these arguments ``repeats`` times, in ``folder``.

    Python keeps its bytecode in that folder, as it does by itself after any first run where nothing
    forbids it.

    Args:
        codes: the exit codes that are right.
        variables: of the environment, beside one thread for BLAS.
        warm: whether it runs once more before it is timed.

    Raises:
        AssertionError: it ended with another exit code.
    """
    import resource

    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    environment = {**os.environ, **threads, **(variables or {})}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    environment["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
    command = [sys.executable, "-m", "aloft", *arguments]
    walls, users, output = [], [], ""
    for _ in range(repeats + warm):
        start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run(
            command, check=False, cwd=folder, capture_output=True, text=True,
            timeout=TIMEOUT, env=environment,
        )  # fmt: skip
        walls.append(time.perf_counter() - start)
        users.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
        if done.returncode not in codes:
            raise AssertionError(
                f"aloft {arguments[0]} ended with {done.returncode}: {done.stderr[-500:]}"
            )
        output = done.stdout
    return ProcessTimes(min(walls[warm:]), min(users[warm:]), output)


FEW_TICKS = ("--duration", "0.01 s", "--no-record")
"""A run that ends before it has begun to jump: what is left is its start and its end."""
CHECK_GOAL, WARM_GOAL, COLD_GOAL = 0.5, 1.5, 20.0


def startup(repeats: int = 5, first: bool = True) -> list[Row]:
    """Measure the start-up times: each the least of ``repeats`` processes, but for the ``first``
    run, which is one.

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
