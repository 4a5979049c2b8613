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
from ..file.format import RecordedField
from ..file.reader import RecordedRun
from ..file.table import TICK, TIME, chosen
from ..viewing.signal_names import names_along, unit_of_element


@dataclass(frozen=True)
class NamedColumn:
    """One number at every tick, ``values`` (ticks,), and what is known about it, as texts."""

    name: str
    values: NDArray[Any]
    about: Mapping[str, str]


def named_columns(run: RecordedRun, names: Sequence[str] = ()) -> list[NamedColumn]:
    """``tick``, ``t`` and every number of some signals, by default of all.

    Args:
        run: the recording.
        names: of signals, or the beginnings of such, ``dynamics`` or ``dynamics.terms``.

    Raises:
        KeyError: no signal has such a name or beginning.
    """
    columns = [NamedColumn(TICK, run.ticks, {}), NamedColumn(TIME, run.time, {"unit": "s"})]
    fields = chosen(run, names)
    if len(fields) > 1:
        _ = run.rows  # read all at once, not the file anew for each
    for field in fields:
        values = run[field.name]
        about = {
            "signal": field.name,
            "frame": field.frame or "",
            "text": field.text,
        }
        flat = values.reshape(len(values), math.prod(values.shape[1:]))
        for k, element in enumerate(element_labels(field, run.header.robot)):
            name = f"{field.name}[{element}]" if element else field.name
            unit = unit_of_element(field, run.header.robot, k)
            columns.append(
                NamedColumn(name, flat[:, k], {**about, "unit": unit, "element": element})
            )
    return columns


def element_labels(field: RecordedField, robot: RobotDescription | None) -> list[str]:
    """A label for every element of a field, in C order: ``left_toe, x``; of a scalar, an empty one."""
    axes = []
    for size, length in zip(field.dimensions, field.shape, strict=True):
        names = names_along(field, size, length, robot)
        repeated = max(Counter(names).values(), default=1) > 1
        axes.append([str(k) for k in range(length)] if repeated else names)
    return [", ".join(parts) for parts in product(*axes)]
