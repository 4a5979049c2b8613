"""Shows a placed graph: its machines with their blocks, and its links with their size and rate."""

from __future__ import annotations

from typing import Any

from .placed import Link, PlacedGraph


def machine_rows(placed: PlacedGraph) -> list[tuple[str, str, str, str, str]]:
    """For each machine: name, endpoint, its blocks, and the bytes a second it sends and receives."""
    return [
        (
            machine.name,
            machine.endpoint,
            ", ".join(spec.path for spec in placed.blocks_on(machine.name)) or "nothing",
            _load(placed.sent_by(machine.name)),
            _load(placed.received_by(machine.name)),
        )
        for machine in placed.machines
    ]


def link_rows(placed: PlacedGraph) -> list[tuple[str, str, str, str, str]]:
    """For each link: source, way, rate, payload and the inputs that read it."""
    return [
        (
            link.source,
            f"{link.sender} -> {link.receiver}",
            f"{link.rate_hz:g} Hz",
            f"{link.payload} B",
            ", ".join(link.readers),
        )
        for link in placed.links
    ]


def placement_json(placed: PlacedGraph) -> dict[str, Any]:
    """The placement as plain data."""
    return {
        "machines": [
            {
                "name": machine.name,
                "endpoint": machine.endpoint,
                "blocks": [spec.path for spec in placed.blocks_on(machine.name)],
            }
            for machine in placed.machines
        ],
        "links": [
            {
                "source": link.source,
                "sender": link.sender,
                "receiver": link.receiver,
                "rate_hz": link.rate_hz,
                "payload_bytes": link.payload,
                "fields": [field.describe() for field in link.fields],
                "readers": list(link.readers),
            }
            for link in placed.links
        ],
    }


def _load(links: tuple[Link, ...]) -> str:
    """Links in total, as ``3 links, 240 kB/s``."""
    if not links:
        return "nothing"
    rate = sum(link.payload * link.rate_hz for link in links) * 1e-3
    return f"{len(links)} link{'s' if len(links) > 1 else ''}, {rate:.3g} kB/s"
