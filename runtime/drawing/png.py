"""Draws the same picture with matplotlib, as a PNG file."""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

from .diagram import INTO, OUT, Wire
from .geometry import HEAD, NOTE, PAD, PORT, TITLE, USE, Box, Drawing, note_of, width_of
from .style import (
    DARK,
    LIGHT,
    RATES_DARK,
    RATES_LIGHT,
    WIRES_DARK,
    WIRES_LIGHT,
    Style,
    legend,
    style_of,
)
from .svg import LEGEND

_POINTS = 72.0


def save_png(
    drawing: Drawing, path: Path | IO[bytes], *, dark: bool = False, scale: float = 2.0
) -> None:
    """Write the picture, with ``scale`` dots for every pixel of the SVG file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style = style_of(drawing.diagram)
    width, height = drawing.width + 4, drawing.height + LEGEND
    figure = Figure(figsize=(width / _POINTS, height / _POINTS), dpi=_POINTS * scale)
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
        dpi=_POINTS * scale,
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

    def colour(self, wire: Wire) -> str:
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
        for line in drawing.lines:
            if line.ends and note_of(line.wire):
                a, b = line.points[-1]
                self.text(x + a - 9, y + b - 4, note_of(line.wire), NOTE, "soft", "right")

    def line(self, xs: list[float], ys: list[float], wire: Wire) -> None:
        dashes: Any = (0, (5, 3)) if wire.delay else (0, (1.5, 2)) if wire.truth else "-"
        width = 2.6 if wire.transition else 1.3
        self.axes.plot(
            xs, ys, color=self.colour(wire), lw=width, ls=dashes, solid_capstyle="round", zorder=2
        )

    def head(self, x: float, y: float, wire: Wire) -> None:
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
                sample = Wire(
                    ("", ""), ("", ""), kind == "delay", kind == "truth", "x" * (kind == "rates")
                )
                self.line([x, x + 26], [y - 3, y - 3], sample)
            self.text(x + 32, y + 1, text, PORT, "soft")
            x += 34 + width_of(text, PORT) + 22
