"""The text of a selection, such as ``robot.joints.position[*_knee]``, and what it selects."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from ...files.problems import nearest

_TEXT = re.compile(
    r"(?P<block>[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*)*)\.(?P<port>[A-Za-z_][A-Za-z0-9_]*)"
    r"(?:\.(?P<field>[A-Za-z_][A-Za-z0-9_]*))?(?P<index>(?:\[[^\[\]]*\])*)$"
)


@dataclass(frozen=True)
class Selection:
    """A part of a signal: a ``field``, empty for the only one, and what is taken of its array.

    Every text in ``indices`` is the inside of a pair of brackets; they are applied one after the
    other.
    """

    field: str = ""
    indices: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.field or self.indices)

    def __str__(self) -> str:
        return (f".{self.field}" if self.field else "") + "".join(f"[{i}]" for i in self.indices)

    def of(self, inner: Selection) -> Selection:
        """Return this selection of the elements that another one has selected.

        Raises:
            ValueError: a field cannot be selected of a field, or of some elements.
        """
        if self.field and inner:
            raise ValueError(f"{str(self)!r} cannot be selected of {str(inner)!r}")
        return Selection(self.field or inner.field, inner.indices + self.indices)


WHOLE = Selection()
"""All of a signal."""


def read_selection(text: str) -> tuple[str, Selection] | None:
    """Read the ``block.port`` and the selection in a source's text; ``None`` if it is not a
    source."""
    match = _TEXT.match(text)
    if match is None:
        return None
    inside = match["index"][1:-1].split("][") if match["index"] else []
    indices = tuple(" ".join(index.split()) for index in inside)
    return f"{match['block']}.{match['port']}", Selection(match["field"] or "", indices)


def select(
    selection: Selection, shape: tuple[int, ...], names: Sequence[str] = ()
) -> NDArray[np.int64]:
    """Return the elements that are selected of an array of this ``shape``, by their place in row
    order.

    ``names`` are those of the array's rows, if they have any. The result has the shape of what is
    selected.

    Raises:
        ValueError: an index cannot be read, is outside, or selects nothing; the text tells which.
    """
    places = np.arange(int(np.prod(shape)), dtype=np.int64).reshape(shape)
    own_names: Sequence[str] = names
    for index in selection.indices:
        places, own_names = _apply(index, places, own_names), ()
    return places


def _apply(index: str, places: NDArray[np.int64], names: Sequence[str]) -> NDArray[np.int64]:
    parts = [part.strip() for part in index.split(",")]
    if len(parts) > places.ndim:
        what = f"an array of shape {list(places.shape)}" if places.ndim else "one number"
        raise ValueError(f"[{index}] has {len(parts)} indices for {what}")
    result = places
    axis = 0
    for number, part in enumerate(parts):
        own = names if number == 0 else ()
        key = _key(part, places.shape[number], own)
        result = np.take(result, key, axis=axis)
        axis += 0 if isinstance(key, int) else 1
    if not result.size:
        raise ValueError(f"[{index}] selects nothing of {places.shape[0]} elements")
    return result


def _key(part: str, size: int, names: Sequence[str]) -> int | NDArray[np.int64]:
    """Find the element or the elements of an axis that a text names."""
    ends = part.split(":")
    if len(ends) > 3:
        raise ValueError(f"[{part}] is not a slice")
    if len(ends) > 1:
        start, stop, step = (*ends, "", "")[:3]
        first = None if not start.strip() else _place(start, size, names)
        last = None if not stop.strip() else _place(stop, size, names, end=True)
        every = None if not step.strip() else _whole(step)
        if every == 0:
            raise ValueError(f"[{part}] has a step of zero")
        return np.arange(size, dtype=np.int64)[slice(first, last, every)]
    if any(character in part for character in "*?"):
        if not names:
            raise ValueError(f"[{part}] is a pattern of names, and these elements have none")
        found = [k for k, name in enumerate(names) if fnmatchcase(name, part)]
        if not found:
            raise ValueError(f"[{part}] matches none of {', '.join(names)}")
        return np.array(found, np.int64)
    place = _place(part, size, names)
    if not -size <= place < size:
        raise ValueError(f"[{part}] is outside of {size} elements, which count from 0")
    return place % size


def _place(text: str, size: int, names: Sequence[str], *, end: bool = False) -> int:
    """Find the number that a text is, or the place of the element it names.

    A slice ends before a number, and behind a name.
    """
    text = text.strip()
    if text in names:
        return list(names).index(text) + (1 if end else 0)
    if re.fullmatch(r"[+-]?\d+", text):
        return int(text)
    if not names:
        raise ValueError(f"[{text}] is not a whole number, and these elements have no names")
    similar = nearest(text, names)
    hint = f"; did you mean {similar[0]}?" if similar else ""
    raise ValueError(f"[{text}] is none of {', '.join(names)}{hint}")


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"[{text}] is not a whole number") from None


def runs(places: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Places as stretches of neighbours: (first place in the source, first in the result, length)."""
    flat = places.reshape(-1)
    found: list[tuple[int, int, int]] = []
    for target, source in enumerate(flat.tolist()):
        if found and source == found[-1][0] + found[-1][2]:
            found[-1] = (found[-1][0], found[-1][1], found[-1][2] + 1)
        else:
            found.append((source, target, 1))
    return found
