"""Live parameters of a graph on several machines: a change takes effect in one tick on all, or on none."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from ..language.block import Block
from ..language.errors import AloftError
from ..language.parameter_change import Adjustment
from ..language.parameters import Parameters
from ..loading.checking.parameters import adjust
from ..running.failures import describe
from ..running.live_parameters import LiveParameters


class SpreadParameters(LiveParameters):
    """The parameters of one part, and of what stands for the other parts' blocks.

    An adjustment that is handed in here waits until the tick ends. Then all parts get it as a
    proposal, each tries it, and only if all can take it over it stays.
    """

    def __init__(self, blocks: Mapping[str, Block]) -> None:
        super().__init__(blocks)
        self.handed_in: deque[Adjustment] = deque(maxlen=1)
        self._tried: Adjustment | None = None
        self._before: Mapping[str, Parameters] = {}

    def proposal(self) -> Adjustment | None:
        """The adjustment that waits here, if any."""
        return self.handed_in.popleft() if self.handed_in else None

    def try_settings(self, settings: Mapping[str, Any]) -> str:
        """Take over another part's proposal for now. Returns why it cannot be, or an empty text."""
        try:
            return self.try_out(adjust(self.blocks, settings))
        except AloftError as error:
            return str(error)

    def try_out(self, adjustment: Adjustment) -> str:
        """Take over an adjustment for now. Returns why it cannot be, or an empty text."""
        self._before = {path: self.blocks[path].params for path in adjustment.params}
        self._tried = adjustment
        for path, params in adjustment.params.items():
            self.blocks[path].params = params
            try:
                self.blocks[path].on_parameters()
            except Exception as error:  # noqa: BLE001  # the block's reason goes to whoever asked
                self.undo()
                return f"block '{path}' refuses the change: {describe(error)}"
        return ""

    def undo(self) -> None:
        """Go back to the parameters before what was tried, if anything was."""
        for path, params in self._before.items():
            self.blocks[path].params = params
            self.blocks[path].on_parameters()
        self._before, self._tried = {}, None

    def keep(self, tick: int) -> None:
        """Keep what was tried; it holds from ``tick`` on."""
        assert self._tried is not None
        self._tried.tick = tick
        for change in self._tried.changes():
            self.changes.append(change)
            for listener in self.listeners:
                listener(change)
        self._before, self._tried = {}, None
