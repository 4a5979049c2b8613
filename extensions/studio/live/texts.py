"""Texts on one moment of a running graph: its values, and the times of its blocks."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....logs.viewing.signal_names import value_text
from ....runtime.language.layout import Layout
from ....runtime.language.quantities import Quantity
from ....runtime.language.stages import CheckedGraph
from ....runtime.live.window import WindowContents

FEW = 2
"""Numbers of a port that stand beside its wire."""


class ValueTexts:
    """Writes the values of a bus as texts.

    Args:
        graph: whose bus it is.
        layout: of the bus.
        paths: the blocks whose outputs are known there; by default all.
    """

    def __init__(
        self, graph: CheckedGraph, layout: Layout, paths: Collection[str] | None = None
    ) -> None:
        self._layout = layout
        self._fields: list[_Field] = []
        for spec in graph.blocks:
            if paths is not None and spec.path not in paths:
                continue
            for port, output in spec.block_type.outputs.items():
                for name, field in output.signal.fields.items():
                    quantity = spec.quantities.get(f"{port}.{name}")
                    quantity = quantity or Quantity(field.unit)
                    text = "" if quantity.unit_text == "1" else quantity.unit_text
                    names = {int(value): value.name.lower() for value in field.values or ()}
                    self._fields.append(_Field(f"{spec.path}.{port}", name, text, names))

    def all(self, bus: NDArray[np.uint8]) -> dict[str, str]:
        """Every field of every output, by ``block.port.field``."""
        found = {}
        for field in self._fields:
            full_name = f"{field.port}.{field.name}"
            value = self._layout.view(bus, full_name)
            named = field.named(value)
            found[full_name] = (
                f"{value.item()} ({named})" if named else value_text(value, field.unit)
            )
        return found

    def brief(self, bus: NDArray[np.uint8]) -> dict[str, str]:
        """Return the first numbers of the first field of every output, by ``block.port``."""
        found: dict[str, str] = {}
        for field in self._fields:
            if field.port not in found:
                value = self._layout.view(bus, f"{field.port}.{field.name}")
                found[field.port] = field.named(value) or _brief(value, field.unit)
        return found


@dataclass(frozen=True)
class _Field:
    """A field of an output; ``names`` are those of its values, if it is one of a choice."""

    port: str
    name: str
    unit: str
    names: Mapping[int, str]

    def named(self, value: NDArray[Any]) -> str:
        """Return the name of a value that has one."""
        return self.names.get(int(value.item()), "") if self.names and value.size == 1 else ""


def _brief(value: NDArray[Any], unit: str) -> str:
    flat = np.ravel(value)
    kind = flat.dtype.kind
    texts = [_number(x) if kind == "f" else str(x).lower() for x in flat[:FEW].tolist()]
    if flat.size > FEW:
        return f"{', '.join(texts)} …"
    return f"{', '.join(texts)} {unit}".rstrip()


def _number(value: float) -> str:
    """Format a number with three digits; magnitudes below 1e-9 become zero."""
    return "0" if abs(value) < 1e-9 else f"{value:.3g}"


def time_texts(
    programs: Sequence[Sequence[str]], stamps: Sequence[NDArray[np.int64]], late: dict[str, int]
) -> dict[str, tuple[str, str]]:
    """Return the times that each block took in the last ticks: in a word, and in a sentence.

    Args:
        programs: for each phase of the hyperperiod, the block of each call.
        stamps: for each phase, the stamps [ns] of its last ticks, (ticks, calls + 1).
        late: for each block, how many deadlines passed while it ran.
    """
    took: dict[str, list[NDArray[np.int64]]] = {}
    for owners, rows in zip(programs, stamps, strict=True):
        calls = np.diff(rows, axis=1)
        for path in dict.fromkeys(owner for owner in owners if owner and "~" not in owner):
            mine = [column for column, owner in enumerate(owners) if owner == path]
            took.setdefault(path, []).append(calls[:, mine].sum(axis=1))
    found = {}
    for path, parts in took.items():
        runs = np.concatenate(parts)
        if not runs.size:
            continue
        median, longest = float(np.median(runs)), float(runs.max())
        missed = late.get(path, 0)
        ending = "" if missed == 1 else "s"
        text = (
            f"median {duration(median)}, longest {duration(longest)} of the last {runs.size} runs; "
            f"{missed} deadline{ending} missed while it ran"
        )
        found[path] = (duration(median), text)
    return found


def lateness_text(look: WindowContents) -> str:
    """Say how late the ticks of a paced run began."""
    late = look.lateness
    if not late.ticks:
        return ""
    text = f"{look.overruns} ticks began late, {look.skipped} periods left out"
    return f"{text}; 99 % began within {late.p99_us:.3g} us, the latest after {late.max_us:.4g} us"


def tick_text(stamps: Sequence[NDArray[np.int64]], period: float) -> str:
    """Describe the time that all blocks of a tick take together, as a share of the period [s]."""
    ticks = [rows[:, -1] - rows[:, 0] for rows in stamps if len(rows)]
    if not ticks:
        return ""
    all_ticks = np.concatenate(ticks)
    median, longest = float(np.median(all_ticks)), float(all_ticks.max())
    return (
        f"a tick takes {duration(median)} (longest {duration(longest)}) of {duration(period * 1e9)}"
    )


def duration(nanoseconds: float) -> str:
    """Format a duration with three digits and a unit that fits."""
    for limit, scale, unit in ((1e6, 1e3, "µs"), (1e9, 1e6, "ms")):
        if nanoseconds < 0.9995 * limit:
            return f"{nanoseconds / scale:.3g} {unit}"
    return f"{nanoseconds / 1e9:.3g} s"
