"""Shapes of a drawing, in pixels from the top left, and the sizes of texts and blocks."""

from __future__ import annotations

from dataclasses import dataclass, field

from .diagram import INTO, OUT, Diagram, Node, Wire

ROW = 18.0
"""From one port to the next."""
HEAD = 42.0
"""Height of a block's title and of what it uses."""
FOOT = 9.0
PAD = 7.0
TITLE, USE, PORT = 15.0, 11.0, 13.0
"""Sizes of texts."""
NOTE = 10.0
_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_NARROW = frozenset("fijlrtI.,:;|!'()[] /-")
_WIDE = frozenset("mwMWABCDGHNOQRUVXYZ%@_")


def width_of(text: str, size: float) -> float:
    """About how wide a text is; fonts differ a little."""
    units = sum(0.36 if c in _NARROW else 0.74 if c in _WIDE else 0.585 for c in text)
    return units * size


@dataclass
class Box:
    """A node in its place; ``inside`` is the drawing of an open box, relative to (x, y)."""

    node: Node
    width: float
    height: float
    x: float = 0.0
    y: float = 0.0
    inside: Drawing | None = None

    def port(self, name: str, outputs: bool) -> float:
        """The height of a port above the page's lower edge, that is, its y relative to the box."""
        ports = self.node.outputs if outputs else self.node.inputs
        if self.inside is not None:
            border = self.inside.boxes[INTO if outputs is False else OUT]
            return border.y + border.port(name, not outputs)
        first = HEAD if self.node.path not in (INTO, OUT) else 6.0
        return first + ROW * (ports.index(name) + 0.5)


@dataclass(frozen=True)
class Line:
    """A wire, or a part that several wires share, as a path of right angles."""

    points: tuple[tuple[float, float], ...]
    wire: Wire
    ends: bool = True
    """Whether it ends at a block's input, with an arrow head."""


@dataclass
class Drawing:
    """Boxes by path, lines, and the points where lines branch."""

    diagram: Diagram
    boxes: dict[str, Box]
    lines: list[Line] = field(default_factory=list)
    dots: list[tuple[float, float, Wire]] = field(default_factory=list)
    width: float = 0.0
    height: float = 0.0


def note_of(wire: Wire) -> str:
    """What stands on a wire that is not a plain one: delay, change of rate, what is selected."""
    notes = [f"z⁻{str(wire.delay).translate(_RAISED)}"] if wire.delay else []
    notes += [wire.transition] if wire.transition else []
    port = wire.source[1].rpartition(".")[2]
    selected = wire.said.partition(f".{port}")[2]
    if selected and not wire.said.startswith(("[", "{")):
        notes.append(selected)
    return " ".join(notes)


def size_of(node: Node) -> tuple[float, float]:
    """Width and height of a block or a closed box."""
    rows = max(len(node.inputs), len(node.outputs))
    if node.path in (INTO, OUT):
        return 0.0, 12.0 + ROW * rows
    left = max((width_of(node.labels.get(p, p), PORT) for p in node.inputs), default=0.0)
    right = max((width_of(node.labels.get(p, p), PORT) for p in node.outputs), default=0.0)
    head = max(width_of(node.title, TITLE) * 1.08, width_of(node.use, USE))
    both = left + right + (18.0 if left and right else 0.0)
    return round(max(head, both, 74.0) + 2 * PAD), HEAD + ROW * rows + FOOT
