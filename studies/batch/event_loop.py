"""The event loop of this process in a thread of its own, for the clients of Dask clusters.

A client can start such a thread itself, but it gives up with an assertion without a text if the
thread has not come to run within 10 s, as happens on an overloaded machine.
"""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from functools import cache
from threading import Thread
from typing import Any

from ...runtime.language.errors import AloftError


@cache
def running_loop(wait: float = 120.0) -> Any:
    """The tornado ``IOLoop`` of this process, which runs until the process ends.

    Args:
        wait: for the thread to come to run [s].

    Raises:
        AloftError: the thread does not run by then.
    """
    ready: Future[Any] = Future()
    Thread(target=_run, args=(ready,), name="event loop", daemon=True).start()
    try:
        return ready.result(wait)
    except TimeoutError as error:
        raise AloftError(
            f"the thread of the Dask client did not run within {wait:g} s: the machine is "
            "overloaded; use fewer workers, or try again when it is quiet"
        ) from error


def _run(ready: Future[Any]) -> None:
    asyncio.run(_until_the_end(ready))


async def _until_the_end(ready: Future[Any]) -> None:
    from tornado.ioloop import IOLoop

    ready.set_result(IOLoop.current())
    await asyncio.Event().wait()
