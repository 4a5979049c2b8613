"""The types of the arrays that the whole package computes with, named once.

A kernel that is written as equations declares the dimensions of each array: ``Array1D`` is a
vector, ``Array2D`` a matrix, ``Vector3`` a vector of three. ``Array``, ``Flags`` and ``Indices``
leave them open.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray


class Rank(NamedTuple):
    """Rank of an array: its number of dimensions, the type of its elements for Python, and known
    sizes."""

    dimensions: int
    element: type
    sizes: tuple[int | None, ...] = ()


Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Counts: TypeAlias = NDArray[np.int64]
"""Array like ``Indices``, for counts."""

if TYPE_CHECKING:  # a type checker takes the number x[()] for an array
    Array0D: TypeAlias = Any
    Flags0D: TypeAlias = Any
    Indices0D: TypeAlias = Any
else:
    Array0D: TypeAlias = Annotated[Array, Rank(0, float)]
    Flags0D: TypeAlias = Annotated[Flags, Rank(0, bool)]
    Indices0D: TypeAlias = Annotated[Indices, Rank(0, int)]
Array1D: TypeAlias = Annotated[Array, Rank(1, float)]
Array2D: TypeAlias = Annotated[Array, Rank(2, float)]
Array3D: TypeAlias = Annotated[Array, Rank(3, float)]
Flags1D: TypeAlias = Annotated[Flags, Rank(1, bool)]
Flags2D: TypeAlias = Annotated[Flags, Rank(2, bool)]
Indices1D: TypeAlias = Annotated[Indices, Rank(1, int)]
Indices2D: TypeAlias = Annotated[Indices, Rank(2, int)]

Vector2: TypeAlias = Annotated[Array, Rank(1, float, (2,))]
Vector3: TypeAlias = Annotated[Array, Rank(1, float, (3,))]
Vector4: TypeAlias = Annotated[Array, Rank(1, float, (4,))]
Matrix3: TypeAlias = Annotated[Array, Rank(2, float, (3, 3))]
Rows3: TypeAlias = Annotated[Array, Rank(2, float, (None, 3))]
"""Rows of three, such as the places of some points."""
