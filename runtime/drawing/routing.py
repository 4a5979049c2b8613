"""Routes wires with right angles: through the gaps between columns, and back below all blocks."""

from __future__ import annotations

from dataclasses import dataclass, field

from .diagram import OUT, Wire
from .geometry import NOTE, Box, Drawing, Line, note_of, width_of
from .layers import Layers, Pass

_TRACK = 6.5
"""From one vertical line to the next."""
_LANE = 9.0
"""From one line that leads back to the next."""
_STRAIGHT = 0.5
Net = tuple[str, str]


@dataclass
class _Hop:
    """A net in one gap: it enters at some height on the left and leaves at others on the right.

    ``lane`` is the number of the lane below all blocks that it comes from or goes to.
    """

    net: Net
    wire: Wire
    starts: float | None
    ends: list[tuple[float, Wire | None]] = field(default_factory=list)
    goes_to: int | None = None
    comes_from: int | None = None
    track: int = 0

    def span(self, floor: float) -> tuple[float, float]:
        """The least and the greatest height."""
        heights = [y for y, _ in self.ends]
        heights += [] if self.starts is None else [self.starts]
        if self.goes_to is not None or self.comes_from is not None:
            lane = self.goes_to if self.goes_to is not None else self.comes_from
            heights.append(floor + _LANE * (lane or 0))
        return min(heights), max(heights)

    def is_straight(self) -> bool:
        """Whether it needs no vertical line."""
        if self.goes_to is not None or self.comes_from is not None or self.starts is None:
            return False
        return all(abs(y - self.starts) < _STRAIGHT for y, _ in self.ends)


class Router:
    """The wires of one diagram. ``columns`` are the left and right edges of its columns."""

    def __init__(self, layers: Layers, boxes: dict[str, Box], passages: dict[Pass, float]) -> None:
        self.layers = layers
        self.boxes = boxes
        self.passages = passages
        self.columns: list[tuple[float, float]] = []
        self.wires: dict[Net, Wire] = {}
        low = [box.y + box.height for box in boxes.values()] + list(passages.values())
        self.floor = max(low, default=0.0) + 20.0
        self.gaps: list[dict[tuple[Net, str], _Hop]] = [{} for _ in range(len(layers.columns) + 1)]
        self.lanes: list[tuple[int, int, Net, list[Wire]]] = []
        for wire in [*layers.forward, *layers.back]:
            self.wires.setdefault(wire.source, wire)
        self._forward()
        self._back()
        for gap in self.gaps:
            _assign_tracks(list(gap.values()), self.floor)

    def _out(self, net: Net) -> float:
        box = self.boxes[net[0]]
        return box.y + box.port(net[1], True)

    def _into(self, wire: Wire) -> float:
        box = self.boxes[wire.target[0]]
        return box.y + box.port(wire.target[1], False)

    def _hop(self, gap: int, net: Net, starts: float) -> _Hop:
        return self.gaps[gap].setdefault((net, ""), _Hop(net, self.wires[net], starts))

    def _forward(self) -> None:
        for passage, height in self.passages.items():
            before = Pass(passage.net, passage.layer - 1)
            starts = self.passages.get(before, self._out(passage.net))
            self._hop(passage.layer, passage.net, starts).ends.append((height, None))
        for wire in self.layers.forward:
            number = self.layers.layer[wire.target[0]]
            before = Pass(wire.source, number - 1)
            starts = self.passages.get(before, self._out(wire.source))
            self._hop(number, wire.source, starts).ends.append((self._into(wire), wire))

    def _back(self) -> None:
        """Lanes for the nets that lead back, the shortest uppermost."""
        nets: dict[tuple[Net, int], list[Wire]] = {}
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
            arrival = _Hop(net, wires[0], None, comes_from=lane)
            arrival.ends = [(self._into(wire), wire) for wire in wires]
            self.gaps[target][net, f"back{lane}"] = arrival
            self.lanes.append((source + 1, target, net, wires))

    def _x(self, gap: int, track: int) -> float:
        """The place of a vertical line."""
        left = self.columns[gap - 1][1] if gap else 0.0
        return left + 14.0 + _TRACK * track

    def route(self, drawing: Drawing) -> None:
        """Add all lines."""
        for number, gap in enumerate(self.gaps):
            for hop in gap.values():
                self._draw(number, hop, drawing)
        for lane, (begin, target, net, wires) in enumerate(self.lanes):
            y = self.floor + _LANE * lane
            start = self._x(begin, self.gaps[begin][net, ""].track)
            end = self._x(target, self.gaps[target][net, f"back{lane}"].track)
            drawing.lines.append(Line(((start, y), (end, y)), wires[0], ends=False))
            if self.gaps[begin][net, ""].goes_to != lane:
                drawing.dots.append((start, y, wires[0]))

    def _draw(self, number: int, hop: _Hop, drawing: Drawing) -> None:
        """The lines of a net in a gap."""
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
                first + _STRAIGHT < y < last - _STRAIGHT
                or sum(abs(y - other) < 1.0 for other in heights) > 1
            ):
                drawing.dots.append((x, y, hop.wire))

    def ends(self, wire: Wire | None) -> bool:
        """Whether a branch ends at a block, and not at a border behind which it goes on."""
        if wire is None:
            return False
        box = self.boxes[wire.target[0]]
        return wire.target[0] != OUT and box.inside is None

    def _edge(self, net: Net, column: int, edges: tuple[float, float]) -> float:
        """Where a net leaves a column: at its block, or at the column's left edge if it passes."""
        box = self.boxes[net[0]]
        if self.layers.layer[net[0]] == column:
            return box.x + box.width
        return edges[0] - 2.0

    def _end(self, number: int, hop: _Hop, wire: Wire | None) -> float:
        """Where a branch ends: at a block, or at the edge of the column that it passes."""
        if wire is None:
            return self.columns[number][0] - 2.0
        return self.boxes[wire.target[0]].x


def _assign_tracks(hops: list[_Hop], floor: float) -> None:
    """Give vertical lines that overlap different tracks, so that few lines cross."""
    bent = [hop for hop in hops if not hop.is_straight()]

    def downwards(hop: _Hop) -> bool:
        first, last = hop.span(floor)
        return hop.starts is not None and hop.starts - first < last - hop.starts

    # Those that lead up are sorted from above, those that lead down from below: then a line does
    # not cross those that enter above or below it on the same way.
    bent.sort(key=lambda hop: (hop.starts is None, _order(hop, downwards(hop), floor)))
    tracks: list[list[tuple[float, float]]] = []
    for hop in bent:
        first, last = hop.span(floor)
        for number, taken in enumerate(tracks):
            if all(last + 5.0 < a or b + 5.0 < first for a, b in taken):
                hop.track = number
                taken.append((first, last))
                break
        else:
            hop.track = len(tracks)
            tracks.append([(first, last)])


def _order(hop: _Hop, down: bool, floor: float) -> float:
    start = hop.starts if hop.starts is not None else hop.span(floor)[1]
    return -start if down else start


def column_gaps(router: Router) -> list[float]:
    """The width of every gap: before the first column, between columns, and behind the last."""
    widths = []
    for number, gap in enumerate(router.gaps):
        count = 1 + max((hop.track for hop in gap.values() if not hop.is_straight()), default=-1)
        outside = number in (0, len(router.gaps) - 1)
        least = 16.0 if outside and not gap else 30.0
        ends = [w for hop in gap.values() for _, w in hop.ends if w is not None and router.ends(w)]
        notes = max((width_of(note_of(w), NOTE) for w in ends), default=0.0)
        widths.append(max(least, 28.0 + _TRACK * count + notes))
    return widths
