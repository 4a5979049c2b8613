"""Recorded signals as columns that are called after joints, contact points, feet and axes.

``table`` calls the same columns by number; these names are for people and other programs.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ..file.format import RecordedField, RecordedRows
from ..file.reader import RecordedRun
from ..file.table import TICK, TIME, chosen
from ..viewing.signal_names import names_along, unit_of_element


@dataclass(frozen=True)
class NamedColumn:
    """One number in every tick, by name, and what is known about it, as texts."""

    name: str
    about: Mapping[str, str]


class NamedColumns:
    """``tick``, ``t`` and every number of some signals, by default of all.

    Args:
        run: the recording.
        names: of signals, or the beginnings of such, ``dynamics`` or ``dynamics.terms``.

    Attributes:
        columns: all columns, in order.

    Raises:
        KeyError: no signal has such a name or beginning.
    """

    def __init__(self, run: RecordedRun, names: Sequence[str] = ()) -> None:
        robot, self._rate = run.header.robot, run.header.base_rate
        self._fields = chosen(run, names)
        self.columns = [NamedColumn(TICK, {}), NamedColumn(TIME, {"unit": "s"})]
        for field in self._fields:
            about = {"signal": field.name, "frame": field.frame or "", "text": field.text}
            for k, element in enumerate(element_labels(field, robot)):
                name = f"{field.name}[{element}]" if element else field.name
                unit = unit_of_element(field, robot, k)
                self.columns.append(NamedColumn(name, {**about, "unit": unit, "element": element}))

    def values(self, batch: RecordedRows) -> list[NDArray[Any]]:
        """Return the values of each column in the ticks of a batch, (ticks,) each."""
        found: list[NDArray[Any]] = [batch.ticks, batch.ticks / self._rate]
        for field in self._fields:
            values = batch.signal(field.name)
            found += list(values.reshape(len(values), math.prod(field.shape)).T)
        return found


def element_labels(field: RecordedField, robot: RobotDescription | None) -> list[str]:
    """Return a label for every element of a field, in C order: ``left_toe, x``; of a scalar, an
    empty one."""
    axes = []
    for size, length in zip(field.dimensions, field.shape, strict=True):
        names = names_along(field, size, length, robot)
        repeated = max(Counter(names).values(), default=1) > 1
        axes.append([str(k) for k in range(length)] if repeated else names)
    return [", ".join(parts) for parts in product(*axes)]
