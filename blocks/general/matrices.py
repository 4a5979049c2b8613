"""Matrices as parameters: lists of rows that are equally long."""

from __future__ import annotations

from typing import Any

from pydantic import field_validator

Matrix = list[list[float]]
"""A list of rows."""


def equal_rows(value: Matrix) -> Matrix:
    """The same matrix.

    Raises:
        ValueError: it has no column, or its rows are not equally long.
    """
    lengths = [len(row) for row in value]
    if value and (min(lengths) != max(lengths) or not lengths[0]):
        raise ValueError(f"expected rows of one length, found lengths {lengths}")
    return value


def matrix_rows(*names: str) -> Any:
    """The validator that a class of parameters has for its matrices."""
    return field_validator(*names)(equal_rows)
