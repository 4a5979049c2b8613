"""Finds the flights of a run: when the robot left the ground and when it came back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHORTEST_FLIGHT = 0.03
"""Without load for less [s] is a bounce, not a flight."""
LIFT_OFF, TOUCHDOWN = "lift-off", "touchdown"
"""The texts of the events."""


class Flights:
    """Finds when the robot left the ground and when it came back.

    A time in the air that is shorter than ``least`` ticks is a bounce and no event."""

    def __init__(self, least: int) -> None:
        self._least = least
        self._began: int | None = None
        self._told = False

    def add(self, ticks: NDArray[np.int64], loaded: NDArray[np.bool_]) -> list[tuple[int, str]]:
        """The events, as (tick, text), that show in further ticks.

        ``loaded`` (n, n_contacts) says which points carry load.
        """
        events: list[tuple[int, str]] = []
        on_ground: list[bool] = np.atleast_1d(loaded.any(axis=1)).tolist()
        for tick, standing in zip(ticks.tolist(), on_ground, strict=True):
            if standing:
                if self._told:
                    events.append((tick, TOUCHDOWN))
                self._began, self._told = None, False
                continue
            if self._began is None:
                self._began = tick
            if not self._told and tick - self._began >= self._least - 1:
                events.append((self._began, LIFT_OFF))
                self._told = True
        return events
