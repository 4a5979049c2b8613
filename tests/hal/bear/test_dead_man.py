"""The dead man's switch is held only while somebody holds it."""

import io
import os
import select
import struct
import sys
import termios
from pathlib import Path

import pytest

from aloft.hal.bear.bus import BusError
from aloft.hal.bear.configuration import DeadMan
from aloft.hal.bear.dead_man import AlwaysHeld, GamepadButton, open_switch, wait_until_held


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
        monkeypatch.setattr("aloft.hal.bear.dead_man.time.monotonic", lambda: now[0])
        assert not switch.held()
        for key, held in ((b"x", False), (b" ", True)):
            os.write(ours, key)
            assert select.select([theirs], [], [], 60.0)[0]
            assert switch.held() is held
        now[0] += 0.6
        assert switch.held()
        now[0] += 0.2
        assert not switch.held(), "it no longer repeats itself"
        switch.close()
        assert termios.tcgetattr(theirs) == before and os.get_blocking(theirs)
    os.close(ours)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    with pytest.raises(BusError, match="needs a terminal as standard input"):
        open_switch(DeadMan(kind="key"))
