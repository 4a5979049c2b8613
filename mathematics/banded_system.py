"""The smallest weighted correction that fulfils linear equations whose variables follow each other in time.

For equations A x = b, of which each touches only variables near its place, the smallest x'Wx is W^-1 A' y with
(A W^-1 A') y = b. That matrix is positive and has few diagonals. It is kept by columns: ``band[j, k]`` is
its entry in row j + k and column j, and ``last[j]`` the last row that is not zero there.
"""

from __future__ import annotations

import math

from .arrays import Array1D, Array2D, Flags1D, Indices1D
from .kernel import kernel

TOGETHER = 4
"""Columns that are eliminated together."""

# Loops over a column are functions of their own: an index that is a sum is checked for overflow, and such a loop is
# not done with the processor's vectors.


@kernel
def assemble_normal(
    starts: Indices1D, rows: Indices1D, values: Array1D, inverse_weights: Array1D,
    place: Indices1D, equations: int, band: Array2D, last: Indices1D, chosen: Indices1D, entries: Array1D,
) -> bool:  # fmt: skip
    """Assemble A W^-1 A' of the chosen rows of a sparse matrix, in columns with ascending rows.

    Args:
        starts, rows, values: the non-zeros of column c are ``values[starts[c]:starts[c + 1]]``.
        inverse_weights: the diagonal of W^-1, one for each column.
        place: which equation a row is, ascending, and -1 of those left out.
        equations: how many are chosen.
        chosen, entries: scratch, as long as a column has non-zeros.

    Returns whether all of it is inside of the band, with a margin of ``TOGETHER`` - 1 diagonals.
    """
    for j in range(equations):
        last[j] = j
    for column in range(inverse_weights.shape[0]):
        end = -1
        for a in range(starts[column + 1] - 1, starts[column] - 1, -1):
            j = place[rows[a]]
            if j >= 0 and values[a] != 0.0:
                end = max(end, j)
                last[j] = max(last[j], end)
    # The factor fills what is above the last row of any column before, and columns are eliminated together.
    reach = 0
    for j in range(equations):
        for i in range(j, min(j + TOGETHER, equations)):
            reach = max(reach, last[i])
        if reach - j >= band.shape[1]:
            return False
        fill_zeros(band[j, : reach - j + 1])
    for column in range(inverse_weights.shape[0]):
        # Most rows of a column are inequalities that are left out.
        count = 0
        for a in range(starts[column], starts[column + 1]):
            j = place[rows[a]]
            if j >= 0:
                chosen[count], entries[count] = j, values[a]
                count += 1
        for first in range(count):
            if entries[first] != 0.0:
                j = chosen[first]
                value = entries[first] * inverse_weights[column]
                for second in range(first, count):
                    band[j, chosen[second] - j] += value * entries[second]
    return True


@kernel
def factorise_band(equations: int, regularisation: float, band: Array2D, last: Indices1D) -> bool:
    """Compute the Cholesky factor in place, with that share of the diagonal added to it. An
    equation without a variable that may change, whose diagonal is zero, holds nothing.

    Four columns are eliminated together, so that a row of the band is read and written once for all. Each entry
    loses their products in the same order as one by one.

    Of ``band`` must be zero wherever ``assemble_normal`` writes zeros.

    Returns whether all pivots are positive.
    """
    for j in range(equations):
        band[j, 0] = band[j, 0] * (1.0 + regularisation) if band[j, 0] > 0.0 else 1.0
    for first in range(0, equations, TOGETHER):
        stop = min(first + TOGETHER, equations)
        end = first
        for j in range(first, stop):
            pivot = band[j, 0]
            if not 0.0 < pivot < math.inf:
                return False
            root = math.sqrt(pivot)
            width = last[j] - j
            divide(band[j, : width + 1], root)
            for k in range(1, width + 1):
                if band[j, k] != 0.0:
                    last[j + k] = max(last[j + k], last[j])
            for k in range(1, min(width + 1, stop - j)):
                value = band[j, k]
                if value != 0.0:
                    subtract_product(band[j + k, : width - k + 1], value, band[j, k : width + 1])
            end = max(end, last[j])
        if stop - first < TOGETHER:
            return True
        for k in range(1, end - stop + 2):
            one, two = band[first, k + 3], band[first + 1, k + 2]
            three, four = band[first + 2, k + 1], band[first + 3, k]
            if one != 0.0 or two != 0.0 or three != 0.0 or four != 0.0:
                width = end - stop - k + 2
                subtract_products(
                    band[first + 3 + k, :width],
                    one, band[first, k + 3 : k + 3 + width], two, band[first + 1, k + 2 : k + 2 + width],
                    three, band[first + 2, k + 1 : k + 1 + width], four, band[first + 3, k : k + width],
                )  # fmt: skip
    return True


@kernel
def fill_zeros(values: Array1D) -> None:
    """Set all values to zero."""
    for m in range(values.shape[0]):
        values[m] = 0.0


@kernel
def divide(values: Array1D, divisor: float) -> None:
    """Divide all values by one."""
    for m in range(values.shape[0]):
        values[m] = values[m] / divisor


@kernel
def subtract_product(target: Array1D, one: float, first: Array1D) -> None:
    """Subtract a multiple of a column from a column."""
    for m in range(target.shape[0]):
        target[m] = target[m] - one * first[m]


@kernel
def subtract_products(
    target: Array1D, one: float, first: Array1D, two: float, second: Array1D,
    three: float, third: Array1D, four: float, fourth: Array1D,
) -> None:  # fmt: skip
    """Subtract four multiples of columns from a column, one after the other."""
    for m in range(target.shape[0]):
        value = target[m] - one * first[m]
        value = value - two * second[m]
        value = value - three * third[m]
        target[m] = value - four * fourth[m]


@kernel
def solve_band(equations: int, band: Array2D, last: Indices1D, vector: Array1D) -> None:
    """Solve with the factor, in place."""
    for j in range(equations):
        value = vector[j] / band[j, 0]
        vector[j] = value
        width = last[j] - j
        subtract_product(vector[j + 1 : j + 1 + width], value, band[j, 1 : width + 1])
    for j in range(equations - 1, -1, -1):
        width = last[j] - j
        vector[j] = (
            without_products(vector[j], band[j, 1 : width + 1], vector[j + 1 : j + 1 + width])
            / band[j, 0]
        )


@kernel
def without_products(value: float, first: Array1D, second: Array1D) -> float:
    """Return the value less the products of two vectors, one after the other."""
    for m in range(first.shape[0]):
        value -= first[m] * second[m]
    return value


@kernel
def smallest_correction(
    starts: Indices1D, rows: Indices1D, values: Array1D, inverse_weights: Array1D,
    place: Indices1D, equations: Indices1D, regularisation: float,
    band: Array2D, last: Indices1D, chosen: Indices1D, vector: Array1D, out: Array1D,
    factorised: Flags1D, found: Flags1D,
) -> None:  # fmt: skip
    """Compute the x with the smallest x'Wx whose chosen rows of A x are the ``vector``, which
    becomes y.

    If ``factorised`` (1,), ``band`` and ``last`` still hold the factor for the same rows of a matrix near A. ``found``
    (1,) tells whether there is an x: all equations are inside of the band and independent.
    """
    count = equations[0]
    found[0] = False
    if count > out.shape[0]:
        return  # they cannot be independent
    if not factorised[0]:
        if not assemble_normal(
            starts, rows, values, inverse_weights, place, count, band, last, chosen, out
        ):
            return
        if not factorise_band(count, regularisation, band, last):
            return
    solve_band(count, band, last, vector)
    for column in range(inverse_weights.shape[0]):
        total = 0.0
        for a in range(starts[column], starts[column + 1]):
            i = place[rows[a]]
            if i >= 0:
                total += values[a] * vector[i]
        out[column] = inverse_weights[column] * total
    found[0] = True
