"""The watchdog's process damps by itself: when beats end, when links are silent, when the graph dies.

The dead man's switch is held only while somebody holds it.
"""

import io
import os
import select
import struct
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from aloft.hal.bear.bus import BusError
from aloft.hal.bear.configuration import DeadMan
from aloft.hal.bear.watchdog import (
    AlwaysHeld,
    DriveWatchdog,
    GamepadButton,
    ask_to_stop,
    damping_frame,
    open_switch,
    wait_until_held,
)

DEVICES = [1, 2, 3]
FRAME = damping_frame(DEVICES)
SECONDS = 30.0
"""No wait of a test lasts longer."""
Make = Callable[[float, float], DriveWatchdog]


@pytest.fixture
def port() -> Iterator[tuple[int, int]]:
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


@pytest.fixture
def make(port: tuple[int, int]) -> Iterator[Make]:
    made: list[DriveWatchdog] = []

    def start(limit: float, silence: float = 0.0) -> DriveWatchdog:
        made.append(DriveWatchdog(port[1], DEVICES, limit, silence))
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


def test_somebody_asks_it_to_stop(port: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aloft.hal.bear.watchdog._ANSWERING", SECONDS)
    name = f"/dev/not there {os.getpid()}"
    assert not ask_to_stop(name), "nobody listens"
    watchdog = DriveWatchdog(port[1], DEVICES, SECONDS, port=name)
    try:
        watchdog.beat()
        assert not watchdog.asked and ask_to_stop(name)
        assert watchdog.asked and not watchdog.tripped, "it goes on to watch"
        assert first_frame(port, 0.0) == FRAME
        assert ask_to_stop(name), "again"
    finally:
        watchdog.close()
    assert not ask_to_stop(name)


def test_a_gamepads_button(tmp_path: Path) -> None:
    device = tmp_path / "js0"
    os.mkfifo(device)
    keep = os.open(device, os.O_RDWR)

    def event(value: int, kind: int, number: int) -> None:
        os.write(keep, struct.pack("<IhBB", 0, value, kind, number))

    switch = open_switch(DeadMan(device=str(device), button=4))
    assert isinstance(switch, GamepadButton) and not switch.held()
    event(1, 0x01, 3)
    event(900, 0x02, 4)  # an axis of the same number
    assert not switch.held()
    event(1, 0x81, 4)  # what the system tells at first
    assert switch.held() and switch.held()
    event(0, 0x01, 4)
    assert not switch.held()
    switch.close()
    os.close(keep)


def test_what_is_not_there_or_not_held(tmp_path: Path) -> None:
    with pytest.raises(BusError, match=r"the dead man's switch .*js9 cannot be opened: No such"):
        open_switch(DeadMan(device=str(tmp_path / "js9")))
    wait_until_held(AlwaysHeld(), 0.0)

    class Never(AlwaysHeld):
        def held(self) -> bool:
            return False

    with pytest.raises(BusError, match=r"within 0\.05 s: nothing was enabled"):
        wait_until_held(Never(), 0.05)


def test_the_space_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """It counts as held while it repeats itself; the terminal is given back as it was."""
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        before = termios.tcgetattr(theirs)
        switch = open_switch(DeadMan(kind="key"))
        now = [100.0]
        monkeypatch.setattr("aloft.hal.bear.watchdog.time.monotonic", lambda: now[0])
        assert not switch.held()
        for key, pause, held in (
            (b"x", 0.0, False),
            (b" ", 0.0, False),  # a key that is pressed repeats after half a second only
            (b" ", 0.5, False),
            (b" ", 0.09, True),
            (b"  ", 0.09, True),
        ):
            now[0] += pause
            os.write(ours, key)
            assert select.select([theirs], [], [], 60.0)[0]
            assert switch.held() is held
        now[0] += 0.09
        assert switch.held()
        now[0] += 0.02
        assert not switch.held(), "it no longer repeats itself"
        switch.close()
        assert termios.tcgetattr(theirs) == before and os.get_blocking(theirs)
    os.close(ours)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    with pytest.raises(BusError, match="needs a terminal as standard input"):
        open_switch(DeadMan(kind="key"))
