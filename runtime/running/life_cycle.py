"""The life of a graph: idle -> ready -> running -> stopping -> stopped; no run leaves out stopping.

Whatever ends a run, every block that was started gets its stop cycles, in which a robot commands
damping, and is then closed. An error of one block there does not keep the others from theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum

from ..language.block import STOP_CYCLES, Block
from ..language.errors import AloftError, RunError
from .failures import describe


class LifeState(Enum):
    """State of a graph in its life."""

    IDLE = "idle"
    """Bound; nothing is open."""
    READY = "ready"
    """Every block has started."""
    RUNNING = "running"
    STOPPING = "stopping"
    """Stop cycles go out."""
    STOPPED = "stopped"
    """All blocks are closed."""


_NEXT: Mapping[LifeState, tuple[LifeState, ...]] = {
    LifeState.IDLE: (LifeState.READY, LifeState.STOPPING),
    LifeState.READY: (LifeState.RUNNING, LifeState.STOPPING),
    LifeState.RUNNING: (LifeState.STOPPING,),
    LifeState.STOPPING: (LifeState.STOPPED,),
    LifeState.STOPPED: (),
}


class LifeCycle:
    """Starts and stops the blocks of a graph, in file order.

    ``problems`` collects one text for everything that went wrong while stopping. ``guarding`` is
    true while a stop cycle or ``close`` of one block runs: an interrupt may raise an error there
    without harm to the other blocks. ``calls`` counts these calls.
    """

    def __init__(self, blocks: Mapping[str, Block]) -> None:
        self.state = LifeState.IDLE
        self.problems: list[str] = []
        self.guarding = False
        self.calls = 0
        self._blocks = blocks
        self._started: list[str] = []

    def move(self, state: LifeState) -> None:
        """Go on to ``state``. Raises ``AloftError`` if it does not follow the present one."""
        if state not in _NEXT[self.state]:
            raise AloftError(f"a graph that is {self.state.value} cannot become {state.value}")
        self.state = state

    def start(self) -> None:
        """Start all blocks: idle -> ready. Raises ``RunError`` naming the block that failed."""
        if self.state is not LifeState.IDLE:
            raise AloftError(f"a graph that is {self.state.value} cannot be started")
        for path, block in self._blocks.items():
            self._started.append(path)  # before the call, as a failed start may have opened devices
            try:
                block.start()
            except Exception as error:
                raise RunError(
                    f"block '{path}' failed in start: {describe(error)}", block=path
                ) from error
        self.move(LifeState.READY)

    def stop(self, pause: Callable[[], None] | None = None) -> None:
        """Run the stop cycles, with ``pause`` after each round, and close: any state -> stopped."""
        if self.state is LifeState.STOPPED:
            return
        self.move(LifeState.STOPPING)
        resting = [
            path
            for path in self._started
            if type(self._blocks[path]).stop_cycle is not Block.stop_cycle
        ]
        for cycle in range(1, STOP_CYCLES + 1):
            for path in resting:
                self._guard(path, self._blocks[path].stop_cycle, f"stop cycle {cycle}")
            if resting and pause is not None:
                self._guard("", pause, f"the pause after stop cycle {cycle}")
        for path in self._started:
            self._guard(path, self._blocks[path].close, "close")
        self.move(LifeState.STOPPED)

    def _guard(self, path: str, call: Callable[[], None], what: str) -> None:
        try:
            try:
                self.calls += 1
                self.guarding = True
                call()
            finally:
                self.guarding = False
        except BaseException as error:  # noqa: BLE001  # the next block must get its turn
            who = f"block '{path}'" if path else "the runtime"
            self.problems.append(f"{who} failed in {what}: {describe(error)}")
