"""How long the command ``aloft`` takes as a process of its own, from its start to its end."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

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
