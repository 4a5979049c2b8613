"""Texts on one moment of a running graph: its values, and the times of its blocks."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....logs.file.format import RecordedField
from ....logs.file.header import recorded_field
from ....logs.viewing.signal_names import element_names, value_text
from ....runtime.language.errors import AloftError
from ....runtime.language.layout import Layout
from ....runtime.language.quantities import Quantity
from ....runtime.language.stages import CheckedGraph
from ....runtime.live.window import WindowContents
from ....runtime.running.lateness import duration

FEW = 2
"""Numbers of a port that stand beside its wire."""
MOST_LINES = 16
"""Elements of a field that a strip chart draws; of a longer field the first."""


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
        self._robot = graph.robot
        self._fields: list[RecordedField] = []
        for spec in graph.blocks:
            if paths is not None and spec.path not in paths:
                continue
            for port, output in spec.block_type.outputs.items():
                for name, field in output.signal.fields.items():
                    quantity = spec.quantities.get(f"{port}.{name}")
                    quantity = quantity or Quantity(field.unit, field.frame)
                    full_name = f"{spec.path}.{port}.{name}"
                    made = recorded_field(full_name, layout.slots[full_name], field, quantity)
                    unit = "" if quantity.unit_text == "1" else quantity.unit_text
                    self._fields.append(replace(made, unit=unit))
        self._by_name = {field.name: field for field in self._fields}

    def all(self, bus: NDArray[np.uint8]) -> dict[str, str]:
        """Every field of every output, by ``block.port.field``."""
        found = {}
        for field in self._fields:
            value = self._layout.view(bus, field.name)
            named = _named(field, value)
            found[field.name] = (
                f"{value.item()} ({named})" if named else value_text(value, field.unit or "")
            )
        return found

    def brief(self, bus: NDArray[np.uint8]) -> dict[str, str]:
        """Return the first numbers of the first field of every output, by ``block.port``."""
        found: dict[str, str] = {}
        for field in self._fields:
            port = field.name.rpartition(".")[0]
            if port not in found:
                value = self._layout.view(bus, field.name)
                found[port] = _named(field, value) or _brief(value, field.unit or "")
        return found

    def numbers(self, bus: NDArray[np.uint8], names: Sequence[str]) -> dict[str, list[Any]]:
        """Return the first ``MOST_LINES`` numbers of the fields that are known here, by name.

        What is not finite is ``None``, which a chart leaves out.
        """
        found: dict[str, list[Any]] = {}
        for name in names:
            if name in self._by_name:
                flat = np.ravel(self._layout.view(bus, name))[:MOST_LINES]
                found[name] = [x if isfinite(x) else None for x in flat.astype(float).tolist()]
        return found

    def lines(self, name: str) -> dict[str, Any]:
        """Describe the lines of a field in a strip chart.

        Returns:
            Plain data: ``names`` of the elements that are drawn, ``unit``, ``values`` (the names of
            the values of an enumeration), ``size`` (how many elements the field has).

        Raises:
            AloftError: there is no such field.
        """
        field = self._by_name.get(name)
        if field is None:
            raise AloftError(f"there is no output field {name!r} in this graph")
        names = element_names(field, self._robot) or [str(k) for k in range(field.size)]
        return {
            "names": names[:MOST_LINES],
            "unit": field.unit,
            "values": {str(number): text for number, text in field.values.items()},
            "size": field.size,
        }


def list_names(graph: CheckedGraph, block: str, length: int) -> list[str]:
    """Name the elements of a parameter that is a list, as the block's own signals name theirs.

    Args:
        graph: the graph of the block.
        block: its path.
        length: the number of elements.

    Returns:
        Names of joints or axes, if all vectors of that length and of a named size among the block's
        inputs and outputs have the same ones; else indices.
    """
    spec = graph.block(block)
    found = set()
    for name, port in (*spec.block_type.inputs.items(), *spec.block_type.outputs.items()):
        for field_name, field in port.signal.fields.items():
            # a named size ties the list to the vector; a vector of three says nothing of three gains
            named = len(field.shape) == 1 and isinstance(field.shape[0], str)
            if named and field.resolve(spec.dimensions) == (length,):
                quantity = spec.quantities.get(f"{name}.{field_name}")
                frame = quantity.frame if quantity is not None else field.frame
                entry = RecordedField(field_name, "float64", 0, (length,), field.shape, frame=frame)
                found.add(tuple(element_names(entry, graph.robot)))
    return list(found.pop()) if len(found) == 1 else [str(k) for k in range(length)]


def _named(field: RecordedField, value: NDArray[Any]) -> str:
    """Return the name of a value that has one."""
    return field.values.get(int(value.item()), "") if field.values and value.size == 1 else ""


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
    p99, latest = duration(late.p99_us * 1e3), duration(late.max_us * 1e3)
    return f"{text}; 99 % began within {p99}, the latest after {latest}"


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
