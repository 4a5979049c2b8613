"""Changes parameters while a graph runs: they are handed over in one slot and taken between ticks.

Whoever wants a change (another thread, a replay) first has it checked by ``loading.adjust``, and
then hands over the ``Adjustment``. The control thread looks at the slot once a tick; it never
waits, and an empty slot costs it tens of nanoseconds. All changes of an adjustment take effect in
the same tick, or none does.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...mathematics.compiling.kernel_call import KernelCall, collect_calls
from ..language.block import Block
from ..language.errors import AloftError
from ..language.parameter_change import Adjustment, ParameterChange
from ..language.parameters import Parameters
from ..language.steps import refresh_parameters
from .failures import describe

ANSWER_TIME = 2.0
"""Seconds that ``submit`` waits for the next tick."""
_POLL = 1e-3


@dataclass
class Command:
    """Something else to do between two ticks, handed over in the same slot; see ``run_control``.

    Once ``answered`` is true, it was done, or refused for the reason in ``error``.
    """

    work: Callable[[], None]
    error: str = ""
    answered: bool = False


class LiveParameters:
    """The parameters of a bound graph's ``blocks`` while it runs.

    Attributes:
        requests: the slot. It holds one adjustment or command, which the control thread takes out.
        handed_in: where ``submit`` puts an adjustment. It is the slot, unless machines that share
            the graph must agree first.
        changes: all changes so far, in order.
        listeners: called on the control thread with every change, before its first tick.
    """

    def __init__(self, blocks: Mapping[str, Block]) -> None:
        self.blocks = blocks
        self.requests: deque[Adjustment | Command] = deque(maxlen=1)
        self.handed_in: deque[Any] = self.requests
        self.changes: list[ParameterChange] = []
        self.listeners: list[Callable[[ParameterChange], None]] = []
        self.compile: Callable[[Sequence[KernelCall]], object] | None = None
        """Compiles the calls of kernels that a block makes anew; none in a plain run."""

    def answer(self, tick: int) -> None:
        """Apply the adjustment in the slot, from ``tick`` on, or execute the command in it; only
        the control thread does this."""
        try:
            request = self.requests.popleft()
        except IndexError:  # withdrawn in this very moment
            return
        try:
            if isinstance(request, Command):
                request.work()
            else:
                self.apply(request, tick)
        except AloftError as error:
            request.error = str(error)
        request.answered = True

    def apply(self, adjustment: Adjustment, tick: int) -> None:
        """Change the parameters, from ``tick`` on.

        Raises:
            AloftError: a block refused its new parameters; then all blocks keep the old ones.
        """
        before = {path: self.blocks[path].params for path in adjustment.params}
        for path, params in adjustment.params.items():
            self.blocks[path].params = params
            try:
                self._take_over(self.blocks[path])
            except Exception as error:
                for other, old in before.items():
                    self.blocks[other].params = old
                    self._take_over(self.blocks[other])
                raise AloftError(f"block '{path}' refuses the change: {describe(error)}") from error
        adjustment.tick = tick
        for change in adjustment.changes():
            self.changes.append(change)
            for listener in self.listeners:
                listener(change)

    def go_back(self, params: Mapping[str, Parameters], changes: int) -> None:
        """Have these parameters again, after the first ``changes`` changes; the rest never was.

        Call it when the clock shows the tick from which they hold, and before the states are restored.
        """
        del self.changes[changes:]
        for path, block in self.blocks.items():
            if block.params is not params[path]:
                block.params = params[path]
                self._take_over(block)

    def _take_over(self, block: Block) -> None:
        with collect_calls() as calls:
            refresh_parameters(block)
            block.prepare()
        if self.compile is not None and calls:
            self.compile(calls)

    def submit(self, adjustment: Adjustment, timeout: float = ANSWER_TIME) -> None:
        """Hand an adjustment to the control thread and wait until it is taken over.

        Called from any other thread.

        Raises:
            AloftError: a block refused it, another adjustment is waiting, or no tick came in
                time. In all these cases nothing has changed.
        """
        self._hand_over(self.handed_in, adjustment, timeout)

    def command(self, work: Callable[[], None], timeout: float = ANSWER_TIME) -> None:
        """Have the control thread do something between two ticks, and wait until it is done.

        Raises:
            AloftError: it was refused, another request is waiting, or no tick came in time.
        """
        self._hand_over(self.requests, Command(work), timeout)

    @staticmethod
    def _hand_over(slot: deque[Any], request: Adjustment | Command, timeout: float) -> None:
        if slot:
            raise AloftError("another change is waiting for its tick; try again")
        slot.append(request)
        end = time.monotonic() + timeout
        while not request.answered:
            if time.monotonic() > end:
                try:
                    slot.remove(request)
                except ValueError:
                    end = time.monotonic() + timeout  # it was taken just now: wait for the answer
                    continue
                raise AloftError(f"no tick came within {timeout:g} s; nothing was changed")
            time.sleep(_POLL)
        if request.error:
            raise AloftError(request.error)
