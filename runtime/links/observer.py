"""Watches a graph that runs on several machines, from anywhere: it hears, and sends nothing."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Self

from ..language.errors import AloftError
from ..placement.placed import PlacedGraph
from .identity import Identity
from .showing import read_row
from .transport import rows_key, status_key, window_key
from .zenoh_transport import as_chunk, prefix_of, session_config

STALE = 2.0
"""Seconds after which a part that says nothing counts as silent."""


class Observer:
    """A session that connects to all machines of a graph, for a ``with`` statement.

    Args:
        placed: the graph.
        secured: TLS and access control, as ``key_folder.secured`` gives them.

    Attributes:
        statuses: the latest status of each machine that was heard.
    """

    def __init__(self, placed: PlacedGraph, secured: Mapping[str, Any] | None = None) -> None:
        self.placed = placed
        self.statuses: dict[str, dict[str, Any]] = {}
        self._heard: dict[str, float] = {}
        self._hash = Identity.of(placed).graph_hash
        self._secured = secured
        self._prefix = prefix_of(placed.graph.name)
        self._session: Any = None
        self._kept: list[Any] = []

    def __enter__(self) -> Self:
        """Connect to whoever is there, and go on trying.

        Raises:
            AloftError: the session cannot be opened.
        """
        import zenoh

        machines = self.placed.machines
        endpoints = [spec.endpoint for spec in machines]
        try:
            self._session = zenoh.open(session_config([], endpoints, self._secured))
        except zenoh.ZError as error:
            raise AloftError(f"no session of Zenoh could be opened: {error}") from error
        for spec in machines:
            self._subscribe(status_key(spec.name), self._take)
        return self

    def __exit__(self, *_: object) -> None:
        session, self._session = self._session, None
        self._kept.clear()
        with suppress(Exception):  # whatever a network does, watching ends
            session.close()

    def rows(self, machine: str, size: int, take: Callable[[int, bytes], None]) -> None:
        """Have the bus of a part taken as it comes, with its tick; ``size`` are its bytes."""

        def heard(data: bytes) -> None:
            found = read_row(data, size)
            if found is not None:
                take(*found)

        self._subscribe(rows_key(machine), heard)

    def windows(self, machine: str, take: Callable[[bytes], None]) -> None:
        """Have what a part shows of itself for a page taken as it comes; see ``live.part_feed``."""
        self._subscribe(window_key(machine), take)

    def seconds_since(self, machine: str) -> float | None:
        """How long ago a machine was heard [s]; ``None`` if it never was."""
        heard = self._heard.get(machine)
        return None if heard is None else time.monotonic() - heard

    def wait_for(self, machines: tuple[str, ...], seconds: float) -> tuple[str, ...]:
        """Wait until these machines have been heard; gives those that were not."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if all(name in self.statuses for name in machines):
                return ()
            time.sleep(0.02)
        return tuple(name for name in machines if name not in self.statuses)

    def state_of(self, machine: str) -> str:
        """Whether a machine runs this graph, another, or is silent."""
        silent = self.seconds_since(machine)
        if silent is None or silent > STALE:
            return "silent"
        status = self.statuses[machine]
        if status["hash"] != self._hash:
            return "another graph"
        return str(status["phase"])

    def _take(self, data: bytes) -> None:
        with suppress(Exception):  # whatever bytes do, a thread of the network goes on
            status = json.loads(data)
            name = status["machine"]
            if name in [spec.name for spec in self.placed.machines]:
                float(status["rate_hz"]), int(status["tick"]), status["hash"] + status["phase"]
                self.statuses[name] = status
                self._heard[name] = time.monotonic()

    def _subscribe(self, key: str, take: Callable[[bytes], None]) -> None:
        import zenoh

        def heard(sample: Any) -> None:
            take(sample.payload.to_bytes())

        self._kept.append(
            self._session.declare_subscriber(
                f"{self._prefix}/{as_chunk(key)}", zenoh.handlers.Callback(heard, indirect=False)
            )
        )
