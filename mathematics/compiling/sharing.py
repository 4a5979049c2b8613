"""Other processes that compile a part of many kernels, one process for each further processor.

They get the kernels in LLVM's language, so they need LLVM only, and no function is translated twice. They
leave the machine code in the cache, where whoever asked for it finds it. What they leave out, for whatever
reason, is simply still missing.
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import NamedTuple

from ...processes.child_process import ChildProcess
from . import store
from .machine_code import optimised

WORTH_A_PROCESS = 250_000
"""Letters in LLVM's language that take longer to compile than another process takes to begin."""
MOST_PROCESSES = 4
"""More would mostly begin and end."""


class CompileJob(NamedTuple):
    """A kernel to compile: the name of its machine code, and the kernel in LLVM's language."""

    name: str
    assembly: str


def divide(jobs: Sequence[CompileJob], processors: int) -> list[list[CompileJob]]:
    """Share out jobs so that all processes take about as long; the first share is the process's own.

    There are no more shares than are worth a process.
    """
    worth = sum(len(job.assembly) for job in jobs) // WORTH_A_PROCESS
    count = max(1, min(processors, worth, MOST_PROCESSES, len(jobs)))
    shares: list[list[CompileJob]] = [[] for _ in range(count)]
    lengths = [0] * count
    for job in sorted(jobs, key=lambda job: -len(job.assembly)):
        least = lengths.index(min(lengths))
        lengths[least] += len(job.assembly)
        shares[least].append(job)
    return shares


@contextmanager
def helpers(shares: Sequence[Sequence[CompileJob]]) -> Iterator[list[ChildProcess]]:
    """Start a process for each share, whose end the caller waits for; none is left behind."""
    with ExitStack() as stack:
        started: list[ChildProcess] = []
        for _ in shares:
            with suppress(OSError):
                process = ChildProcess("a compiler", f"{__name__}:main", quiet=True)
                started.append(stack.enter_context(process))
        for share, process in zip(shares, started, strict=False):
            with suppress(BrokenPipeError), process.stdin as pipe:
                pipe.write(pickle.dumps([tuple(job) for job in share]))
        yield started


def main() -> None:
    """Compile the jobs on standard input, and keep their machine code in the cache."""
    for name, assembly in pickle.load(sys.stdin.buffer):
        with suppress(ImportError, RuntimeError):
            store.save(name, optimised(assembly))
