"""Parameters of blocks on vectors: how many elements, and values that may differ by element."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationInfo, field_validator

from ...runtime.language.parameters import Parameters, parameter

PerElement = float | list[float]
"""One number for all elements of a vector, or a list with one number for each."""
_CHECKED = (PerElement, PerElement | None)


class Elements(Parameters):
    """The base of the parameters of blocks on a vector with ``n`` elements.

    A parameter of type ``PerElement`` that is a list must have n numbers, which is part of the
    load report.
    """

    n: int = parameter(1, ge=1, text="elements")

    @field_validator("*")
    @classmethod
    def _one_or_n(cls, value: Any, info: ValidationInfo) -> Any:
        n, name = info.data.get("n"), info.field_name
        if n is None or name is None or not isinstance(value, list):
            return value
        if cls.model_fields[name].annotation in _CHECKED and len(value) != n:
            raise ValueError(f"{name} has {len(value)} elements, expected n = {n}")
        return value


def spread(value: PerElement, n: int) -> NDArray[np.float64]:
    """The value as an array of its own with n elements."""
    result = np.empty(n)
    result[...] = value
    return result


def spread_bound(value: PerElement | None, n: int, absent: float) -> NDArray[np.float64]:
    """The same for a bound that may be missing and is then ``absent``, such as minus infinity."""
    return spread(absent if value is None else value, n)
