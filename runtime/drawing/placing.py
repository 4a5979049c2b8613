"""Gives every node of a diagram its place: columns next to each other, wires as straight as can be."""

from __future__ import annotations

from .diagram import INTO, OUT, Diagram
from .geometry import HEAD, Box, Drawing, size_of
from .layers import Layers, Pass, Place, arrange
from .routing import Router, column_gaps

_GAP = 22.0
"""Between two nodes of a column."""
_PASS_GAP = 9.0
"""Between passages of wires."""
_MARGIN = 14.0
_STEP = 24.0
"""Smaller steps in a line that passes a column are taken out."""
_FAR = 1e9
_ITERATIONS = 120


def draw(diagram: Diagram) -> Drawing:
    """The drawing of a diagram, with the drawings of open boxes inside."""
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
    router = Router(layers, boxes, {p: h for p, h in heights.items() if isinstance(p, Pass)})
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


def _heights(layers: Layers, boxes: dict[str, Box]) -> dict[Place, float]:
    """The y of the upper edge of every node, and of every passage."""
    y: dict[Place, float] = {}
    for column in layers.columns:
        top = 0.0
        for place in column:
            y[place] = top
            top += _height(place, boxes) + (_PASS_GAP if isinstance(place, Pass) else _GAP)
    links: dict[Place, list[tuple[Place, float, float, float]]] = {}
    for (a, b), ends in layers.links.items():
        for out, into in ends:
            weight = (1.0, 4.0, 16.0)[isinstance(a, Pass) + isinstance(b, Pass)]
            from_a = boxes[a].port(out, True) if isinstance(a, str) else 0.0
            from_b = boxes[b].port(into, False) if isinstance(b, str) else 0.0
            links.setdefault(a, []).append((b, from_a, from_b, weight))
            links.setdefault(b, []).append((a, from_b, from_a, weight))
    for sweep in range(_ITERATIONS):
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


def _straighten(layers: Layers, y: dict[Place, float], boxes: dict[str, Box]) -> None:
    """Take small steps out of the lines that pass columns, where there is room."""
    before = {b: (a, ends[0][0]) for (a, b), ends in layers.links.items() if isinstance(b, Pass)}
    for column in layers.columns:
        for number, place in enumerate(column):
            if not isinstance(place, Pass):
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


def _height(place: Place, boxes: dict[str, Box]) -> float:
    return boxes[place].height if isinstance(place, str) else 0.0


def _settle(
    column: list[Place],
    wishes: list[tuple[float, float]],
    y: dict[Place, float],
    boxes: dict[str, Box],
) -> None:
    """Move the places of a column as near to their wishes as their order and distances allow.

    This is isotonic regression: neighbours that would overlap move together to their mean wish.
    """
    starts, top = [], 0.0
    for number, place in enumerate(column):
        if number:
            before = column[number - 1]
            both = isinstance(before, Pass) and isinstance(place, Pass)
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
