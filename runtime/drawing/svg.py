"""Writes a drawing as SVG that is light or dark as its reader's screen is."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

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
    port_of,
    style_of,
)

LEGEND = 34.0
FONT = "'DejaVu Sans', Verdana, Arial, sans-serif"


def svg(drawing: Drawing, title: str = "") -> str:
    """The drawing as the text of an SVG file of its own."""
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
    for line in drawing.lines:
        note = note_of(line.wire)
        if note and line.ends:
            x, y = line.points[-1]
            yield (
                f'<text class="soft note" x="{x - 9:g}" y="{y - 4:g}" font-size="{NOTE}" '
                f'text-anchor="end">{escape(note)}</text>'
            )


def _classes(wire: Wire, style: Style) -> str:
    classes = [f"w{style.wire(wire)}"]
    classes += ["delay"] if wire.delay else []
    classes += ["rates"] if wire.transition else []
    classes += ["truth"] if wire.truth else []
    return " ".join(classes)


def _path(points: tuple[tuple[float, float], ...], wire: Wire, style: Style) -> str:
    text = "M" + " L".join(f"{x:g} {y:g}" for x, y in points)
    source = escape(port_of(wire.source))
    return f'<path class="wire {_classes(wire, style)}" data-source="{source}" d="{text}"/>'


def _head(x: float, y: float, wire: Wire, style: Style) -> str:
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
    """Samples with their texts below the drawing, each with the x at which it ends."""
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
