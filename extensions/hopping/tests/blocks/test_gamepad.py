"""``Gamepad`` has the velocity of the sticks, by the events of the library that reads real pads.

There is no pad here: events are put into SDL's own queue, from which those of a pad come.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
import pytest

from aloft.extensions.hopping.blocks.gamepad import Gamepad
from aloft.runtime.graph import load
from aloft.runtime.language.errors import AloftError
from aloft.runtime.testing import BlockBench


def wait(bench: BlockBench[Gamepad], holds: Callable[[], bool]) -> None:
    """Step until it holds."""
    end = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < end, "the events have not come"
        time.sleep(0.01)
        bench.step()


def test_sticks_and_buttons_become_a_velocity() -> None:
    pygame = pytest.importorskip("pygame")
    bench = BlockBench(Gamepad, {"speed": 0.2, "speed_aside": 0.1, "turn": 0.5, "dead": 0.2})

    def post(kind: int, **values: float) -> None:
        pygame.event.post(pygame.event.Event(kind, instance_id=0, **values))

    try:
        bench.step()
        twist = bench.get("twist")
        assert not np.asarray(twist.linear).any() and not np.asarray(twist.angular).any()
        post(pygame.JOYAXISMOTION, axis=0, value=0.19)  # within the dead zone
        post(pygame.JOYAXISMOTION, axis=3, value=-0.6)
        post(pygame.JOYAXISMOTION, axis=1, value=-1.0)
        wait(bench, lambda: float(twist.linear[0]) > 0.0)
        assert np.asarray(twist.linear) == pytest.approx([0.2, 0.0, 0.0])
        assert np.asarray(twist.angular) == pytest.approx([0.0, 0.0, 0.25])
        post(pygame.JOYAXISMOTION, axis=0, value=1.0)
        wait(bench, lambda: float(twist.linear[1]) < 0.0)
        assert float(twist.linear[1]) == pytest.approx(-0.1)
        post(pygame.JOYBUTTONDOWN, button=0)
        wait(bench, lambda: float(twist.linear[2]) > 0.0)
        post(pygame.JOYBUTTONUP, button=0)
        post(pygame.JOYDEVICEREMOVED)
        wait(bench, lambda: float(twist.linear[0]) == 0.0)
        assert not np.asarray(twist.linear).any() and not np.asarray(twist.angular).any()
        assert bench.block.metrics()["events"] >= 7
        post(pygame.JOYBUTTONDOWN, button=6)
        wait(bench, lambda: bench.clock.stop_reason == "back was pressed")
    finally:
        bench.close()
    assert not pygame.display.get_init(), "the library is as it was"


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(AloftError, match=r"pip install 'pygame"):
        load("aloft:hopping/steer_by_gamepad")


def test_a_gamepad_that_closes_leaves_another_its_events() -> None:
    pygame = pytest.importorskip("pygame")
    kept, closed = (BlockBench(Gamepad, {}) for _ in range(2))
    try:
        kept.step()
        closed.step()
        closed.close()
        pygame.event.post(pygame.event.Event(pygame.JOYBUTTONDOWN, instance_id=0, button=0))
        wait(kept, lambda: float(kept.get("twist").linear[2]) > 0.0)
    finally:
        kept.close()
