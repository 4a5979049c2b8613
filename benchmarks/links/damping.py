"""How soon the drives are told to damp after the last command has come over a link."""

from __future__ import annotations

import os
import select
import time

import numpy as np

from ...hal.bear.watchdog import Watchdog, damping_frame
from ...runtime.language.stages import WATCHDOG
from ..rows import Row

GOAL = 20.0
"""Milliseconds from the last command to damping."""
_DEVICES = list(range(1, 11))


def damping(repetitions: int = 40) -> Row:
    """The longest time from the last command to the instruction that damps, by the watchdog's
    process, with nothing said by the process that it watches; on a pipe in place of a bus."""
    size = len(damping_frame(_DEVICES))
    times = np.full(repetitions, np.inf)
    for k in range(repetitions):
        reading, writing = os.pipe()
        watchdog = Watchdog(writing, _DEVICES, 60.0, WATCHDOG)
        try:
            heard = time.monotonic_ns()
            watchdog.beat(heard)
            if select.select([reading], [], [], 10.0)[0] and len(os.read(reading, size)) == size:
                times[k] = (time.monotonic_ns() - heard) * 1e-6
        finally:
            watchdog.close()
            os.close(reading)
            os.close(writing)
    note = f"of {repetitions}; median {np.median(times):.1f} ms, {WATCHDOG * 1e3:g} ms of silence"
    return Row("from the last command to damping", float(times.max()), "ms", goal=GOAL, note=note)
