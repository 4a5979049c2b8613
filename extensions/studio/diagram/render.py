"""Draws a laid out diagram as SVG, light or dark as its reader's screen is, and as PNG with matplotlib."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import IO, Any

from .diagram import INTO, OUT, Diagram, DiagramNode, DiagramWire
from .layout import HEAD, NOTE, PAD, PORT, TITLE, USE, Box, Drawing, notes_of, width_of

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
    """Colours of each source, each rate and each machine in one drawing."""

    sources: dict[str, int]
    rates: dict[float, int]
    machines: dict[str, int]

    def wire(self, wire: DiagramWire) -> int:
        """Return the number of a wire's colour."""
        return self.sources.get(owner(wire.source), 0) % len(WIRES_LIGHT)

    def block(self, node: DiagramNode) -> int:
        """Return the number of a block's colour."""
        return self.rates.get(node.rate_hz, 0) % len(RATES_LIGHT)


def owner(end: tuple[str, str]) -> str:
    """Return the block that writes; a border's port is named by it."""
    return port_of(end).rpartition(".")[0]


def port_of(end: tuple[str, str]) -> str:
    """Return the output ``block.port`` at an end of a wire that carries it."""
    return end[1] if "." in end[1] else f"{end[0]}.{end[1]}"


def style_of(diagram: Diagram) -> Style:
    """Choose the colours of a diagram, and of the content of its boxes."""
    nodes = [node for node in _nodes(diagram) if node.title and not node.is_box]
    rates = sorted(dict.fromkeys(node.rate_hz for node in nodes), reverse=True)
    machines = dict.fromkeys(node.machine for node in nodes if node.machine)
    return Style(
        {node.path: number for number, node in enumerate(nodes)},
        {rate: number for number, rate in enumerate(rates)},
        {name: number for number, name in enumerate(machines)},
    )


def _nodes(diagram: Diagram) -> Iterable[DiagramNode]:
    for node in diagram.nodes.values():
        yield node
        if node.inside is not None:
            yield from _nodes(node.inside)


def hertz(rate: float) -> str:
    """``500 Hz``."""
    return f"{rate:g} Hz"


def legend(diagram: Diagram, style: Style) -> list[tuple[str, str]]:
    """Return the legend's entries as (kind, text), where the kind chooses the sample."""
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


def _wires(diagram: Diagram) -> Iterable[DiagramWire]:
    yield from diagram.wires
    for node in diagram.nodes.values():
        if node.inside is not None:
            yield from _wires(node.inside)


LEGEND = 34.0
FONT = "'DejaVu Sans', Verdana, Arial, sans-serif"


def svg(drawing: Drawing, title: str = "") -> str:
    """Render the drawing as the text of an SVG file of its own."""
    style = style_of(drawing.diagram)
    samples = list(_legend(drawing, style))
    width = max(drawing.width, samples[-1][1] if samples else 0.0) + 4
    height = drawing.height + LEGEND
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" font-family="{FONT}" role="img" '
            f'aria-label="{escape(title)}">'
        ),
        f"<style>{_css()}</style>",
        f'<rect class="page" width="{width:.0f}" height="{height:.0f}"/>',
        *_content(drawing, style),
        *(text for text, _ in samples),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _css() -> str:
    rules = [
        ".page{fill:var(--page)} text{fill:var(--text)} .soft{fill:var(--soft)}",
        ".title{font-weight:bold} .note{paint-order:stroke;stroke:var(--page);stroke-width:3px}",
        ".block{stroke:var(--edge);stroke-width:1.2} .frame{fill:var(--box);stroke:var(--boxedge)}",
        ".bar{stroke:var(--edge);stroke-width:1.2} .port{fill:var(--edge)}",
        ".wire{fill:none;stroke-width:1.3} .delay{stroke-dasharray:7 4} .rates{stroke-width:2.8}",
        ".truth{stroke:var(--truth)!important;stroke-dasharray:2 3} .head{stroke:none}",
        ".truth.head,.truth.dot{fill:var(--truth)!important}",
    ]
    for number in range(len(WIRES_LIGHT)):
        rules.append(
            f".w{number}{{stroke:var(--w{number})}} .head.w{number},.dot.w{number}"
            f"{{fill:var(--w{number});stroke:none}}"
        )
    rules += [f".r{number}{{fill:var(--r{number})}}" for number in range(len(RATES_LIGHT))]
    light, dark = _colours(LIGHT, WIRES_LIGHT, RATES_LIGHT), _colours(DARK, WIRES_DARK, RATES_DARK)
    return (
        f"svg{{{light}}} @media (prefers-color-scheme:dark){{svg{{{dark}}}}} "
        f"@media print{{svg{{{light}}}}} " + " ".join(rules)
    )


def _colours(named: dict[str, str], wires: tuple[str, ...], rates: tuple[str, ...]) -> str:
    values = [f"--{name}:{colour}" for name, colour in named.items()]
    values += [f"--w{number}:{colour}" for number, colour in enumerate(wires)]
    values += [f"--r{number}:{colour}" for number, colour in enumerate(rates)]
    return ";".join(values)


def _content(drawing: Drawing, style: Style) -> Iterator[str]:
    """Frames first, then wires, then blocks, so that no line covers a block."""
    for box in drawing.boxes.values():
        if box.inside is not None:
            yield from _frame(box, style)
    for line in drawing.lines:
        yield _path(line.points, line.wire, style)
        if line.ends:
            yield _head(*line.points[-1], line.wire, style)
    for x, y, wire in drawing.dots:
        yield f'<circle class="dot {_classes(wire, style)}" cx="{x:g}" cy="{y:g}" r="2.6"/>'
    for box in drawing.boxes.values():
        if box.inside is None and box.node.path not in (INTO, OUT):
            yield from _block(box, style)
    for (x, y), note in notes_of(drawing).items():
        yield (
            f'<text class="soft note" x="{x - 9:g}" y="{y - 4:g}" font-size="{NOTE}" '
            f'text-anchor="end">{escape(note)}</text>'
        )


def _classes(wire: DiagramWire, style: Style) -> str:
    classes = [f"w{style.wire(wire)}"]
    classes += ["delay"] if wire.delay else []
    classes += ["rates"] if wire.transition else []
    classes += ["truth"] if wire.truth else []
    return " ".join(classes)


def _path(points: tuple[tuple[float, float], ...], wire: DiagramWire, style: Style) -> str:
    text = "M" + " L".join(f"{x:g} {y:g}" for x, y in points)
    source = escape(port_of(wire.source))
    return f'<path class="wire {_classes(wire, style)}" data-source="{source}" d="{text}"/>'


def _head(x: float, y: float, wire: DiagramWire, style: Style) -> str:
    points = f"{x:g},{y:g} {x - 7:g},{y - 3.4:g} {x - 7:g},{y + 3.4:g}"
    return f'<polygon class="head {_classes(wire, style)}" points="{points}"/>'


def _text(x: float, y: float, text: str, size: float, kind: str = "", anchor: str = "") -> str:
    classes = f' class="{kind}"' if kind else ""
    side = f' text-anchor="{anchor}"' if anchor else ""
    return f'<text{classes} x="{x:g}" y="{y:g}" font-size="{size:g}"{side}>{escape(text)}</text>'


def _block(box: Box, style: Style) -> Iterator[str]:
    node = box.node
    x, y, w, h = box.x, box.y, box.width, box.height
    yield f'<g class="node" data-path="{escape(node.path)}" tabindex="0">'
    if node.is_box:
        yield (
            f'<rect class="frame" x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="3" '
            'stroke-width="2"/>'
        )
    else:
        radius = 12 if node.moore else 3
        yield (
            f'<rect class="block r{style.block(node)}" x="{x:g}" y="{y:g}" width="{w:g}" '
            f'height="{h:g}" rx="{radius}"/>'
        )
        if node.moore:
            yield (
                f'<path class="bar" d="M{x + 8:g} {y + HEAD - 5:g} H{x + w - 8:g}" '
                'stroke-width="2.2"/>'
            )
    middle = x + 0.5 * w
    yield _text(middle, y + 18, node.title, TITLE, "title", "middle")
    yield _text(middle, y + 32, node.use.removeprefix("blocks."), USE, "soft", "middle")
    if node.machine:
        yield _text(middle, y - 4, f"on {node.machine}", 9.5, "soft", "middle")
    for name in node.inputs:
        height = y + box.port(name, False)
        yield _text(x + PAD, height + 4.5, node.labels.get(name, name), PORT)
    for name in node.outputs:
        height = y + box.port(name, True)
        yield (
            f'<rect class="port" data-port="{escape(port_of((node.path, name)))}" '
            f'x="{x + w - 1.5:g}" y="{height - 2.5:g}" width="4" height="5"/>'
        )
        yield _text(x + w - PAD, height + 4.5, node.labels.get(name, name), PORT, anchor="end")
    yield "</g>"


def _frame(box: Box, style: Style) -> Iterator[str]:
    assert box.inside is not None
    yield (
        f'<g class="node" data-path="{escape(box.node.path)}" tabindex="0"><rect class="frame" '
        f'x="{box.x:g}" y="{box.y:g}" width="{box.width:g}" height="{box.height:g}" rx="6"/>'
    )
    yield _text(box.x + PAD, box.y + 18, box.node.title, TITLE, "title")
    beside = box.x + PAD + width_of(box.node.title, TITLE) * 1.1 + 8
    yield _text(beside, box.y + 18, box.node.use, USE, "soft") + "</g>"
    yield f'<g transform="translate({box.x:g} {box.y:g})">'
    yield from _content(box.inside, style)
    yield "</g>"


def _legend(drawing: Drawing, style: Style) -> Iterator[tuple[str, float]]:
    """Yield samples with their texts below the drawing, each with the x at which it ends."""
    x, y = 16.0, drawing.height + 14
    for kind, text in legend(drawing.diagram, style):
        if kind.startswith("rate") and kind != "rates":
            number = int(kind[4:]) % len(RATES_LIGHT)
            sample = (
                f'<rect class="block r{number}" x="{x:g}" y="{y - 9:g}" width="22" height="13"/>'
            )
        elif kind == "moore":
            sample = (
                f'<rect class="block" fill="none" x="{x:g}" y="{y - 9:g}" width="22" height="13" '
                f'rx="6"/><path class="bar" d="M{x + 4:g} {y - 3:g} H{x + 18:g}"/>'
            )
        elif kind.startswith("machine"):
            sample = ""
        else:
            sample = (
                f'<path class="wire w{len(WIRES_LIGHT) - 1} {kind}" '
                f'd="M{x:g} {y - 3:g} H{x + 26:g}"/>'
            )
        end = x + 34 + width_of(text, PORT) + 22
        yield sample + _text(x + 32, y + 1, text, PORT, "soft"), end
        x = end


_POINTS, _SCALE = 72.0, 2.0


def save_png(drawing: Drawing, path: Path | IO[bytes], *, dark: bool = False) -> None:
    """Write the picture, with ``_SCALE`` dots for every pixel of the SVG file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style = style_of(drawing.diagram)
    width, height = drawing.width + 4, drawing.height + LEGEND
    figure = Figure(figsize=(width / _POINTS, height / _POINTS), dpi=_POINTS * _SCALE)
    FigureCanvasAgg(figure)
    colours = DARK if dark else LIGHT
    figure.patch.set_facecolor(colours["page"])
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0, width)
    axes.set_ylim(height, 0)
    axes.axis("off")
    painter = _Painter(axes, style, dark)
    painter.content(drawing, 0.0, 0.0)
    painter.legend(drawing)
    figure.savefig(
        path,
        format="png",
        dpi=_POINTS * _SCALE,
        facecolor=colours["page"],
        metadata={"Software": ""},
    )


class _Painter:
    def __init__(self, axes: Any, style: Style, dark: bool) -> None:
        self.axes = axes
        self.style = style
        self.colours = DARK if dark else LIGHT
        self.wires = WIRES_DARK if dark else WIRES_LIGHT
        self.rates = RATES_DARK if dark else RATES_LIGHT

    def colour(self, wire: DiagramWire) -> str:
        return self.colours["truth"] if wire.truth else self.wires[self.style.wire(wire)]

    def content(self, drawing: Drawing, x: float, y: float) -> None:
        for box in drawing.boxes.values():
            if box.inside is not None:
                self.frame(box, x, y)
        for line in drawing.lines:
            xs = [x + a for a, _ in line.points]
            ys = [y + b for _, b in line.points]
            self.line(xs, ys, line.wire)
            if line.ends:
                self.head(xs[-1], ys[-1], line.wire)
        for a, b, wire in drawing.dots:
            self.axes.plot([x + a], [y + b], "o", ms=4.6, color=self.colour(wire), mew=0)
        for box in drawing.boxes.values():
            if box.inside is None and box.node.path not in (INTO, OUT):
                self.block(box, x, y)
        for (a, b), note in notes_of(drawing).items():
            self.text(x + a - 9, y + b - 4, note, NOTE, "soft", "right")

    def line(self, xs: list[float], ys: list[float], wire: DiagramWire) -> None:
        dashes: Any = (0, (5, 3)) if wire.delay else (0, (1.5, 2)) if wire.truth else "-"
        width = 2.6 if wire.transition else 1.3
        self.axes.plot(
            xs, ys, color=self.colour(wire), lw=width, ls=dashes, solid_capstyle="round", zorder=2
        )

    def head(self, x: float, y: float, wire: DiagramWire) -> None:
        self.axes.fill([x, x - 7, x - 7], [y, y - 3.4, y + 3.4], color=self.colour(wire), lw=0)

    def text(
        self, x: float, y: float, text: str, size: float, colour: str = "text", side: str = "left",
        bold: bool = False,
    ) -> None:  # fmt: skip
        self.axes.text(
            x, y, text, fontsize=size, color=self.colours[colour], ha=side, va="baseline",
            fontweight="bold" if bold else "normal", zorder=5, parse_math=False,
        )  # fmt: skip

    def rectangle(
        self, x: float, y: float, w: float, h: float, fill: str, edge: str, r: float
    ) -> None:
        from matplotlib.patches import FancyBboxPatch

        shape = f"round,pad=0,rounding_size={r}"
        self.axes.add_patch(
            FancyBboxPatch((x, y), w, h, boxstyle=shape, fc=fill, ec=edge, lw=1.2, zorder=3)
        )

    def block(self, box: Box, dx: float, dy: float) -> None:
        node, x, y = box.node, box.x + dx, box.y + dy
        fill = self.colours["box"] if node.is_box else self.rates[self.style.block(node)]
        self.rectangle(
            x, y, box.width, box.height, fill, self.colours["edge"], 12 if node.moore else 3
        )
        if node.moore:
            bar = [x + 8, x + box.width - 8], [y + HEAD - 5] * 2
            self.axes.plot(*bar, color=self.colours["edge"], lw=2.0, zorder=4)
        middle = x + 0.5 * box.width
        self.text(middle, y + 18, node.title, TITLE, side="center", bold=True)
        self.text(middle, y + 32, node.use.removeprefix("blocks."), USE, "soft", "center")
        if node.machine:
            self.text(middle, y - 4, f"on {node.machine}", 9.5, "soft", "center")
        for name in node.inputs:
            self.text(x + PAD, y + box.port(name, False) + 4.5, node.labels.get(name, name), PORT)
        for name in node.outputs:
            height = y + box.port(name, True)
            label = node.labels.get(name, name)
            self.text(x + box.width - PAD, height + 4.5, label, PORT, side="right")
            self.rectangle(
                x + box.width - 1.5,
                height - 2.5,
                4,
                5,
                self.colours["edge"],
                self.colours["edge"],
                0.1,
            )

    def frame(self, box: Box, dx: float, dy: float) -> None:
        x, y = box.x + dx, box.y + dy
        self.rectangle(x, y, box.width, box.height, self.colours["box"], self.colours["boxedge"], 6)
        self.axes.patches[-1].set_zorder(1)
        self.text(x + PAD, y + 18, box.node.title, TITLE, bold=True)
        beside = x + PAD + width_of(box.node.title, TITLE) * 1.1 + 8
        self.text(beside, y + 18, box.node.use, USE, "soft")
        assert box.inside is not None
        self.content(box.inside, x, y)

    def legend(self, drawing: Drawing) -> None:
        x, y = 16.0, drawing.height + 14
        for kind, text in legend(drawing.diagram, self.style):
            edge = self.colours["edge"]
            if kind.startswith("rate") and kind != "rates":
                fill = self.rates[int(kind[4:]) % len(self.rates)]
                self.rectangle(x, y - 9, 22, 13, fill, edge, 2)
            elif kind == "moore":
                self.rectangle(x, y - 9, 22, 13, self.colours["page"], edge, 6)
                self.axes.plot([x + 4, x + 18], [y - 3] * 2, color=edge, lw=2.0, zorder=4)
            elif not kind.startswith("machine"):
                sample = DiagramWire(
                    ("", ""), ("", ""), kind == "delay", kind == "truth", "x" * (kind == "rates")
                )
                self.line([x, x + 26], [y - 3, y - 3], sample)
            self.text(x + 32, y + 1, text, PORT, "soft")
            x += 34 + width_of(text, PORT) + 22
