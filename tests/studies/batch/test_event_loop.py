"""An event loop in a thread runs what it is given, and says when it cannot start."""

import asyncio
import threading

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.studies.batch.event_loop import running_loop

pytest.importorskip("distributed")


async def _thread_name() -> str:
    await asyncio.sleep(0)
    return threading.current_thread().name


def test_it_runs_in_a_thread_of_its_own_and_is_made_once() -> None:
    loop = running_loop()
    found = asyncio.run_coroutine_threadsafe(_thread_name(), loop.asyncio_loop)
    assert found.result(60) == "event loop"
    assert running_loop() is loop


def test_a_thread_that_does_not_come_to_run_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading.Thread, "start", lambda thread: None)
    with pytest.raises(AloftError, match=r"did not run within 0.01 s: the machine is overloaded"):
        running_loop(0.01)
