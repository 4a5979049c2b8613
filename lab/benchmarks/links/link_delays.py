"""Jumps of BRUCE with the controller on another machine, free-running, with links that take their time.

In virtual time (``runtime/testing/spread``): both parts tick at 500 Hz at phases drawn from the
seed. Every message takes the same time; or, with jitter, up to so much longer, so that messages may
overtake each other; and, with loss, a share of them never comes. All of that is drawn from the
seed, for each link by itself. Its ``nominal`` delay is what it has to expect: the robot's own delay,
the links' both ways with half of the jitter, and half a period of waiting at each end.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence

import numpy as np

from ....runtime.loading import checked_file
from ....runtime.loading.reading.files import FOLDER
from ....runtime.testing.spread import VirtualRun, run_virtual
from ..rows import Row

GRAPH = FOLDER / "machines" / "jump_two.yaml"
DELAYS = (0.2e-3, 1e-3, 2e-3, 3e-3)
GOAL = 5.0
"""The largest good share of jumps that fail [%]."""
ROBOT_DELAY, PERIOD = 0.002, 0.002
SETTINGS = (
    "links.mode=free", "links.max_age=50 ms", "links.late=hold", "clock.kind=paced",
    "delay.follow=nominal",
)  # fmt: skip


def expected_delay(delay: float, jitter: float = 0.0) -> float:
    """Return the delay [s] that the controller expects, for links that take from ``delay`` to
    ``delay + jitter`` each way [s]."""
    return ROBOT_DELAY + 2.0 * delay + jitter + PERIOD


def jump(delay: float, seed: int, jitter: float = 0.0, loss: float = 0.0) -> VirtualRun:
    """Make one jump with links that take from ``delay`` to ``delay + jitter`` each way [s], and
    lose the share ``loss`` of their messages."""
    settings = [*SETTINGS, f"robot.seed={seed}", f"delay.nominal={expected_delay(delay, jitter)!r}"]
    graph = checked_file(GRAPH, settings)
    phase = float(np.random.default_rng(seed).random())
    return run_virtual(graph, travel(delay, jitter, loss, seed), {"ground": phase})


def travel(
    delay: float, jitter: float = 0.0, loss: float = 0.0, seed: int = 0
) -> Callable[[str, int], int | None]:
    """Return a draw of the travel times of messages [ns]: from ``delay`` to ``delay + jitter`` [s],
    uniformly; none for the share ``loss`` of them. The numbers of a link do not depend on what
    others carry."""
    streams: dict[str, np.random.Generator] = {}

    def take(key: str, now: int) -> int | None:
        if key not in streams:
            streams[key] = np.random.default_rng((seed, zlib.crc32(key.encode())))
        late, lost = streams[key].random(2)
        return None if lost < loss else round((delay + jitter * late) * 1e9)

    return take


def link_delays(
    delays: Sequence[float] = DELAYS, seeds: Sequence[int] = tuple(range(1000, 1005)),
    jitter: float = 0.0, loss: float = 0.0,
) -> list[Row]:  # fmt: skip
    """Measure the share of jumps that fail for each delay.

    Args:
        delays: what a message takes at least [s].
        seeds: of the trial, of the phases, and of what happens to messages.
        jitter: how much longer a message takes at most [s].
        loss: the share of messages that are lost.
    """
    beside = f", {100.0 * loss:g} % lost" if loss else ""
    rows = []
    for delay in delays:
        failed: list[str] = []
        for seed in seeds:
            run = jump(delay, seed, jitter, loss)
            if not run.success:
                failed.append(f"{seed}: {run.reason}")
        succeeded = f"{len(seeds) - len(failed)} of {len(seeds)} succeed"
        note = f"{succeeded}, nominally {expected_delay(delay, jitter) * 1e3:g} ms"
        longest = f" to {(delay + jitter) * 1e3:g}" if jitter else ""
        rows.append(
            Row(f"jumps that fail, links of {delay * 1e3:g}{longest} ms each way{beside}",
                100.0 * len(failed) / len(seeds), "%", goal=GOAL,
                note="; ".join([note, *failed[:3]]))
        )  # fmt: skip
    return rows
