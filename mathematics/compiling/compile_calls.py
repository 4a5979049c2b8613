"""Gives calls of kernels their machine code: from memory, the cache or the package, or by compiling."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from ...processes.child_process import ChildProcess, processors
from . import shipped, store
from .arguments import ArgumentType, pack, type_of
from .failures import CompileError
from .fingerprint import fingerprint
from .kernel_call import KernelCall
from .kernel_registry import kernels
from .machine_code import MachineCode, optimised, tools
from .sharing import CompileJob, divide, helpers

Watcher = Callable[[int, int], None]

watchers: list[Watcher] = []
"""Called with the number of kernels that are compiled and with how many there are, again and again;
not called where everything comes from the cache."""

LONGEST_WAIT = 300.0
"""Longest wait [s] for another process; the work that it has not done then is done here."""
_BETWEEN_LOOKS = 0.2

_one_at_a_time = threading.Lock()
"""Held while kernels are compiled, so that a second thread finds what the first has made."""
_loaded: dict[str, MachineCode] = {}
_names: dict[tuple[Callable[..., None], tuple[ArgumentType, ...]], str] = {}


def compile_calls(calls: Sequence[KernelCall]) -> str:
    """Let calls run as machine code; threads that ask for it at the same time wait for each other.

    Returns:
        Why some or all of them run as plain Python instead; empty where all are compiled. The
        results are the same bits either way.
    """
    try:
        with _one_at_a_time:
            return _Compilation(calls).finish()
    except (ImportError, CompileError, OSError, RuntimeError, TypeError, ValueError) as error:
        for call in calls:
            call.use_plain()
        return str(error) or type(error).__name__


def run_compiled(kernel: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel once, as machine code where that can be."""
    call = KernelCall(kernel, *arguments)
    compile_calls([call])
    call.run()


class _Compilation:
    """The machine code for some calls; kernels whose code is nowhere are compiled one by one."""

    def __init__(self, calls: Sequence[KernelCall]) -> None:
        self._calls = calls
        self._types = [tuple(type_of(a) for a in call.arguments) for call in calls]
        known: dict[Any, bytes] = {}
        self._names = [
            _name(call, types, known) for call, types in zip(calls, self._types, strict=True)
        ]

    def finish(self) -> str:
        """Compile what is missing, and change over all calls; returns what did not compile."""
        missing: dict[str, int] = {}
        for k, name in enumerate(self._names):
            if name not in _loaded and not self._load(name, self._kept(name, k)):
                missing.setdefault(name, k)
        refused = self._compile(missing)
        for call, name in zip(self._calls, self._names, strict=True):
            if name not in _loaded:
                call.use_plain()
                continue
            code, words = _loaded[name], pack(call.arguments)
            address = ctypes.c_size_t(words.ctypes.data)
            call.run = partial(code.function, address)
            call.compiled = code, words
        return "; ".join(refused)

    def _kept(self, name: str, k: int) -> bytes | None:
        """Return the machine code of call ``k`` from the cache, or from the package."""
        return store.load(name) or shipped.load(self._calls[k].kernel, self._types[k])

    def _load(self, name: str, code: bytes | None) -> bool:
        if code is None:
            return False
        with suppress(RuntimeError, ValueError):  # of another LLVM, or damaged: compiled again
            _loaded[name] = MachineCode(code)
        return name in _loaded

    def _compile(self, missing: dict[str, int]) -> list[str]:
        """Compile kernels, given by name and the place of a call; returns why some are refused."""
        refused: list[str] = []
        if not missing:
            return refused
        from .translate import Translator  # which most starts do without

        translator = Translator()
        jobs: list[CompileJob] = []
        for name, k in missing.items():
            try:
                assembly = translator.module(self._calls[k].kernel, self._types[k])
                jobs.append(CompileJob(name, assembly))
            except CompileError as error:
                refused.append(str(error))
        own, *shares = divide(jobs, processors())
        others = [job for share in shares for job in share]
        with helpers(shares) as processes:
            for done, job in enumerate(own):
                _tell(done + _finished(others), len(jobs))
                self._optimise(job)
            for process in processes:
                _wait(process, len(own), others)
        for job in others:
            if not self._load(job.name, store.load(job.name)):
                self._optimise(job)
        _tell(len(jobs), len(jobs))
        return refused

    def _optimise(self, job: CompileJob) -> None:
        code = optimised(job.assembly)
        _loaded[job.name] = MachineCode(code)
        store.save(job.name, code)


def _tell(done: int, total: int) -> None:
    for watch in watchers:
        watch(done, total)


def _finished(jobs: Sequence[CompileJob]) -> int:
    """Count the kernels that other processes have finished."""
    return sum(store.holds(job.name) for job in jobs)


def _wait(process: ChildProcess, own: int, others: Sequence[CompileJob]) -> None:
    """Wait for another process, and tell how far it is."""
    for _ in range(int(LONGEST_WAIT / _BETWEEN_LOOKS)):
        if process.wait(_BETWEEN_LOOKS) is not None:
            return
        _tell(own + _finished(others), own + len(others))


def _name(call: KernelCall, types: tuple[ArgumentType, ...], known: dict[Any, bytes]) -> str:
    """Return the name of a call's machine code in the cache."""
    key = call.kernel, types
    if key not in _names:
        if kernels().get(call.name) is not call.kernel:
            raise CompileError(f"{call.name} is not marked with @kernel")
        _names[key] = fingerprint(call.kernel, types, tools(), known=known)
    return _names[key]
