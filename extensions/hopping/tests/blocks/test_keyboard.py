"""``Keyboard`` turns keys into commands, and leaves the terminal as it was."""

from __future__ import annotations

import io
import os
import pty
import sys
import termios
import time

import pytest

from aloft.extensions.hopping.blocks.keyboard import Keyboard, split_keys
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def test_keys_are_found_also_where_one_comes_in_two_pieces() -> None:
    assert split_keys("\x1b[Aa\x1b[Dq") == (["\x1b[A", "a", "\x1b[D", "q"], "")
    assert split_keys("x\x1b[") == ([], "\x1b[")
    assert split_keys("\x1b[" + "B") == (["\x1b[B"], "")
    assert split_keys("\x1bxyz ") == ([" "], "")


class Terminal:
    """Standard input that is a terminal."""

    def __init__(self) -> None:
        self.main, self.stream = pty.openpty()

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return self.stream


def test_typed_keys_become_commands_and_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    before = termios.tcgetattr(terminal.stream)
    monkeypatch.setattr(sys, "stdin", terminal)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    bench = BlockBench(Keyboard, {"ahead": 0.2, "turn": 0.5})
    try:
        bench.step()
        command = bench.get("command")
        assert int(command.number) == 0
        os.write(terminal.main, b"\x1b[Aa")
        end = time.monotonic() + 60.0
        while int(command.number) < 2 and time.monotonic() < end:
            time.sleep(0.01)
            bench.step()
        assert [float(command.ahead), float(command.aside), float(command.turn)] == [0.2, 0.0, 0.5]
        bench.block.press("\x1b[D", bench.block.time + 10.0)
        bench.step()
        assert [float(command.ahead), float(command.aside), float(command.turn)] == [0.0, 0.1, 0.0]
        bench.block.press("q", bench.block.time)
        assert bench.clock.stop_reason == "q was pressed"
    finally:
        bench.block.close()
    assert termios.tcgetattr(terminal.stream) == before


def test_without_a_terminal_it_says_what_to_do_instead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    with pytest.raises(BlockError, match="aloft steer --commands FILE"):
        BlockBench(Keyboard)
