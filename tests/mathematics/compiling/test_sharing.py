"""Kernels are shared out to other processes, and what these do not do is done here."""

import importlib
import subprocess
import sys

import numpy as np
import pytest

from aloft.mathematics import landing_law, linear_algebra, rotations
from aloft.mathematics.compiling import compile_calls as module
from aloft.mathematics.compiling import sharing, store
from aloft.mathematics.compiling.arguments import type_of
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.compiling.translate import Translator
from aloft.mathematics.kernel import kernel

FLOATS = type_of(np.zeros(3))
MATRIX = type_of(np.zeros((3, 3)))


pytestmark = pytest.mark.usefixtures("own_cache")


def jobs():
    translator = Translator()
    found = (
        (rotations.multiply, (FLOATS,) * 3),
        (rotations.exponential, (FLOATS,) * 2),
        (rotations.logarithm, (FLOATS,) * 2),
        (linear_algebra.solve_upper, (MATRIX, FLOATS)),
        (landing_law.keep_within, (FLOATS,) * 4),
    )
    return [sharing.CompileJob(f"{k:032d}", translator.module(*job)) for k, job in enumerate(found)]


def test_few_kernels_are_not_worth_another_process():
    assert sharing.divide(jobs(), 8) == [sorted(jobs(), key=_size, reverse=True)]


def _size(job):
    return len(job.assembly)


@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_every_kernel_is_in_one_share_and_the_shares_are_about_equal(count, monkeypatch):
    monkeypatch.setattr(sharing, "WORTH_A_PROCESS", 100)
    shares = sharing.divide(jobs(), count)
    assert len(shares) == min(count, sharing.MOST_PROCESSES)
    assert sorted(job.name for share in shares for job in share) == [j.name for j in jobs()]
    assert all(shares)
    if count == 2:
        first, second = (sum(map(_size, share)) for share in shares)
        assert abs(first - second) < 0.5 * max(first, second)


def test_another_process_leaves_machine_code_in_the_cache():
    with sharing.helpers([jobs()[:1], jobs()[4:]]) as processes:
        assert [process.wait(120) for process in processes] == [0, 0]
    assert [store.holds(job.name) for job in jobs()] == [True, False, False, False, True]
    assert module.MachineCode(store.load(jobs()[0].name)).address


def test_no_process_is_left_behind():
    with pytest.raises(KeyboardInterrupt), sharing.helpers([jobs()]) as processes:
        raise KeyboardInterrupt
    assert not processes[0].is_alive()


def test_what_another_process_does_not_do_is_done_here(monkeypatch):
    @kernel
    def local(values: np.ndarray) -> None:
        values[0] = 2.0

    monkeypatch.setattr(sharing, "WORTH_A_PROCESS", 1)
    monkeypatch.setattr(module, "processors", lambda: 2)
    monkeypatch.setattr(sharing.pickle, "dumps", lambda jobs: b"nothing that can be read")
    calls = [
        KernelCall(local, np.zeros(3)),
        KernelCall(rotations.multiply, *(np.ones(4) for _ in range(3))),
    ]
    assert module.compile_calls(calls) == ""
    assert all(call.compiled is not None for call in calls)
    calls[0].run()
    assert calls[0].arguments[0][0] == 2.0


def test_without_other_processes_everything_is_done_here(monkeypatch):
    def refused(*arguments, **options):
        raise OSError("no more processes")

    monkeypatch.setattr(sharing, "WORTH_A_PROCESS", 1)
    monkeypatch.setattr(subprocess, "Popen", refused)
    calls = [KernelCall(rotations.exponential, np.ones(3), np.zeros(4))]
    calls += [KernelCall(rotations.logarithm, np.ones(4), np.zeros(3))]
    assert module.compile_calls(calls) == ""
    assert all(call.compiled is not None for call in calls)


def test_the_start_of_another_process_imports_the_module_by_its_name():
    assert importlib.import_module(sharing.__name__) is sys.modules[sharing.__name__]
    assert callable(sharing.main)
