"""The values of a recording, tick by tick, for its diagram."""

from __future__ import annotations

from collections.abc import Mapping

from ...runtime.drawing.page import shown
from ..file.reader import RecordedRun


class TickValues:
    """See ``runtime.drawing.values.Values``.

    Args:
        run: a recording with one tick or more.
    """

    def __init__(self, run: RecordedRun) -> None:
        self._run = run
        self._layout = run.header.bus.layout()
        self._signals = run.signals()
        self.ticks = (int(run.ticks[0]), int(run.ticks[-1]))
        self.period = 1.0 / run.header.base_rate
        blocks = (run.outcome or {}).get("blocks", {})
        self.times: Mapping[str, str] = {
            path: f"{t['calls']} runs, median {t['p50_us']:.1f} us, 99 % {t['p99_us']:.1f} us, "
            f"longest {t['max_us']:.1f} us, {t['overruns']} deadlines missed"
            for path, t in blocks.items()
        }

    def at(self, tick: int) -> Mapping[str, str]:
        """The values of the last recorded tick up to this one."""
        first, last = self.ticks
        tick = min(max(tick, first), last)
        known = self._run.ticks
        row = int(known.searchsorted(tick, side="right")) - 1
        _, rows = self._run.window(int(known[row]), int(known[row]) + 1)
        return {
            name: shown(self._layout.view(rows, name)[0], signal.unit or "")
            for name, signal in self._signals.items()
        }
