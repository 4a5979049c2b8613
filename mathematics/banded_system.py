"""The smallest weighted correction that fulfils linear equations whose variables follow each other in time, and which
bounds are equations.

For equations A x = b, of which each touches only variables near its place, the smallest x'Wx is W^-1 A' y with
(A W^-1 A') y = b. That matrix is positive and has few diagonals. It is kept by columns in blocks of ``TOGETHER``:
``band[j, k]`` is its entry in column j and in row k behind the first row of the block of j, and ``last[j]`` the last row
that is not zero there. So all columns of a block are vectors of the same rows; what is above the diagonal is not used.
"""

from __future__ import annotations

import math

from .arrays import Array1D, Array2D, Flags1D, Indices1D
from .kernel import kernel

TOGETHER = 8
"""Columns of a block, which are eliminated together."""

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

    Returns whether all of it is inside of the band, in whole blocks.
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
    for first in range(0, equations, TOGETHER):
        stop = min(first + TOGETHER, equations)
        for j in range(first, stop):
            reach = max(reach, last[j])
        width = whole_blocks(reach + 1 - first)
        if width > band.shape[1]:
            return False
        for j in range(first, stop):
            fill_zeros(band[j, :width])
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
                start = j - j % TOGETHER
                for second in range(first, count):
                    band[j, chosen[second] - start] += value * entries[second]
    return True


@kernel
def whole_blocks(rows: int) -> int:
    """Return the rows of as many blocks as hold so many rows."""
    return rows + -rows % TOGETHER


@kernel
def factorise_band(equations: int, regularisation: float, band: Array2D, last: Indices1D) -> bool:
    """Compute the Cholesky factor in place, with that share of the diagonal added to it. An
    equation without a variable that may change, whose diagonal is zero, holds nothing.

    The columns of a block are eliminated together, so that a column behind it is read and written once for all. Each
    entry loses their products in the same order as one by one.

    Of ``band`` must be zero wherever ``assemble_normal`` writes zeros.

    Returns whether all pivots are positive.
    """
    for j in range(equations):
        pivot = band[j, j % TOGETHER]
        band[j, j % TOGETHER] = pivot * (1.0 + regularisation) if pivot > 0.0 else 1.0
    for first in range(0, equations, TOGETHER):
        stop = min(first + TOGETHER, equations)
        end = first
        for j in range(first, stop):
            pivot = band[j, j - first]
            if not 0.0 < pivot < math.inf:
                return False
            width = last[j] - first + 1
            divide(band[j, j - first : width], math.sqrt(pivot))
            for k in range(j - first + 1, min(width, stop - first)):
                if band[j, k] != 0.0:
                    last[first + k] = max(last[first + k], last[j])
                    subtract_product(band[first + k, k:width], band[j, k], band[j, k:width])
            end = max(end, last[j])
        for start in range(stop, end + 1, TOGETHER):
            here, width = start - first, whole_blocks(end + 1 - start)
            for j in range(start, min(start + TOGETHER, end + 1)):
                k = j - first
                one, two, three, four = band[first, k], band[first + 1, k], band[first + 2, k], band[first + 3, k]  # fmt: skip
                five, six, seven, eight = band[first + 4, k], band[first + 5, k], band[first + 6, k], band[first + 7, k]  # fmt: skip
                some = one != 0.0 or two != 0.0 or three != 0.0 or four != 0.0
                if some or five != 0.0 or six != 0.0 or seven != 0.0 or eight != 0.0:
                    last[j] = max(last[j], end)
                    subtract_products(
                        band[j, :width],
                        one, band[first, here : here + width], two, band[first + 1, here : here + width],
                        three, band[first + 2, here : here + width], four, band[first + 3, here : here + width],
                        five, band[first + 4, here : here + width], six, band[first + 5, here : here + width],
                        seven, band[first + 6, here : here + width], eight, band[first + 7, here : here + width],
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
    five: float, fifth: Array1D, six: float, sixth: Array1D,
    seven: float, seventh: Array1D, eight: float, eighth: Array1D,
) -> None:  # fmt: skip
    """Subtract eight multiples of columns from a column, one after the other."""
    for m in range(target.shape[0]):
        value = target[m] - one * first[m]
        value = value - two * second[m]
        value = value - three * third[m]
        value = value - four * fourth[m]
        value = value - five * fifth[m]
        value = value - six * sixth[m]
        value = value - seven * seventh[m]
        target[m] = value - eight * eighth[m]


@kernel
def solve_band(equations: int, band: Array2D, last: Indices1D, vector: Array1D) -> None:
    """Solve with the factor, in place."""
    for j in range(equations):
        own = j % TOGETHER
        value = vector[j] / band[j, own]
        vector[j] = value
        width = last[j] - j
        subtract_product(vector[j + 1 : j + 1 + width], value, band[j, own + 1 : own + width + 1])
    for j in range(equations - 1, -1, -1):
        own, width = j % TOGETHER, last[j] - j
        vector[j] = (
            without_products(
                vector[j], band[j, own + 1 : own + width + 1], vector[j + 1 : j + 1 + width]
            )
            / band[j, own]
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


@kernel
def keep_bounds(
    variables: Array1D, lower: Array1D, upper: Array1D, inverse_weights: Array1D, left: Flags1D
) -> None:
    """Put variables that have left their bounds on them, where they stay; ``left`` (1,) tells whether there are any."""
    left[0] = False
    for k in range(variables.shape[0]):
        limited = min(max(variables[k], lower[k]), upper[k])
        if limited != variables[k]:
            variables[k], inverse_weights[k], left[0] = limited, 0.0, True


@kernel
def hold_violated(
    values: Array1D, lower: Array1D, upper: Array1D, tolerance: float, held: Flags1D,
    place: Indices1D, count: Indices1D, vector: Array1D, violation: Array1D, touched: Flags1D,
) -> None:  # fmt: skip
    """Hold rows that are violated by more than the tolerance: ``place`` numbers those that are ``held``, (n_rows,) both, ``vector`` (``count``,) is what
    they miss. ``violation`` (1,) is the largest of all, and ``touched`` (1,) tells whether new ones are held.
    """
    number, most = 0, -math.inf
    touched[0] = False
    for k in range(values.shape[0]):
        below, above = lower[k] - values[k], values[k] - upper[k]
        violated = max(below, above)
        if not violated <= most and not math.isnan(most):  # a number that is none stays
            most = violated
        if violated > tolerance and not held[k]:
            held[k], touched[0] = True, True
        place[k] = number if held[k] else -1
        if held[k]:
            vector[number] = below if below > above else -above
            number += 1
    violation[0], count[0] = most, number
