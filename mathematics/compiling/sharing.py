"""Other processes that compile a part of many kernels, one process for each further processor.

They leave the machine code in the cache, where whoever asked for it finds it. What they leave out,
for whatever reason, is simply still missing.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from typing import Any, NamedTuple

from ...processes.child_process import ChildProcess
from . import store
from .arguments import ArgumentType
from .fingerprint import closure
from .kernel_registry import kernels, written_code

WORTH_A_PROCESS = 15_000
"""Bytes of Python's code that take longer to compile than another process takes to begin."""
MOST_PROCESSES = 4
"""More would mostly compile the same functions again."""


class CompileJob(NamedTuple):
    """A kernel to compile: the name of its machine code, the kernel, and the types for it."""

    name: str
    kernel: Callable[..., Any]
    signature: tuple[ArgumentType, ...]


def divide(jobs: Sequence[CompileJob], processors: int) -> list[list[CompileJob]]:
    """Share out jobs so that all processes take about as long; the first share is never empty.

    A job costs the bytes of Python's code of the functions that its process does not have yet. There
    are no more shares than are worth a process.
    """
    below = {job.name: _code_below(job.kernel) for job in jobs}
    everything: dict[int, int] = {}
    for sizes in below.values():
        everything |= sizes
    worth = sum(everything.values()) // WORTH_A_PROCESS
    shares: list[list[CompileJob]] = [
        [] for _ in range(max(1, min(processors, worth, MOST_PROCESSES)))
    ]
    known: list[dict[int, int]] = [{} for _ in shares]
    for job in sorted(jobs, key=lambda job: -sum(below[job.name].values())):
        totals = [sum((have | below[job.name]).values()) for have in known]
        least = totals.index(min(totals))
        known[least] |= below[job.name]
        shares[least].append(job)
    return shares


def _code_below(kernel: Any) -> dict[int, int]:
    """Return the sizes of the code of a kernel and of all that it calls."""
    return {id(function): len(written_code(function).co_code) for function in closure(kernel)}


def processors() -> int:
    """Return the number of processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def helpers(shares: Sequence[Sequence[CompileJob]]) -> Iterator[list[ChildProcess]]:
    """Start a process for each share, whose end the caller waits for; none is left behind."""
    with ExitStack() as stack:
        started: list[ChildProcess] = []
        for share in shares:
            with suppress(OSError):
                process = ChildProcess("a compiler", f"{__name__}:main", quiet=True)
                started.append(stack.enter_context(process))
                with suppress(BrokenPipeError), process.stdin as pipe:
                    pipe.write(pickle.dumps([_packed(job) for job in share]))
        yield started


def _packed(job: CompileJob) -> bytes:
    """Pack a job for another process; empty where that could not find the kernel by its name."""
    try:
        kernel = job.kernel
        return pickle.dumps((job.name, kernel.__module__, kernel.__qualname__, job.signature))
    except (pickle.PicklingError, AttributeError):
        return b""


def main() -> None:
    """Compile the jobs on standard input, and keep their machine code in the cache."""
    from .translate import CompileError, Translator

    translator = Translator()
    for words in pickle.load(sys.stdin.buffer):
        with suppress(CompileError, ImportError, AttributeError, EOFError, KeyError):
            name, module, qualname, signature = pickle.loads(words)
            import_module(module)
            kernel = kernels()[f"{module}.{qualname}"]
            store.save(name, translator.object_code(kernel, signature))
