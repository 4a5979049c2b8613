"""Colours and lines: what they mean, in light and in dark."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .diagram import Diagram, Node, Wire

LIGHT = {
    "page": "#ffffff", "text": "#1b1f24", "soft": "#5b6470", "edge": "#4a5260", "box": "#f3f5f8",
    "boxedge": "#9aa4b1", "truth": "#c22f2f",
}  # fmt: skip
DARK = {
    "page": "#14181d", "text": "#e8ebef", "soft": "#a3acb8", "edge": "#b4bcc8", "box": "#1d232a",
    "boxedge": "#5d6876", "truth": "#ff7b72",
}  # fmt: skip
WIRES_LIGHT = (
    "#2f5fb3",
    "#b3591f",
    "#2c7a4b",
    "#7a4aa8",
    "#8a6d12",
    "#1d7f8c",
    "#a83a6b",
    "#55606e",
)
WIRES_DARK = (
    "#7aa7f0",
    "#f0a06a",
    "#6cc98d",
    "#c39bef",
    "#d9bd55",
    "#5fc9d6",
    "#ee86b4",
    "#aab4c1",
)
"""Lines have the colour of the block they come from, so that they can be followed."""
RATES_LIGHT = ("#e9f0fb", "#fdf0e2", "#e7f5ec", "#f3ebfa", "#f8f3da", "#e2f4f6")
RATES_DARK = ("#1e2b3f", "#3a2a1a", "#1c3325", "#2f2340", "#35301a", "#183236")
"""Blocks have the colour of their rate."""


@dataclass(frozen=True)
class Style:
    """Which colour each source, each rate and each machine has in one drawing."""

    sources: dict[str, int]
    rates: dict[float, int]
    machines: dict[str, int]

    def wire(self, wire: Wire) -> int:
        """The number of a wire's colour."""
        return self.sources.get(owner(wire.source), 0) % len(WIRES_LIGHT)

    def block(self, node: Node) -> int:
        """The number of a block's colour."""
        return self.rates.get(node.rate_hz, 0) % len(RATES_LIGHT)


def owner(end: tuple[str, str]) -> str:
    """The block that writes; a border's port is named by it."""
    return port_of(end).rpartition(".")[0]


def port_of(end: tuple[str, str]) -> str:
    """The output ``block.port`` at an end of a wire that carries it."""
    return end[1] if "." in end[1] else f"{end[0]}.{end[1]}"


def style_of(diagram: Diagram) -> Style:
    """The colours of a diagram, also of what is inside of its boxes."""
    nodes = [node for node in _nodes(diagram) if node.title and not node.is_box]
    rates = sorted(dict.fromkeys(node.rate_hz for node in nodes), reverse=True)
    machines = dict.fromkeys(node.machine for node in nodes if node.machine)
    return Style(
        {node.path: number for number, node in enumerate(nodes)},
        {rate: number for number, rate in enumerate(rates)},
        {name: number for number, name in enumerate(machines)},
    )


def _nodes(diagram: Diagram) -> Iterable[Node]:
    for node in diagram.nodes.values():
        yield node
        if node.inside is not None:
            yield from _nodes(node.inside)


def hertz(rate: float) -> str:
    """``500 Hz``."""
    return f"{rate:g} Hz"


def legend(diagram: Diagram, style: Style) -> list[tuple[str, str]]:
    """What the drawing has, as (kind, text), where the kind says what the sample looks like."""
    wires = list(_wires(diagram))
    found = [(f"rate{number}", hertz(rate)) for rate, number in style.rates.items()]
    if any(node.moore for node in _nodes(diagram)):
        found.append(("moore", "outputs follow from state (Moore)"))
    if any(wire.delay for wire in wires):
        found.append(("delay", "delayed"))
    if any(wire.transition for wire in wires):
        found.append(("rates", "between rates"))
    if any(wire.truth for wire in wires):
        found.append(("truth", "simulation truth"))
    found += [(f"machine{number}", f"on {name}") for name, number in style.machines.items()]
    return found


def _wires(diagram: Diagram) -> Iterable[Wire]:
    yield from diagram.wires
    for node in diagram.nodes.values():
        if node.inside is not None:
            yield from _wires(node.inside)
