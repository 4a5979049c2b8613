"""The lanes of the viewer's state timeline, and the table of the blocks' times.

A lane shows when a field with few values changed: phases, contacts, whether a problem was solved.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.robot_description import RobotDescription
from ..file.format import STATES, Header, RecordedField, RecordedRows, entity_of
from .signal_names import element_names

PALETTE = (
    0x78909CFF, 0x26A69AFF, 0xFFA726FF, 0x42A5F5FF, 0xAB47BCFF, 0x66BB6AFF, 0xE53935FF, 0xFDD835FF,
)  # fmt: skip
NO, YES, BAD = 0x455A64FF, 0x43A047FF, 0xE53935FF
MOST_LANES = 8
"""A field with more truth values than this has no lanes."""


@dataclass(frozen=True)
class Lane:
    """One lane: its entity, the ``element`` of ``field`` it shows, and label and colour by value;
    ``told`` if its changes are events, too."""

    entity: str
    field: RecordedField
    element: int
    labels: Mapping[int, str]
    colors: tuple[int, ...]
    told: bool


def all_lanes(header: Header) -> list[Lane]:
    """Return the lanes of every field of a run, each with the shortest entity that no other lane
    has.

    The viewer writes the entity above a lane, so ``states/left_heel`` reads better than
    ``states/contacts/state/active/left_heel``. Where two lanes would be called the same, both
    have the name of the field, then that of the block, and at last the full name of the signal.
    What a wire delays (a block with ``~`` in its path) is shown where it comes from.
    """
    lanes = [
        lane
        for field in header.bus.fields
        if not field.constant and "~" not in field.name
        for lane in lanes_of(field, header.robot)
    ]
    names = [_short_names(lane) for lane in lanes]
    for _ in range(3):
        taken = Counter(own[0] for own in names)
        names = [own[1:] if taken[own[0]] > 1 and len(own) > 1 else own for own in names]
    return [
        replace(lane, entity=f"{STATES}/{own[0]}") for lane, own in zip(lanes, names, strict=True)
    ]


def _short_names(lane: Lane) -> Sequence[str]:
    """Return the possible names of a lane, the shortest first."""
    block = lane.field.name.rsplit(".", 2)[0].replace("/", ".")
    field = lane.field.field_name
    full = lane.entity.removeprefix(f"{STATES}/").replace("/", ".")
    element = full.removeprefix(f"{lane.field.name}.".replace("/", ".")) if lane.field.shape else ""
    if element:
        return (element, f"{field}.{element}", f"{block}.{field}.{element}", full)
    return (field, field if field == block else f"{block}.{field}", full, full)


def lanes_of(field: RecordedField, robot: RobotDescription | None) -> list[Lane]:
    """Return the lanes of one field, each by the full name of its signal. Most fields have none."""
    entity = entity_of(STATES, field.name)
    if field.values and not field.shape:
        colors = tuple(PALETTE[k % len(PALETTE)] for k in range(len(field.values)))
        return [Lane(entity, field, 0, field.values, colors, told=True)]
    if field.dtype != "bool":
        return []
    labels = {0: "no", 1: field.field_name}
    if not field.shape:
        good = field.field_name in ("solved", "reachable")
        colors = (BAD, YES) if good else (NO, YES)
        return [Lane(entity, field, 0, labels | ({0: "failed"} if good else {}), colors, told=good)]
    names = element_names(field, robot)
    if len(names) > MOST_LANES:
        return []
    return [
        Lane(f"{entity}/{name.replace(' ', '_')}", field, k, labels, (NO, YES), told=False)
        for k, name in enumerate(names)
    ]


@dataclass(frozen=True)
class Changes:
    """The ticks in which a lane changed, (n,), and the labels of its new values."""

    lane: Lane
    ticks: NDArray[np.int64]
    labels: list[str]


class LaneReader:
    """Finds the changes in batches of rows that come in order."""

    def __init__(self, lanes: list[Lane]) -> None:
        self._lanes = lanes
        self._last: dict[str, int] = {}

    def changes(self, batch: RecordedRows) -> Iterator[Changes]:
        """Yield the changes in a batch. The first batch begins with a change in every lane."""
        for lane in self._lanes:
            values = batch.signal(lane.field.name)
            numbers = values.reshape(len(values), -1)[:, lane.element].astype(np.int64)
            last = self._last.get(lane.entity, int(numbers[0]) - 1)
            self._last[lane.entity] = int(numbers[-1])
            changed = np.flatnonzero(np.diff(numbers, prepend=last))
            if len(changed):
                labels = [lane.labels.get(int(n), str(n)) for n in numbers[changed]]
                yield Changes(lane, batch.ticks[changed], labels)


COLUMNS = (
    ("runs", "calls", "d"),
    ("mean [us]", "mean_us", ".1f"),
    ("median [us]", "p50_us", ".1f"),
    ("99 % [us]", "p99_us", ".1f"),
    ("longest [us]", "max_us", ".1f"),
    ("overruns", "overruns", "d"),
)


def times_table(outcome: Mapping[str, Any]) -> str:
    """Write the table as Markdown, made from an outcome (``RunResult.to_json``), in the order of
    execution."""
    blocks: Mapping[str, Mapping[str, Any]] = outcome.get("blocks", {})
    lines = ["| block | " + " | ".join(title for title, *_ in COLUMNS) + " |"]
    lines.append("|---|" + "---:|" * len(COLUMNS))
    for path, times in blocks.items():
        cells = [format(times[key], form) for _, key, form in COLUMNS]
        lines.append(f"| {path} | " + " | ".join(cells) + " |")
    total = sum(float(times["mean_us"]) for times in blocks.values())
    ticks, wall = outcome.get("ticks", 0), float(outcome.get("wall_time_s") or 0.0)
    lines += ["", f"{ticks} ticks in {wall:.2f} s; all blocks together {total:.0f} us on average."]
    return "\n".join(lines)
