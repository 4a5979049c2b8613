"""The watchdog's process damps by itself: when beats end, when links are silent, when the graph dies."""

import os
import select
import time
from collections.abc import Callable, Iterator

import pytest

from aloft.hal.bear.watchdog import Watchdog, damping_frame

DEVICES = [1, 2, 3]
FRAME = damping_frame(DEVICES)
SECONDS = 30.0
"""No wait of a test lasts longer."""
Make = Callable[[float, float], Watchdog]


@pytest.fixture
def port() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


@pytest.fixture
def make(port: tuple[int, int]) -> Iterator[Make]:
    made: list[Watchdog] = []

    def start(limit: float, silence: float = 0.0) -> Watchdog:
        made.append(Watchdog(port[1], DEVICES, limit, silence))
        return made[-1]

    yield start
    for watchdog in made:
        watchdog.close()


def first_frame(port: tuple[int, int], seconds: float) -> bytes:
    readable, _, _ = select.select([port[0]], [], [], seconds)
    return os.read(port[0], len(FRAME)) if readable else b""


def test_it_waits_for_the_first_beat_and_damps_after_the_last(
    port: tuple[int, int], make: Make
) -> None:
    watchdog = make(0.01, 0.0)
    assert first_frame(port, 0.1) == b"" and not watchdog.tripped
    watchdog.beat()
    assert first_frame(port, SECONDS) == FRAME and watchdog.tripped


def test_beats_of_a_graph_that_hears_no_commands_do_not_hold_it_off(
    port: tuple[int, int], make: Make
) -> None:
    watchdog = make(SECONDS, 0.3)
    heard = time.monotonic_ns()
    while not watchdog.tripped:
        watchdog.beat(heard)  # the graph is alive, and the link is silent
        assert time.monotonic_ns() - heard < SECONDS * 1e9
        time.sleep(0.005)
    assert (time.monotonic_ns() - heard) * 1e-9 >= 0.3
    assert first_frame(port, SECONDS) == FRAME


def test_it_damps_by_itself_after_silence_that_began_before_the_graph_hung(
    port: tuple[int, int], make: Make
) -> None:
    watchdog = make(SECONDS, 0.2)
    watchdog.beat(time.monotonic_ns() - 199_000_000)  # one beat, and nothing more from here
    assert first_frame(port, SECONDS) == FRAME and watchdog.tripped


def test_commands_that_come_hold_it_off(port: tuple[int, int], make: Make) -> None:
    watchdog = make(SECONDS, 5.0)
    for _ in range(20):
        watchdog.beat(time.monotonic_ns())
        time.sleep(0.005)
    assert first_frame(port, 0.0) == b"" and not watchdog.tripped


def test_it_ends_without_damping_when_told_that_the_graph_closes(
    port: tuple[int, int], make: Make
) -> None:
    watchdog = make(SECONDS, 0.0)
    watchdog.beat()
    watchdog.close()
    assert first_frame(port, 0.05) == b""
    with pytest.raises(ProcessLookupError):
        os.kill(watchdog.pid, 0)
