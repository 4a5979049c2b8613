"""Gives every node and wire of a diagram its place, in pixels from the top left.

Nodes stand in the columns of ``layers``, wires as straight as can be. Wires have right angles: they pass through
the gaps between columns, and lead back below all blocks.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from .diagram import INTO, OUT, Diagram, DiagramNode, DiagramWire
from .layers import FEW, Layers, Slot, WirePassage, arrange
from .tracks import LANE, STRAIGHT, TRACK, Hop, Net, assign_tracks

ROW = 18.0
"""Distance from one port to the next."""
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
    """Estimate the width of a text; fonts differ a little."""
    units = sum(0.36 if c in _NARROW else 0.74 if c in _WIDE else 0.585 for c in text)
    return units * size


@dataclass
class Box:
    """A node in its place; ``inside`` is the drawing of an open box, relative to (x, y)."""

    node: DiagramNode
    width: float
    height: float
    x: float = 0.0
    y: float = 0.0
    inside: Drawing | None = None

    def port(self, name: str, outputs: bool) -> float:
        """Return the height of a port above the page's lower edge, that is, its y relative to the
        box."""
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
    wire: DiagramWire
    ends: bool = True
    """True if it ends at a block's input, with an arrow head."""


@dataclass
class Drawing:
    """Boxes by path, lines, and the points where lines branch."""

    diagram: Diagram
    boxes: dict[str, Box]
    lines: list[Line] = field(default_factory=list)
    dots: list[tuple[float, float, DiagramWire]] = field(default_factory=list)
    width: float = 0.0
    height: float = 0.0


def note_of(wire: DiagramWire) -> str:
    """Return the label of a wire that is not a plain one: delay, change of rate, selection."""
    notes = [f"z⁻{str(wire.delay).translate(_RAISED)}"] if wire.delay else []
    notes += [wire.transition] if wire.transition else []
    port = wire.source[1].rpartition(".")[2]
    selected = wire.wire_text.partition(f".{port}")[2]
    if selected and not wire.wire_text.startswith(("[", "{")):
        notes.append(selected)
    return " ".join(notes)


def note_at(wires: Iterable[DiagramWire]) -> str:
    """Return the label of an input that these wires lead to: what each of them says, once."""
    return ", ".join(dict.fromkeys(filter(None, map(note_of, wires))))


def notes_of(drawing: Drawing) -> dict[tuple[float, float], str]:
    """Return the labels of a drawing by the points where their wires end."""
    ends: dict[tuple[float, float], list[DiagramWire]] = {}
    for line in drawing.lines:
        if line.ends:
            ends.setdefault(line.points[-1], []).append(line.wire)
    return {point: note for point, wires in ends.items() if (note := note_at(wires))}


def size_of(node: DiagramNode) -> tuple[float, float]:
    """Width and height of a block or a closed box."""
    rows = max(len(node.inputs), len(node.outputs))
    if node.path in (INTO, OUT):
        return 0.0, 12.0 + ROW * rows
    left = max((width_of(node.labels.get(p, p), PORT) for p in node.inputs), default=0.0)
    right = max((width_of(node.labels.get(p, p), PORT) for p in node.outputs), default=0.0)
    head = max(width_of(node.title, TITLE) * 1.08, width_of(node.use, USE))
    both = left + right + (18.0 if left and right else 0.0)
    return round(max(head, both, 74.0) + 2 * PAD), HEAD + ROW * rows + FOOT


class Router:
    """The wires of one diagram. ``columns`` are the left and right edges of its columns."""

    def __init__(
        self, layers: Layers, boxes: dict[str, Box], passages: dict[WirePassage, float]
    ) -> None:
        self.layers = layers
        self.boxes = boxes
        self.passages = passages
        self.columns: list[tuple[float, float]] = []
        self.wires: dict[Net, DiagramWire] = {}
        low = [box.y + box.height for box in boxes.values()] + list(passages.values())
        self.floor = max(low, default=0.0) + 20.0
        self.gaps: list[dict[tuple[Net, str], Hop]] = [{} for _ in range(len(layers.columns) + 1)]
        self.lanes: list[tuple[int, int, Net, list[DiagramWire]]] = []
        for wire in [*layers.forward, *layers.back]:
            self.wires.setdefault(wire.source, wire)
        self._forward()
        self._back()
        for gap in self.gaps:
            assign_tracks(list(gap.values()), self.floor)

    def _out(self, net: Net) -> float:
        box = self.boxes[net[0]]
        return box.y + box.port(net[1], True)

    def _into(self, wire: DiagramWire) -> float:
        box = self.boxes[wire.target[0]]
        return box.y + box.port(wire.target[1], False)

    def _hop(self, gap: int, net: Net, starts: float) -> Hop:
        return self.gaps[gap].setdefault((net, ""), Hop(net, self.wires[net], starts))

    def _forward(self) -> None:
        for passage, height in self.passages.items():
            before = WirePassage(passage.net, passage.layer - 1)
            starts = self.passages.get(before, self._out(passage.net))
            self._hop(passage.layer, passage.net, starts).ends.append((height, None))
        for wire in self.layers.forward:
            number = self.layers.layer[wire.target[0]]
            before = WirePassage(wire.source, number - 1)
            starts = self.passages.get(before, self._out(wire.source))
            self._hop(number, wire.source, starts).ends.append((self._into(wire), wire))

    def _back(self) -> None:
        """Lanes for the nets that lead back, the shortest uppermost."""
        nets: dict[tuple[Net, int], list[DiagramWire]] = {}
        for wire in self.layers.back:
            nets.setdefault((wire.source, self.layers.layer[wire.target[0]]), []).append(wire)
        in_order = sorted(
            nets, key=lambda key: (self.layers.layer[key[0][0]] - key[1], key[1], key[0])
        )
        for lane, (net, target) in enumerate(in_order):
            source = self.layers.layer[net[0]]
            wires = nets[net, target]
            hop = self._hop(source + 1, net, self._out(net))
            if hop.goes_to is None:
                hop.goes_to = lane
            else:
                hop.goes_to = max(hop.goes_to, lane)
            arrival = Hop(net, wires[0], None, comes_from=lane)
            arrival.ends = [(self._into(wire), wire) for wire in wires]
            self.gaps[target][net, f"back{lane}"] = arrival
            self.lanes.append((source + 1, target, net, wires))

    def _x(self, gap: int, track: int) -> float:
        """Return the x of a vertical line."""
        left = self.columns[gap - 1][1] if gap else 0.0
        return left + 14.0 + TRACK * track

    def route(self, drawing: Drawing) -> None:
        """Add all lines."""
        for number, gap in enumerate(self.gaps):
            for hop in gap.values():
                self._draw(number, hop, drawing)
        for lane, (begin, target, net, wires) in enumerate(self.lanes):
            y = self.floor + LANE * lane
            start = self._x(begin, self.gaps[begin][net, ""].track)
            end = self._x(target, self.gaps[target][net, f"back{lane}"].track)
            drawing.lines.append(Line(((start, y), (end, y)), wires[0], ends=False))
            if self.gaps[begin][net, ""].goes_to != lane:
                drawing.dots.append((start, y, wires[0]))

    def _draw(self, number: int, hop: Hop, drawing: Drawing) -> None:
        """Draw the lines of a net in a gap."""
        left = self.columns[number - 1] if number else (0.0, 0.0)
        x = self._x(number, hop.track)
        first, last = hop.span(self.floor)
        if hop.starts is not None:
            begin = self._edge(hop.net, number - 1, left)
            far = self._end(number, hop, hop.ends[0][1]) if hop.is_straight() else x
            if not hop.is_straight():
                drawing.lines.append(
                    Line(((begin, hop.starts), (far, hop.starts)), hop.wire, ends=False)
                )
            else:
                for _, wire in hop.ends:
                    far = self._end(number, hop, wire)
                    points = ((begin, hop.starts), (far, hop.starts))
                    drawing.lines.append(Line(points, wire or hop.wire, ends=self.ends(wire)))
                return
        drawing.lines.append(Line(((x, first), (x, last)), hop.wire, ends=False))
        for y, wire in hop.ends:
            far = self._end(number, hop, wire)
            shown = wire or hop.wire
            drawing.lines.append(Line(((x, y), (far, y)), shown, ends=self.ends(wire)))
        heights = [y for y, _ in hop.ends]
        heights += [] if hop.starts is None else [hop.starts]
        for y in dict.fromkeys(heights):
            if (
                first + STRAIGHT < y < last - STRAIGHT
                or sum(abs(y - other) < 1.0 for other in heights) > 1
            ):
                drawing.dots.append((x, y, hop.wire))

    def ends(self, wire: DiagramWire | None) -> bool:
        """Return whether a branch ends at a block, and not at a border behind which it goes on."""
        if wire is None:
            return False
        box = self.boxes[wire.target[0]]
        return wire.target[0] != OUT and box.inside is None

    def _edge(self, net: Net, column: int, edges: tuple[float, float]) -> float:
        """Return the x where a net leaves a column: at its block, or at the column's left edge if
        it passes."""
        box = self.boxes[net[0]]
        if self.layers.layer[net[0]] == column:
            return box.x + box.width
        return edges[0] - 2.0

    def _end(self, number: int, hop: Hop, wire: DiagramWire | None) -> float:
        """Return the x where a branch ends: at a block, or at the edge of the column that it
        passes."""
        if wire is None:
            return self.columns[number][0] - 2.0
        return self.boxes[wire.target[0]].x


def column_gaps(router: Router) -> list[float]:
    """Return the width of every gap: before the first column, between columns, and behind the
    last."""
    widths = []
    for number, gap in enumerate(router.gaps):
        count = 1 + max((hop.track for hop in gap.values() if not hop.is_straight()), default=-1)
        outside = number in (0, len(router.gaps) - 1)
        least = 16.0 if outside and not gap else 30.0
        ends = [w for hop in gap.values() for _, w in hop.ends if w is not None and router.ends(w)]
        inputs: dict[tuple[str, str], list[DiagramWire]] = {}
        for wire in ends:
            inputs.setdefault(wire.target, []).append(wire)
        notes = max((width_of(note_at(each), NOTE) for each in inputs.values()), default=0.0)
        widths.append(max(least, 28.0 + TRACK * count + notes))
    return widths


_GAP = 22.0
"""Between two nodes of a column."""
_PASS_GAP = 9.0
"""Between passages of wires."""
_MARGIN = 14.0
_STEP = 24.0
"""Smaller steps in a line that passes a column are taken out."""
_FAR = 1e9
_ITERATIONS = 120
_ITERATIONS_OF_MANY = 12


def draw(diagram: Diagram) -> Drawing:
    """Draw a diagram, with the drawings of open boxes inside."""
    boxes: dict[str, Box] = {}
    for path, node in diagram.nodes.items():
        if node.inside is None:
            boxes[path] = Box(node, *size_of(node))
            continue
        inside = draw(node.inside)
        width = max(inside.width, size_of(node)[0])
        boxes[path] = Box(node, width, inside.height + HEAD, inside=inside)
        _shift(inside, 0.0, HEAD)
    layers = arrange(diagram)
    heights = _heights(layers, boxes)
    drawing = Drawing(diagram, boxes)
    for path, box in boxes.items():
        box.y = heights[path]
    router = Router(layers, boxes, {p: h for p, h in heights.items() if isinstance(p, WirePassage)})
    gaps = column_gaps(router)
    x = gaps[0]
    for number, column in enumerate(layers.columns):
        width = max((boxes[p].width for p in column if isinstance(p, str)), default=0.0)
        router.columns.append((x, x + width))
        for place in column:
            if isinstance(place, str):
                boxes[place].x = x + 0.5 * (width - boxes[place].width)
        x += width + gaps[number + 1]
    drawing.width = x
    for border, edge in ((INTO, 0.0), (OUT, x)):
        if border in boxes:
            boxes[border].x = edge
    router.route(drawing)
    _fit(drawing)
    return drawing


def _heights(layers: Layers, boxes: dict[str, Box]) -> dict[Slot, float]:
    """Return the y of the upper edge of every node, and of every passage."""
    y: dict[Slot, float] = {}
    for column in layers.columns:
        top = 0.0
        for place in column:
            y[place] = top
            top += _height(place, boxes) + (_PASS_GAP if isinstance(place, WirePassage) else _GAP)
    links: dict[Slot, list[tuple[Slot, float, float, float]]] = {}
    for (a, b), ends in layers.links.items():
        for out, into in ends:
            weight = (1.0, 4.0, 16.0)[isinstance(a, WirePassage) + isinstance(b, WirePassage)]
            from_a = boxes[a].port(out, True) if isinstance(a, str) else 0.0
            from_b = boxes[b].port(into, False) if isinstance(b, str) else 0.0
            links.setdefault(a, []).append((b, from_a, from_b, weight))
            links.setdefault(b, []).append((a, from_b, from_a, weight))
    for sweep in range(_ITERATIONS if len(y) <= FEW else _ITERATIONS_OF_MANY):
        columns = layers.columns if sweep % 2 == 0 else layers.columns[::-1]
        for column in columns:
            wishes = []
            for place in column:
                found = links.get(place, ())
                total = sum(weight for *_, weight in found)
                wish = sum((y[o] + there - here) * w for o, here, there, w in found)
                wishes.append((wish / total if total else y[place], max(total, 0.1)))
            _settle(column, wishes, y, boxes)
    _straighten(layers, y, boxes)
    least = min(y.values(), default=0.0)
    return {place: round(value - least + _MARGIN) for place, value in y.items()}


def _straighten(layers: Layers, y: dict[Slot, float], boxes: dict[str, Box]) -> None:
    """Take small steps out of the lines that pass columns, where there is room."""
    before = {
        b: (a, ends[0][0]) for (a, b), ends in layers.links.items() if isinstance(b, WirePassage)
    }
    for column in layers.columns:
        for number, place in enumerate(column):
            if not isinstance(place, WirePassage):
                continue
            source, port = before[place]
            wish = y[source] + (boxes[source].port(port, True) if isinstance(source, str) else 0.0)
            low, high = -_FAR, _FAR
            if number:
                above = column[number - 1]
                low = y[above] + _height(above, boxes) + _PASS_GAP
            if number + 1 < len(column):
                high = y[column[number + 1]] - _PASS_GAP
            if abs(wish - y[place]) < _STEP and low <= wish <= high:
                y[place] = wish


def _height(place: Slot, boxes: dict[str, Box]) -> float:
    return boxes[place].height if isinstance(place, str) else 0.0


def _settle(
    column: list[Slot],
    wishes: list[tuple[float, float]],
    y: dict[Slot, float],
    boxes: dict[str, Box],
) -> None:
    """Move the places of a column as near to their wishes as their order and distances allow.

    This is isotonic regression: neighbours that would overlap move together to their mean wish.
    """
    starts, top = [], 0.0
    for number, place in enumerate(column):
        if number:
            before = column[number - 1]
            both = isinstance(before, WirePassage) and isinstance(place, WirePassage)
            top += _height(before, boxes) + (_PASS_GAP if both else _GAP)
        starts.append(top)
    blocks: list[list[float]] = []  # of places that move together: sum, weight, count
    for (wish, weight), start in zip(wishes, starts, strict=True):
        blocks.append([(wish - start) * weight, weight, 1])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] > blocks[-1][0] / blocks[-1][1]:
            last = blocks.pop()
            blocks[-1] = [a + b for a, b in zip(blocks[-1], last, strict=True)]
    number = 0
    for total, weight, count in blocks:
        for _ in range(int(count)):
            y[column[number]] = total / weight + starts[number]
            number += 1


def _fit(drawing: Drawing) -> None:
    """Make the drawing as high as what is in it."""
    low = [box.y + box.height for box in drawing.boxes.values()]
    low += [y for line in drawing.lines for _, y in line.points]
    drawing.height = max(low, default=0.0) + _MARGIN


def _shift(drawing: Drawing, dx: float, dy: float) -> None:
    """Move all that is drawn, but not what is inside of boxes, which is relative to them."""
    for box in drawing.boxes.values():
        box.x += dx
        box.y += dy
    drawing.lines = [
        type(line)(tuple((x + dx, y + dy) for x, y in line.points), line.wire, line.ends)
        for line in drawing.lines
    ]
    drawing.dots = [(x + dx, y + dy, wire) for x, y, wire in drawing.dots]
