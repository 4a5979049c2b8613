"""A graph that runs in several parts, on machines or as processes here, as one page sees it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ....runtime.language.errors import AloftError
from ....runtime.language.layout import Layout
from ....runtime.links.observer import STALE, Observer
from ....runtime.links.part import part_graph
from ....runtime.live.parameter_endpoint import EndpointError, ask, set_parameters
from ....runtime.live.part_feed import PartWindow, read_part
from ....runtime.live.window import RATE, STARTING, digest
from ....runtime.placement.placed import PlacedGraph
from ....runtime.running.memory import Memory
from .live_run import STALLED_AFTER
from .texts import ValueTexts, lateness_text, tick_text, time_texts

Find = Callable[[], PlacedGraph | None]
"""Gives the graph as it runs now, with its endpoints; ``None`` where that is not known."""
AGAIN = 2.0
"""Seconds between two attempts to find a run that has been started anew."""
LOST = "the part was killed, or is out of reach"


class SpreadRun:
    """Looks at all parts of a graph, wherever they run, and sends nothing to them.

    Each part's blocks have the values and the times that this part shows. Where all parts have ended
    and the same graph is started again, also at other endpoints, it looks at the new run.

    Args:
        placed: the graph, with the endpoints of its parts.
        keys: the folder of ``aloft keys``, where links are encrypted.
        find: how to find a run that has been started anew.
        control: the socket of a part on this machine that takes changes of parameters, if there is
            one; see ``parameter_endpoint``.
        observer: the name by which the keys of the observer are known.

    Raises:
        AloftError: no session can be opened.
    """

    def __init__(
        self,
        placed: PlacedGraph,
        keys: Path | None = None,
        find: Find = lambda: None,
        control: Path | None = None,
        observer: str = "viewer",
    ) -> None:
        self._keys, self._observer_name = keys, observer
        self._find, self._control = find, control
        self._lock = threading.Lock()
        self._observer: Observer | None = None
        self._watch(placed)

    @property
    def has_parameters(self) -> bool:
        """True if parameters can be changed from here."""
        return self._control is not None

    def _watch(self, placed: PlacedGraph) -> None:
        observer = Observer(placed, self._keys, self._observer_name)
        parts = {spec.name: _Part(placed, spec.name) for spec in placed.machines}
        observer.__enter__()
        self.close()
        self._observer, self._placed, self._parts = observer, placed, parts
        self.graph = placed.graph
        for name, part in parts.items():
            observer.windows(name, part.take)
        self._tried = time.monotonic()

    def close(self) -> None:
        """Look no more."""
        observer, self._observer = self._observer, None
        if observer is not None:
            observer.__exit__()

    def is_heard(self, seconds: float) -> bool:
        """Return whether any part answers within this many seconds."""
        end = time.monotonic() + seconds
        while all(part.data is None for part in self._parts.values()):
            if time.monotonic() >= end:
                return False
            time.sleep(0.02)
        return True

    def refresh(self) -> None:
        """Look at the run that there is now, if another one has been started."""
        with self._lock:
            self._follow()

    def lines(self, name: str) -> dict[str, Any]:
        """Describe the lines of a field in a strip chart; see ``ValueTexts.lines``."""
        with self._lock:
            machine = self.graph.block(name.rsplit(".", 2)[0]).machine
            return self._parts[machine].texts.lines(name)

    def now(self, charted: Sequence[str] = ()) -> dict[str, Any]:
        """Return the present state, as plain data.

        Args:
            charted: fields whose numbers are wanted, too, by ``block.port.field``.
        """
        with self._lock:
            found = {name: part.now(charted) for name, part in self._parts.items()}
            if all(part["state"] in ("ended", "gone", "unheard") for part in found.values()):
                if time.monotonic() - self._tried > AGAIN and self._follow() == "other":
                    return {"state": "other", "said": "another graph runs there now"}
                found = {name: part.now(charted) for name, part in self._parts.items()}
        merged: dict[str, Any] = {
            "values": {}, "brief": {}, "times": {}, "late": {}, "charted": {},
        }  # fmt: skip
        for about in found.values():
            for key, into in merged.items():
                into.update(about.get(key, {}))
        states = [about["state"] for about in found.values()]
        state = states[0] if len(set(states)) == 1 else "partly"
        said = [f"{n} {about['said']}" for n, about in found.items() if about["said"]]
        lines = [f"{n}: {about['line']}" for n, about in found.items() if about.get("line")]
        ticks = [about["tick"] for about in found.values() if "tick" in about]
        return {
            "state": state,
            "said": "; ".join(said),
            "line": "; ".join(lines),
            "parts": {n: [about["state"], about["said"]] for n, about in found.items()},
            "tick": max(ticks, default=-1),
            "changes": max((about.get("changes", 0) for about in found.values()), default=0),
            **merged,
        }

    def _follow(self) -> str:
        """Turn to a run that has been started anew: "same", "new", or "other" for another graph."""
        self._tried = time.monotonic()
        placed = self._find()
        if placed is None or placed.machines == self._placed.machines:
            return "same"
        other = placed.graph.order != self.graph.order or placed.graph.name != self.graph.name
        self._watch(placed)
        return "other" if other else "new"

    def parameters(self) -> list[dict[str, Any]]:
        """All parameters that can be changed, as they are now. Raises ``EndpointError``."""
        listed = ask(self._socket(), {"verb": "list"})["parameters"]
        return [entry for entry in listed if entry["live"]]

    can_be_paused = is_paced = False

    def control(self, do: str, number: int | None = None) -> dict[str, Any]:
        """Refused. Raises ``AloftError``."""
        raise AloftError("a graph on several machines cannot be paused; run it in one process")

    def set(self, settings: list[str]) -> list[dict[str, Any]]:
        """Change parameters, in one tick on all parts. Raises ``EndpointError``."""
        return set_parameters(self._socket(), settings)

    def _socket(self) -> Path:
        if self._control is None:
            raise EndpointError("no part that runs on this machine takes changes of parameters")
        return self._control


class _Part:
    """State of one part as known here."""

    def __init__(self, placed: PlacedGraph, machine: str) -> None:
        graph = part_graph(placed, machine)
        layout: Layout = Memory(graph.blocks, graph.robot).bus.layout
        self.own = frozenset(s.path for s in placed.graph.blocks if s.machine == machine)
        self.data: bytes | None = None
        self._heard = 0.0
        self._period = graph.base_period
        self.texts = ValueTexts(placed.graph, layout, self.own)
        self._digest = digest(layout, graph)
        self._last: _LastMessage | None = None

    def take(self, data: bytes) -> None:
        """Keep a message; on a thread of the network."""
        self._heard = time.monotonic()
        self.data = data

    def now(self, charted: Sequence[str]) -> dict[str, Any]:
        """State and, once the part was heard, what it shows."""
        data, moment = self.data, time.monotonic()
        if data is None:
            return {"state": "unheard", "said": "has not been heard"}
        if self._last is None or self._last.data is not data:
            found = read_part(data)
            if found is not None:
                new = self._last is None or self._last.tick != found.look.tick
                since = moment if new or self._last is None else self._last.since
                self._last = _LastMessage(data, found.look.tick, since, found)
        if self._last is None:
            return {"state": "unheard", "said": "says what cannot be read: is it of this version?"}
        about = self._last.about
        if about.digest != self._digest:
            return {"state": "unheard", "said": "runs another graph"}
        state, said = self._state(about, moment)
        return {"state": state, "said": said, **self._shown(about, charted)}

    def _state(self, about: PartWindow, moment: float) -> tuple[str, str]:
        assert self._last is not None
        silent, still = moment - self._heard, moment - self._last.since
        if about.ended is not None:
            return "ended", f"has ended: {about.ended}"
        if silent > STALE:
            return "gone", f"has not been heard for {silent:.1f} s: {LOST}"
        if about.look.state == STARTING:
            return "starting", "starts its blocks"
        if still > max(STALLED_AFTER, 3.0 * max(self._period, 1.0 / RATE)):
            return "still", f"has made no tick for {still:.1f} s"
        return "running", ""

    def _shown(self, about: PartWindow, charted: Sequence[str]) -> dict[str, Any]:
        look = about.look
        lines = [f"tick {look.tick}, {look.tick * self._period:.3f} s"]
        lines.append(tick_text(look.stamps, self._period))
        if look.overruns or look.skipped:
            lines.append(lateness_text(look))
        times = time_texts(about.shape.programs, look.stamps, look.late)
        return {
            "tick": look.tick,
            "line": ", ".join(line for line in lines if line),
            "charted": self.texts.numbers(look.bus, charted),
            "values": self.texts.all(look.bus),
            "brief": self.texts.brief(look.bus),
            "times": {path: text for path, text in times.items() if path in self.own},
            "late": {p: count for p, count in look.late.items() if count and p in self.own},
            "changes": look.changes,
        }


@dataclass(frozen=True)
class _LastMessage:
    """A message that was read: its bytes, its tick, and since when no other tick has come [s]."""

    data: bytes
    tick: int
    since: float
    about: PartWindow
