"""``aloft run --machine``: runs one machine's part of a graph, over Zenoh, together with the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...runtime.language.errors import AloftError
from ...runtime.language.stages import CheckedGraph
from ...runtime.links.observer import StatusPublisher
from ...runtime.links.part import BoundPart, run_part
from ...runtime.live.part_feed import PartFeed
from ...runtime.placement.placed import place
from ...runtime.running.real_time import NO_REAL_TIME, RealTimeOptions
from ...runtime.running.run_result import RunResult
from ...runtime.running.sinks import Sink
from ...runtime.transports.keys import check_endpoints, secured
from ...runtime.transports.zenoh_transport import ZenohTransport


class Part:
    """One machine's part, bound and ready to run once.

    Args:
        graph: the graph.
        machine: the machine.
        keys: the folder of ``aloft keys``, for links over TLS.

    Raises:
        PlacementError: the graph names no such machine.
        AloftError: endpoints and keys do not fit together.
        RunError: a block could not be set up.
    """

    def __init__(self, graph: CheckedGraph, machine: str, keys: Path | None = None) -> None:
        placed = place(graph)
        if keys is not None:
            check_endpoints(placed)
        elif any(spec.endpoint.startswith("tls/") for spec in placed.machines):
            raise AloftError(
                "links over TLS need certificates: `aloft keys GRAPH` makes them, and "
                "--keys FOLDER takes them"
            )
        transport = ZenohTransport(
            graph.name,
            placed.machines,
            wait=graph.links.mode == "lockstep",
            secured=None if keys is None else secured(placed, keys, machine),
        )
        self.bound = BoundPart(placed, machine, transport)
        self._result: RunResult | None = None

    @property
    def checked(self) -> CheckedGraph:
        """The graph of this part."""
        return self.bound.graph

    def run(
        self,
        *,
        sinks: Sequence[Sink],
        log: bool,
        plain: bool = False,
        fuse: bool = True,
        real_time: RealTimeOptions = NO_REAL_TIME,
    ) -> RunResult:
        """Run the part once."""
        bound = self.bound
        showing = StatusPublisher(bound.machine, bound.transport, bound.peers, bound.receivers)
        feed = PartFeed(bound.machine, bound.transport)
        self._result = run_part(
            bound, sinks=[*sinks, showing, feed], log=log, plain=plain, fuse=fuse,
            real_time=real_time,
        )  # fmt: skip
        return self._result

    def about(self) -> Mapping[str, Any]:
        """The machine, the metrics of each of its blocks, what its links have carried, and the others' clocks."""
        error = self._result.error if self._result is not None else None
        metrics = {path: dict(block.metrics()) for path, block in self.bound.blocks.items()}
        metrics |= {sink.name: dict(sink.metrics()) for sink in self.bound.path_ages}
        return {
            "machine": self.bound.machine,
            "heard": bool(getattr(error, "heard", False)),
            "metrics_by_block": {path: found for path, found in metrics.items() if found},
            "links": [receiver.about() for receiver in self.bound.receivers],
            "clocks": {
                name: {"offset_s": clock.offset * 1e-9, "uncertainty_s": clock.uncertainty * 1e-9}
                for name in self.bound.peers.names
                for clock in (self.bound.peers.clock_of(name),)
            },
        }
