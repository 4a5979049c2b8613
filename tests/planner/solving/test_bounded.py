"""A call that may never end: its answer, its error, and its end."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from aloft.planner.solving.bounded import bounded, cpu_time


def spin() -> None:
    while True:
        pass


def test_what_the_call_returns_comes_back() -> None:
    ended, value = bounded(lambda: (np.arange(200_000.0), {"n": 3}), 10)
    assert ended and value[1] == {"n": 3}
    assert np.array_equal(value[0], np.arange(200_000.0))


def test_a_call_that_never_ends_is_given_up_and_its_time_counts() -> None:
    before = cpu_time()
    assert bounded(spin, 1) == (False, None)
    assert cpu_time() - before > 0.8


def test_an_error_is_raised_here() -> None:
    with pytest.raises(RuntimeError, match="ValueError: no such thing"):
        bounded(lambda: (_ for _ in ()).throw(ValueError("no such thing")), 5)


def test_it_changes_nothing_here() -> None:
    found: list[int] = []
    bounded(lambda: found.append(1), 5)
    assert found == []


def test_a_call_that_kills_its_process_is_given_up() -> None:
    assert bounded(lambda: os.kill(os.getpid(), 9), 5) == (False, None)


def test_no_process_is_left_behind() -> None:
    before = children()
    bounded(time.process_time, 5)
    assert children() <= before


def children() -> set[str]:
    """The numbers of the processes that this one has started and that have not ended."""
    found = set()
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has ended meanwhile
            parent = status.read_text().rpartition(")")[2].split()[1]
            if int(parent) == os.getpid():
                found.add(status.parent.name)
    return found
