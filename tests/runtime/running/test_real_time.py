"""What a run asks of the operating system is granted while it ticks, and given back."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.running import real_time
from aloft.runtime.running.executor import run
from aloft.runtime.running.real_time import RealTimeError, RealTimeOptions
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Ticks(Block):
    """Writes the tick."""

    class Params(Parameters):
        n: int = 1

    y = Output(Vector, text="the tick")

    def step(self) -> None:
        self.y.value.fill(self.tick)


def test_the_processor_is_the_runs_own_only_while_it_ticks() -> None:
    before, seen = os.sched_getaffinity(0), []
    cpu = max(before)

    class Witness(Ticks):
        def setup(self) -> None:
            seen.append(os.sched_getaffinity(0))

        def step(self) -> None:
            seen.append(os.sched_getaffinity(0))

    run(checked_graph({"w": BlockUse(Witness)}, ticks=1), real_time=RealTimeOptions(cpu=cpu))
    assert seen == [before, {cpu}]
    assert os.sched_getaffinity(0) == before


def test_a_processor_that_there_is_not_is_refused() -> None:
    allowed = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
    with pytest.raises(RealTimeError, match=f"--cpu 4096: .* use the processors {allowed}"):
        RealTimeOptions(cpu=4096).check()


def test_threads_that_are_started_later_stay_ordinary(monkeypatch: pytest.MonkeyPatch) -> None:
    set_to: list[tuple[int, int]] = []
    monkeypatch.setattr(
        os,
        "sched_setscheduler",
        lambda pid, policy, param: set_to.append((policy, param.sched_priority)),
    )
    ordinary = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    RealTimeOptions(priority=42).check()
    assert set_to == [(os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 42), ordinary]


@pytest.mark.parametrize("priority", [0, 100])
def test_a_priority_that_there_is_not_is_refused(priority: int) -> None:
    with pytest.raises(RealTimeError, match=f"--priority {priority}: expected 1 to 99"):
        RealTimeOptions(priority=priority).check()


def test_what_the_system_refuses_is_told_before_anything_moves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    graph = checked_graph({"w": BlockUse(Ticks)}, ticks=1)
    with pytest.raises(RealTimeError, match=r"--priority 50: .* `aloft doctor` says how"):
        run(graph, real_time=RealTimeOptions(priority=50))


def test_memory_that_cannot_be_locked_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class Refuses:
        def mlockall(self, flags: int) -> int:
            return -1

    monkeypatch.setattr(real_time, "_libc", Refuses)
    with pytest.raises(RealTimeError, match="--lock-memory: the system does not allow it"):
        RealTimeOptions(lock_memory=True).check()


def test_memory_is_locked_within_and_unlocked_after(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    class Grants:
        def mlockall(self, flags: int) -> int:
            calls.append(f"lock {flags}")
            return 0

        def munlockall(self) -> int:
            calls.append("unlock")
            return 0

    monkeypatch.setattr(real_time, "_libc", Grants)

    @contextmanager
    def within() -> Iterator[None]:
        with RealTimeOptions(lock_memory=True).granted():
            calls.append("run")
            yield

    with within():
        pass
    assert calls == ["lock 3", "run", "unlock"]
    calls.clear()
    RealTimeOptions(lock_memory=True).check()
    assert calls == ["lock 7", "unlock"]  # 4: what is only reserved stays so
