"""The vertical lines in a gap between two columns: which stands left of which, so that few lines cross."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

from .diagram import DiagramWire

TRACK = 6.5
"""Distance from one vertical line to the next."""
LANE = 9.0
"""Distance from one line that leads back to the next."""
STRAIGHT = 0.5
Net = tuple[str, str]
_ROOM = 5.0
"""Between two lines on one track."""
_FEW = 80
"""Largest number of lines in a gap for which both orders of every pair are compared."""
_PASSES = 6


@dataclass
class Hop:
    """A net in one gap: it enters at some height on the left and leaves at others on the right.

    ``lane`` is the number of the lane below all blocks that it comes from or goes to.
    """

    net: Net
    wire: DiagramWire
    starts: float | None
    ends: list[tuple[float, DiagramWire | None]] = field(default_factory=list)
    goes_to: int | None = None
    comes_from: int | None = None
    track: int = 0

    def span(self, floor: float) -> tuple[float, float]:
        """Return the least and the greatest height."""
        heights = [y for y, _ in self.ends]
        heights += [] if self.starts is None else [self.starts]
        for lane in (self.goes_to, self.comes_from):
            heights += [] if lane is None else [floor + LANE * lane]
        return min(heights), max(heights)

    def is_straight(self) -> bool:
        """Return whether it needs no vertical line."""
        if self.goes_to is not None or self.comes_from is not None or self.starts is None:
            return False
        return all(abs(y - self.starts) < STRAIGHT for y, _ in self.ends)


@dataclass(frozen=True)
class _Vertical:
    """A vertical line: its ends, and the heights of what leads away to the left and to the right."""

    hop: Hop
    first: float
    last: float
    left: tuple[float, ...]
    right: tuple[float, ...]

    def crossed(self, heights: Sequence[float]) -> int:
        """Count the horizontal lines at these heights, in order, that cross it."""
        return max(0, bisect_left(heights, self.last) - bisect_right(heights, self.first))


def _vertical(hop: Hop, floor: float) -> _Vertical:
    left = [] if hop.starts is None else [hop.starts]
    right = [y for y, _ in hop.ends]
    left += [] if hop.goes_to is None else [floor + LANE * hop.goes_to]
    right += [] if hop.comes_from is None else [floor + LANE * hop.comes_from]
    return _Vertical(hop, *hop.span(floor), tuple(sorted(left)), tuple(sorted(right)))


def _cost(one: _Vertical, other: _Vertical) -> int:
    """Count the crossings of lines if ``one`` stands left of ``other``."""
    if one.last < other.first or other.last < one.first:
        return 0
    return one.crossed(other.left) + other.crossed(one.right)


def assign_tracks(hops: Sequence[Hop], floor: float) -> None:
    """Give the vertical lines of a gap their tracks, counted from the left."""
    lines = [_vertical(hop, floor) for hop in hops if not hop.is_straight()]
    # Those that lead up are sorted from above, those that lead down from below: then a line does
    # not cross those that enter above or below it on the same way.
    lines.sort(key=lambda line: (line.hop.starts is None, _place(line)))
    if len(lines) <= _FEW:
        _sift(lines)
    tracks: list[list[_Vertical]] = []
    for line in lines:
        number = len(tracks)
        while number and _may_stand(line, tracks[number - 1]):
            number -= 1
        free = number
        while free < len(tracks) and not _fits(line, tracks[free]):
            free += 1
        if free == len(tracks):
            tracks.append([])
        line.hop.track = free
        tracks[free].append(line)


def _place(line: _Vertical) -> float:
    starts = line.hop.starts
    if starts is None:
        return line.last
    return -starts if starts - line.first < line.last - starts else starts


def _sift(lines: list[_Vertical]) -> None:
    """Move each line to its best place among the others until none gains."""
    for _ in range(_PASSES):
        moved = False
        for line in list(lines):
            at = lines.index(line)
            others = lines[:at] + lines[at + 1 :]
            change, changes = 0, [0]
            for other in others:
                change += _cost(other, line) - _cost(line, other)
                changes.append(change)
            best = min(range(len(changes)), key=lambda k: (changes[k], abs(k - at)))
            if changes[best] < changes[at]:
                lines[:] = [*others[:best], line, *others[best:]]
                moved = True
        if not moved:
            break


def _fits(line: _Vertical, track: Sequence[_Vertical]) -> bool:
    return all(line.last + _ROOM < o.first or o.last + _ROOM < line.first for o in track)


def _may_stand(line: _Vertical, track: Sequence[_Vertical]) -> bool:
    """Return whether a line may stand on a track or left of it: none there must be left of the
    line."""
    return all(_cost(line, other) <= _cost(other, line) and _fits(line, [other]) for other in track)
