"""The controller in real time: the process of a jump as a whole, and a loop that waits busily."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path

from ..aloft_process import time_process
from ..rows import Row
from .controller import GRAPH, RecordedController, RecordedJump

RATES = (500, 1000, 2000, 4000, 5000, 8000, 10_000, 15_000, 20_000)
"""The rates that the loop tries [Hz]."""
LATE = 0.005
"""The share of ticks that may be late."""
SECONDS = 1.0


def process_row(jump: RecordedJump, repeats: int = 3) -> Row:
    """The shortest whole process of ``aloft run graphs/jump.yaml`` of a few, with its recording, as
    a share of the time that the jump takes in the world."""
    with tempfile.TemporaryDirectory() as folder:
        found = time_process(["run", str(GRAPH), "--json"], Path(folder), repeats)
    lasted = json.loads(found.output)["ticks"] * jump.graph.base_period
    wall = found.wall
    return Row(
        "aloft run graphs/jump.yaml, whole process", wall, "s", "real time", wall / lasted,
        goal=1 / 5, floor=1 / 2, note=f"with its recording; the jump takes {lasted:.2f} s, "
        f"the processors {found.user:.2f} s",
    )  # fmt: skip


def busy_wait_row(jump: RecordedJump, seconds: float = SECONDS) -> Row:
    """The shortest period at which fewer than ``LATE`` of the ticks begin late."""
    controller = RecordedController(jump)
    controller.run(min(jump.ticks, 200))
    best, shares = 0, []
    for rate in RATES:
        share = late_share(controller, jump, rate, seconds)
        shares.append(f"{rate / 1000:g} kHz {100 * share:.1f} %")
        if share < LATE:
            best = rate
    if not best:
        return Row("busy-wait loop, period", None, "us", note=f"late: {', '.join(shares)}")
    return Row(
        "busy-wait loop, period", 1e6 / best, "us", goal=50.0, floor=250.0,
        note=f"{best / 1000:g} kHz; late: {', '.join(shares)}",
    )  # fmt: skip


def late_share(
    controller: RecordedController, jump: RecordedJump, rate: float, seconds: float
) -> float:
    """The share of ticks whose deadline had passed before they could begin. A tick that is late
    begins at once, and the deadlines after it are counted from there."""
    advance, now = controller.ticker.advance, time.perf_counter_ns
    period, count = round(1e9 / rate), max(1, round(seconds * rate))
    late = 0
    deadline = now() + period
    for _ in range(count):
        if controller.tick == jump.ticks:
            controller.again()  # where the jump begins anew, the time for that is given
            deadline = now() + period
        if now() > deadline:
            late += 1
            deadline = now()
        while now() < deadline:
            pass
        controller.show(controller.tick)
        advance(1)
        controller.bound.clock.stop_reason = None
        deadline += period
    return late / count
