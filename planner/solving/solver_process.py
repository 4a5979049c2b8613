"""Calls solvers with a limit of time, because they may loop for ever inside a library.

``bounded`` copies the process that calls it, which is quick, and safe while that has one thread. A
copy of a process with several may find a lock that another thread held, and wait for it for ever.
So such a process starts this one, which has one thread, and sends it each solver once; this one
then copies itself for every call.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np

from ...mathematics.arrays import Array
from ...processes.child_process import ChildProcess


def cpu_time() -> float:
    """Return the processor time [s] of this process, of those it has waited for, and what others counted."""
    if not hasattr(os, "fork"):
        return time.process_time()
    import resource

    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime + _elsewhere


_elsewhere = 0.0


def count(seconds: float) -> None:
    """Count processor time that another process has spent for this one."""
    global _elsewhere
    _elsewhere += seconds


def bounded(function: Callable[[], Any], limit: int) -> tuple[bool, Any]:
    """Return whether ``function`` came to its end within ``limit`` seconds of processor time, and its result, which has
    to be picklable.

    It is called in a copy of this process, so it changes nothing here. Where processes cannot be
    copied it is called here, without a limit.

    Raises:
        RuntimeError: the function raised; the text is its error's.
    """
    if not hasattr(os, "fork"):
        return True, function()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _answer(function, limit, writing)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        data = pipe.read()
    os.waitpid(child, 0)
    if not data:
        return False, None
    raised, value = pickle.loads(data)
    if raised:
        raise RuntimeError(value)
    return True, value


def _answer(function: Callable[[], Any], limit: int, writing: int) -> None:
    """Call the function in the copy of the process, write the answer, and end without anything else."""
    import resource

    # What this process has used so far does not count, and was not passed on.
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
    try:
        data = pickle.dumps((False, function()))
    except BaseException as error:  # noqa: BLE001 - a copy of the process ends here
        data = pickle.dumps((True, f"{type(error).__name__}: {error}"))
    with os.fdopen(writing, "wb") as pipe:
        pipe.write(data)
    os._exit(0)


Answer = tuple[Array, dict[str, Any]]

KEPT = 12
"""Solvers that the process keeps; a further one is sent again when it is needed again."""


def has_one_thread() -> bool:
    """Check whether this process has no thread but the calling one."""
    try:
        return len(os.listdir("/proc/self/task")) == 1
    except OSError:  # a system that does not show the threads of libraries
        return threading.active_count() == 1


def call_solver(function: Any, arguments: Mapping[str, Array]) -> Answer:
    """Call a solver of CasADi. Returns the variables, and its report of success."""
    with without_output():
        result = function(**arguments)
    stats = function.stats()
    found = {key: stats.get(key) for key in ("success", "iter_count", "unified_return_status")}
    return np.array(result["x"]).ravel(), found


def call_bounded(
    function: Any, arguments: Mapping[str, Array], limit: int
) -> tuple[bool, Answer | None]:
    """Call ``call_solver`` in a fresh copy of a process, given up after ``limit`` seconds of processor time. Returns
    whether it came to its end, and the answer.

    Raises:
        RuntimeError: the solver raised; the text is its error's.
    """
    if has_one_thread() or not hasattr(os, "fork"):
        return _bounded_call(function, arguments, limit)
    return _helper.call(function, arguments, limit)


@contextlib.contextmanager
def without_output() -> Iterator[None]:
    """Silence the solvers, which write to the process's standard output whatever their options."""
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


@dataclass
class _Helper:
    """The process, as seen from here."""

    _process: ChildProcess | None = None
    _sent: OrderedDict[int, Any] = field(default_factory=OrderedDict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def call(
        self, function: Any, arguments: Mapping[str, Array], limit: int
    ) -> tuple[bool, Answer | None]:
        """Call a solver; see ``call_bounded``."""
        with self._lock:
            try:
                ended, error, answer, used = self._ask(function, arguments, limit)
            except BaseException:  # an answer may be under way, which nobody waits for any more
                self.stop()
                raise
        count(used)
        if error:
            raise RuntimeError(error)
        return ended, answer

    def _ask(self, function: Any, arguments: Mapping[str, Array], limit: int) -> Any:
        process = self._running()
        number = id(function)
        dropped: list[int] = []
        data = None
        if number in self._sent:  # kept here as well, so nothing else can have its number
            self._sent.move_to_end(number)
        else:
            data = pickle.dumps(function)
            self._sent[number] = function
            if len(self._sent) > KEPT:
                dropped.append(self._sent.popitem(last=False)[0])
        assert process.stdout is not None
        plain = {name: np.array(value) for name, value in arguments.items()}
        try:
            pickle.dump((number, data, dropped, plain, limit), process.stdin)
            process.stdin.flush()
            return pickle.load(process.stdout)
        except (OSError, EOFError) as error:
            raise process.failure() from error

    def _running(self) -> ChildProcess:
        if self._process is None or not self._process.is_alive():
            self.stop()
            self._sent.clear()
            self._process = ChildProcess(
                "the process that calls solvers", f"{__name__}:serve", stdout=True,
                environment={"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
        return self._process

    def stop(self) -> None:
        """End the process, if it runs; the next call starts a new one."""
        process, self._process = self._process, None
        if process is not None:
            process.stop()


_helper = _Helper()


def serve() -> None:
    """Answer calls until the process's input ends."""
    requests: IO[bytes] = os.fdopen(os.dup(0), "rb")
    answers: IO[bytes] = os.fdopen(os.dup(1), "wb")
    kept: dict[int, Any] = {}
    with contextlib.suppress(EOFError):
        while True:
            number, data, dropped, arguments, limit = pickle.load(requests)
            started = cpu_time()
            for old in dropped:
                kept.pop(old, None)
            if data is not None:
                kept[number] = pickle.loads(data)
            function, ended, error, answer = kept[number], True, "", None
            try:
                ended, answer = _bounded_call(function, arguments, limit)
            except RuntimeError as failure:
                error = str(failure)
            pickle.dump((ended, error, answer, cpu_time() - started), answers)
            answers.flush()


def _bounded_call(
    function: Any, arguments: Mapping[str, Array], limit: int
) -> tuple[bool, Answer | None]:
    if hasattr(function, "prepare"):
        function.prepare()  # here, or every copy of this process would do it anew
    return bounded(lambda: call_solver(function, arguments), limit)
