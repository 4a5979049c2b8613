"""The velocity commanded with the sticks of a gamepad."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from ....files.pip_line import pip_line
from ....runtime.language.block import Block, Context, Metric, Output, UnmetRequirement
from ....runtime.language.parameters import Parameters, parameter
from ..signals import BodyTwist

AHEAD, ASIDE, TURN = 1, 0, 3
"""Axes of a pad with two sticks, as SDL numbers them: both of the left stick, and the right one sideways."""
JUMP, END = 0, 6
"""Buttons: A and back."""
LOOK = 0.01
"""Period of the reader's look for events [s]."""

_sdl_lock = threading.Lock()
_sdl_users = 0


@contextmanager
def sdl_video(pygame: Any) -> Iterator[None]:
    """Keep SDL's events and joysticks, which a process has once, until their last user leaves."""
    global _sdl_users
    with _sdl_lock:
        _sdl_users += 1
        pygame.display.init()
        pygame.joystick.init()
    try:
        yield
    finally:
        with _sdl_lock:
            _sdl_users -= 1
            if not _sdl_users:
                pygame.joystick.quit()
                pygame.display.quit()


class Gamepad(Block):
    """The velocity of the sticks, for ``TwistCommand``.

    ==========================  =====================================
    stick or button             asks for
    ==========================  =====================================
    left stick                  a velocity ahead, back or aside
    right stick, sideways       a turn
    A                           a jump on the spot, as long as it is held
    back                        the end of the run
    ==========================  =====================================

    The library is pygame (the extra ``gamepad``), which knows the pads of all makers through SDL. A
    thread of its own reads the events, so a tick only copies numbers. A pad may be plugged in later; when it is pulled
    out the velocity is zero. A replay takes the velocities from the recording.
    """

    class Params(Parameters):
        speed: float = parameter(
            0.16, unit="m/s", gt=0.0, le=1.0, text="of a stick that is pushed ahead to its end"
        )
        speed_aside: float = parameter(
            0.08, unit="m/s", gt=0.0, le=1.0, text="of one that is pushed aside"
        )
        turn: float = parameter(0.3, unit="rad/s", gt=0.0, le=2.0, text="of the right stick")
        dead: float = parameter(
            0.15, ge=0.0, lt=1.0, text="deflections below this share of the whole are none"
        )

    outside = "real"
    params: Params
    twist = Output(BodyTwist, text="the commanded velocity")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report that pygame is not installed."""
        from importlib.util import find_spec

        if find_spec("pygame") is None:
            yield UnmetRequirement(
                "hopping.Gamepad needs pygame, which is not installed",
                expected="pygame",
                found="none",
                fix=pip_line("gamepad"),
            )

    def setup(self) -> None:
        self._axes = [0.0, 0.0, 0.0]
        self._jump = self._ended = False
        self._pads: dict[int, Any] = {}
        self._events = 0
        self._ends, self._ready = threading.Event(), threading.Event()
        self._reader: threading.Thread | None = None

    def start(self) -> None:
        """Begin to read."""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._ready.wait()

    def step(self) -> None:
        """Copy where the sticks are."""
        p, (ahead, aside, turn) = self.params, self._axes
        self.twist.linear[0] = -p.speed * self._share(ahead)  # SDL counts down and right
        self.twist.linear[1] = -p.speed_aside * self._share(aside)
        self.twist.linear[2] = p.speed if self._jump else 0.0
        self.twist.angular[:] = 0.0
        self.twist.angular[2] = -p.turn * self._share(turn)
        if self._ended:
            self.request_stop("back was pressed")

    def _share(self, deflection: float) -> float:
        """Return the share of the whole velocity: it grows from zero at the edge of the dead zone."""
        beyond = max(abs(deflection) - self.params.dead, 0.0) / (1.0 - self.params.dead)
        return min(beyond, 1.0) * (1.0 if deflection >= 0.0 else -1.0)

    def close(self) -> None:
        """Read no more."""
        self._ends.set()
        if self._reader is not None:
            self._reader.join()
            self._reader = None

    def metrics(self) -> Mapping[str, Metric]:
        """Return the number of events."""
        return {"events": self._events}

    def _read(self) -> None:
        # SDL wants a window for its events; this driver has one that nobody sees.
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame

            with sdl_video(pygame):
                self._ready.set()
                while not self._ends.is_set():
                    for event in pygame.event.get():
                        self._take(pygame, event)
                    time.sleep(LOOK)
        finally:
            self._ready.set()  # also where SDL failed, or ``start`` would wait for ever

    def _take(self, pygame: Any, event: Any) -> None:
        """Take one event."""
        self._events += 1
        if event.type == pygame.JOYDEVICEADDED:
            pad = pygame.joystick.Joystick(event.device_index)
            self._pads[pad.get_instance_id()] = pad  # SDL sends events of pads that are held
        elif event.type == pygame.JOYDEVICEREMOVED:
            self._pads.pop(event.instance_id, None)
            self._axes, self._jump = [0.0, 0.0, 0.0], False
        elif event.type == pygame.JOYAXISMOTION and event.axis in (AHEAD, ASIDE, TURN):
            self._axes[(AHEAD, ASIDE, TURN).index(event.axis)] = float(event.value)
        elif event.type in (pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP):
            down = event.type == pygame.JOYBUTTONDOWN
            if event.button == JUMP:
                self._jump = down
            self._ended |= down and event.button == END
