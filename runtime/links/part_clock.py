"""The clock of one part: all parts end after the same tick."""

from __future__ import annotations

from collections.abc import Callable

from ..language.block import Clock


class PartClock(Clock):
    """A clock that ends the run only when all parts have agreed to end after the same tick.

    A block or a signal asks for the end as ever, by ``stop_reason`` and ``stopped_by``. The wish of
    whoever asks first is kept in ``wish``, and the conductor tells it to the others. A signal may
    come at any time, so without this a part could end a tick before the others.
    """

    def __init__(self, base_period: float) -> None:
        self.wish: tuple[str, str] | None = None
        self._agreed: tuple[str, str] | None = None
        self._heeded = False
        self.heard: Callable[[], int] | None = None
        """What says when commands were last heard; see ``CommandWatch.heard``."""
        super().__init__(base_period)

    def commands_heard(self) -> int:
        """When the most silent link that brings commands last brought one [ns]."""
        return 0 if self.heard is None else self.heard()

    def agree(self, reason: str, block: str) -> None:
        """End the run after this tick."""
        self._agreed = (reason, block)

    @property
    def stop_reason(self) -> str | None:
        """Why all parts end after this tick."""
        return self._agreed[0] if self._agreed else None

    @stop_reason.setter
    def stop_reason(self, reason: str | None) -> None:
        if reason is None:
            self.wish = self._agreed = None
        self._heeded = reason is not None and self.wish is None
        if reason is not None and self._heeded:
            self.wish = (reason, "")

    @property
    def stopped_by(self) -> str:
        """The path of the block that asked first."""
        return self._agreed[1] if self._agreed else ""

    @stopped_by.setter
    def stopped_by(self, block: str) -> None:
        if self._heeded and self.wish is not None:
            self.wish = (self.wish[0], block)
