"""A running graph as another process of this machine sees it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from ....runtime.language.errors import AloftError
from ....runtime.language.layout import Layout
from ....runtime.language.stages import CheckedGraph
from ....runtime.live.parameter_endpoint import (
    EndpointError,
    answers,
    ask,
    ask_to_watch,
    set_parameters,
)
from ....runtime.live.window import (
    ENDED,
    PAUSED,
    RATE,
    STARTING,
    WindowContents,
    WindowLayout,
    WindowReader,
    digest,
)
from ....runtime.loading import LoadError, checked_file, checked_text
from ....runtime.running.memory import Memory
from .texts import ValueTexts, lateness_text, tick_text, time_texts

STALLED_AFTER = 1.0
"""Seconds without a new tick after which the graph is shown as standing still."""


class LiveRun:
    """Looks at the run that answers at a socket, and changes its parameters.

    Where that run has ended and another one of the same graph answers there, it looks at the new one.

    Args:
        path: of the socket; see ``parameter_endpoint``.

    Attributes:
        graph: the graph that runs, loaded from its file, or, where that has changed since, from the
            text that the run has.
        clock: how the run is paced.
        machine: whose part of the graph runs there; empty for the whole graph.

    Raises:
        EndpointError: nobody answers there.
        AloftError: the graph or its blocks have changed since the run began.
    """

    has_parameters = True

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._reader: WindowReader | None = None
        self._attach()

    def _attach(self) -> None:
        about, descriptor = ask_to_watch(self._path)
        try:
            graph = _load(about)
            layout, machine, paths = _bus_of(graph, about["digest"])
            shape = WindowLayout(**about["shape"])
        except BaseException:
            os.close(descriptor)
            raise
        self.close()
        self.graph = graph
        self.clock = str(about["clock"])
        self.machine = machine
        self._own = [
            spec.path for spec in graph.blocks if not machine or spec.machine == machine
        ]  # others are received, and that takes another time than they do
        self._about = about
        self._texts = ValueTexts(graph, layout, paths)
        self._reader = WindowReader(descriptor, shape)
        self._seen, self._since = -1, time.monotonic()
        self._tried = time.monotonic()

    def close(self) -> None:
        """Look no more."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    def refresh(self) -> None:
        """Look at the run that answers at the socket now, if another one does."""
        with self._lock:
            if self._other() is not None:
                self._attach()

    def lines(self, name: str) -> dict[str, Any]:
        """Describe the lines of a field in a strip chart; see ``ValueTexts.lines``."""
        with self._lock:
            return self._texts.lines(name)

    def now(self, charted: Sequence[str] = ()) -> dict[str, Any]:
        """Return the present state, as plain data.

        Args:
            charted: fields whose numbers are wanted, too, by ``block.port.field``.
        """
        with self._lock:
            assert self._reader is not None
            look = self._reader.look()
            state, said = self._state(look)
            if state in ("ended", "gone") and time.monotonic() - self._tried > STALLED_AFTER:
                self._tried = time.monotonic()
                other = self._other()
                if other is not None:
                    if other["text"] != self._about["text"]:
                        return {"state": "other", "said": "another graph runs there now"}
                    self._attach()
                    look = self._reader.look()
                    state, said = self._state(look)
            if look is None:
                return {"state": state, "said": said}
            control: dict[str, Any] | None = None
            if state == "paused":
                try:
                    control = self.control("look")
                except EndpointError:
                    state, said = "gone", "the process has gone, and did not say why"
                else:
                    said = paused_text(control, self.graph.base_period)
            return {"state": state, "said": said, "control": control, **self._moment(look, charted)}

    def _moment(self, look: WindowContents, charted: Sequence[str]) -> dict[str, Any]:
        assert self._reader is not None
        period = self.graph.base_period
        lines = [f"the part on {self.machine}"] if self.machine else []
        lines.append(f"tick {look.tick}, {look.tick * period:.3f} s")
        lines.append(tick_text(look.stamps, period))
        if self.clock == "free":
            lines.append("as fast as it can, so there are no deadlines")
        else:
            lines.append(lateness_text(look))
        return {
            "tick": look.tick,
            "charted": self._texts.numbers(look.bus, charted),
            "line": "; ".join(line for line in lines if line),
            "values": self._texts.all(look.bus),
            "brief": self._texts.brief(look.bus),
            "times": {
                path: text
                for path, text in time_texts(
                    self._reader.shape.programs, look.stamps, look.late
                ).items()
                if path in self._own
            },
            "late": {path: count for path, count in look.late.items() if count},
            "changes": look.changes,
        }

    def _state(self, look: WindowContents | None) -> tuple[str, str]:
        """Return the state of the run, and a sentence on it."""
        if look is None:
            return "gone", "the process was stopped in the midst of a tick"
        if look.state == ENDED:
            return "ended", f"the run has ended: {look.said}" if look.said else "the run has ended"
        if look.state == PAUSED:
            self._since = time.monotonic()
            return "paused", ""
        if look.tick != self._seen or look.state == STARTING:
            self._seen, self._since = look.tick, time.monotonic()
        silent = time.monotonic() - self._since
        # a window is renewed RATE times a second of the graph's time, or with every tick
        if silent > max(STALLED_AFTER, 3.0 * max(self.graph.base_period, 1.0 / RATE)):
            if not answers(self._path):
                return "gone", "the process has gone, and did not say why"
            return "still", f"no tick has come for {silent:.1f} s"
        if look.state == STARTING:
            if not answers(self._path):
                return "gone", "the process has gone, and did not say why"
            return "starting", "the blocks are being started"
        return "running", ""

    def _other(self) -> dict[str, Any] | None:
        """Return the description of another run at the same socket."""
        try:
            about, descriptor = ask_to_watch(self._path)
        except EndpointError:
            return None
        os.close(descriptor)
        return about if about["process"] != self._about["process"] else None

    def parameters(self) -> list[dict[str, Any]]:
        """All parameters that can be changed, as they are now. Raises ``EndpointError``."""
        listed = ask(self._path, {"verb": "list"})["parameters"]
        return [entry for entry in listed if entry["live"]]

    def set(self, settings: list[str]) -> list[dict[str, Any]]:
        """Change parameters, all in one tick. Raises ``EndpointError``."""
        return set_parameters(self._path, settings)

    @property
    def can_be_paused(self) -> bool:
        """True if the run can be paused and go back."""
        return not self._about["refusal"]

    @property
    def is_paced(self) -> bool:
        """True if ticks begin by wall time, at a playback rate that can be chosen."""
        return self.clock == "paced"

    def control(self, do: str, number: int | None = None) -> dict[str, Any]:
        """Pause the run, go back in it, or let it go on.

        Args:
            do: ``pause``; ``go on``, with the number of ticks after which it pauses again; ``back``,
                with the tick, to the last snapshot up to it; ``play``, with the percentage of real
                time; or ``look``.
            number: of ticks, the tick, or the percentage.

        Returns:
            How the run stands then; see ``RunControl.about``.

        Raises:
            EndpointError: nobody answers, or the run refuses.
        """
        of = {"back": "tick", "go on": "ticks", "play": "percent"}.get(do)
        more = {of: number} if of is not None and number is not None else {}
        return ask(self._path, {"verb": "control", "do": do, **more})


def paused_text(control: dict[str, Any], period: float) -> str:
    """Describe a paused run: its tick, and how far back it can go."""
    tick, kept = control["tick"], control["kept"]
    over = f" at its end ({control['over']})" if control["over"] else ""
    back = (
        f"it can go back to {len(kept)} snapshots from {kept[0] * period:.3f} s on" if kept else ""
    )
    problem = f"no more snapshots are kept: {control['problem']}" if control["problem"] else ""
    said = [f"paused before tick {tick}, {tick * period:.3f} s{over}", back, problem]
    return "; ".join(filter(None, said))


def _bus_of(graph: CheckedGraph, wanted: str) -> tuple[Layout, str, Collection[str]]:
    """Return the layout of the bus of the graph or of one machine's part of it, the machine, and
    the blocks whose outputs are known there.

    Raises:
        AloftError: none of them has the digest that is ``wanted``.
    """
    layout = Memory(graph.blocks, graph.robot).bus.layout
    if digest(layout, graph) == wanted:
        return layout, "", [spec.path for spec in graph.blocks]
    if graph.machines:
        from ....runtime.links.part import part_graph
        from ....runtime.placement.placed import split_over_machines

        placed = split_over_machines(graph)
        for machine in placed.machines:
            part = part_graph(placed, machine.name)
            layout = Memory(part.blocks, part.robot).bus.layout
            if digest(layout, part) == wanted:
                own = [spec.path for spec in graph.blocks if spec.machine == machine.name]
                received = [link.source for link in placed.received_by(machine.name)]
                return layout, machine.name, [*own, *received]
    raise AloftError(
        f"{graph.name} cannot be watched: its blocks have changed since the run began; start it again"
    )


def _load(about: dict[str, Any]) -> CheckedGraph:
    """Load the graph that runs. Raises ``LoadError`` where its code or files have gone since."""
    file, text = Path(about["file"] or f"{about['graph']}.yaml"), about["text"]
    if file.is_relative_to(Path.cwd()):
        file = file.relative_to(Path.cwd())  # so that places in it are short
    if file.is_file():
        try:
            graph = checked_file(file, about["overrides"])
        except LoadError:
            pass
        else:
            if graph.text == text:
                return graph
    return checked_text(text, file)
