"""A dual active-set method for small dense quadratic programs (Goldfarb and Idnani, 1983).

    minimise    1/2 x' P x + q' x
    subject to  G x <= h

P is symmetric positive definite. The method starts at the minimum without constraints and adds the
most violated one, until none is violated; the multipliers stay nonnegative throughout. It starts
cold, so the answer is a function of the program alone, and it is exact up to rounding: the answer
is the minimum over the constraints that are active at the end.

References: D. Goldfarb, A. Idnani, "A numerically stable dual method for solving strictly convex
quadratic programs", Mathematical Programming 27, 1983.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .arrays import Array1D, Array2D, Flags1D, Indices1D
from .kernel import kernel

INFEASIBLE = -1
"""Return code: no x fulfils the constraints."""
NOT_CONVEX = -2
"""P is not positive definite, or a number is not finite."""
TOO_LONG = -3
"""Rounding errors have let the method go round in circles."""

_DEPENDENT = 1e-10
"""A constraint whose normal has less than this share outside the active ones depends on them."""
_FEASIBLE = 1e-10
"""A constraint is violated by more than this, times its own size."""


class QuadraticProgram(NamedTuple):
    """The program's data: P (n, n), q (n,), G (m, n), h (m,), in arrays that may be larger."""

    hessian: Array2D
    gradient: Array1D
    matrix: Array2D
    bound: Array1D


class ActiveSetMemory(NamedTuple):
    """Memory for intermediate results, for up to n unknowns and m constraints.

    ``inverse`` (n, n) holds J with J J' = P^-1 and, for the active constraints' normals N,
    J' N = [R; 0]; ``triangle`` (n, n) holds R. ``multipliers`` (n + 1,) belong to the ``active``
    (n,) constraints, of which ``is_active`` (m,) has the flags. ``along`` (n,) is J' times the new
    normal, ``step`` (n,) the direction for x, ``exchange`` (n,) that of the multipliers, ``size``
    (m,) the norms of the rows of G.
    """

    inverse: Array2D
    triangle: Array2D
    multipliers: Array1D
    along: Array1D
    step: Array1D
    exchange: Array1D
    size: Array1D
    active: Indices1D
    is_active: Flags1D


def active_set_memory(n: int, m: int) -> ActiveSetMemory:
    """Zero memory for up to n unknowns and m constraints."""
    return ActiveSetMemory(
        np.zeros((n, n)), np.zeros((n, n)), np.zeros(n + 1), np.zeros(n), np.zeros(n),
        np.zeros(n), np.zeros(m), np.zeros(n, dtype=np.int64), np.zeros(m, dtype=np.bool_),
    )  # fmt: skip


@kernel
def solve_program(
    n: int, m: int, program: QuadraticProgram, memory: ActiveSetMemory, x: Array1D
) -> int:
    """Write the solution (n,) to ``x``.

    Args:
        n, m: the numbers of unknowns and constraints in use.

    Returns:
        The number of constraints that were added, or one of the negative codes above; then ``x`` is
        of no use.
    """
    if not start_unconstrained(n, program, memory, x):
        return NOT_CONVEX
    for i in range(m):
        square = 0.0
        for k in range(n):
            square += program.matrix[i, k] * program.matrix[i, k]
        memory.size[i] = math.sqrt(square)
    memory.is_active[:] = False
    return int(fulfil(n, m, 0, program, memory, x)[0])


@kernel
def fulfil(
    n: int, m: int, count: int, program: QuadraticProgram, memory: ActiveSetMemory, x: Array1D
) -> tuple[int, int]:
    """Add violated constraints to the ``count`` active ones until x fulfils all.

    Constraints that have been added to the program, or changed while they were not active, since the
    last call only need their ``memory.size``: with them x is the start of the next search.

    Returns:
        What ``solve_program`` returns, and the number of active constraints.
    """
    limit = 10 * (n + m)
    for added in range(limit):
        new = most_violated(n, m, program, memory, x)
        if new < 0:
            return added, count
        price = 0.0
        excess = violation(n, program, new, x)
        for _ in range(limit):
            blocking, dual, primal = find_step(n, count, new, excess, program, memory)
            if dual < 0.0 and primal < 0.0:
                return INFEASIBLE, count
            full = dual < 0.0 or 0.0 <= primal <= dual
            length = primal if full else dual
            for j in range(count):
                memory.multipliers[j] -= length * memory.exchange[j]
            price += length
            if primal >= 0.0:
                for i in range(n):
                    x[i] += length * memory.step[i]
            if full:
                memory.multipliers[count] = price
                add_constraint(n, count, new, memory)
                count += 1
                break
            count = drop_constraint(n, count, blocking, memory)
            excess = violation(n, program, new, x)
        else:
            return TOO_LONG, count
    return TOO_LONG, count


@kernel
def start_unconstrained(
    n: int, program: QuadraticProgram, memory: ActiveSetMemory, x: Array1D
) -> bool:
    """Compute the minimum without constraints, and J = L^-T of the Cholesky factor P = L L'.

    Returns whether P is positive definite.
    """
    lower, inverse = memory.triangle, memory.inverse
    for j in range(n):
        pivot = program.hessian[j, j]
        for k in range(j):
            pivot -= lower[j, k] * lower[j, k]
        if not 0.0 < pivot < math.inf:
            return False
        root = math.sqrt(pivot)
        lower[j, j] = root
        for i in range(j + 1, n):
            total = program.hessian[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = total / root
    for j in range(n):  # column j of L^-1 is row j of J's transpose
        for i in range(n):
            inverse[j, i] = 0.0
        inverse[j, j] = 1.0 / lower[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= lower[i, k] * inverse[j, k]
            inverse[j, i] = total / lower[i, i]
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += inverse[k, i] * program.gradient[k]
        memory.along[i] = total
    for i in range(n):
        total = 0.0
        for k in range(n):
            total -= inverse[i, k] * memory.along[k]
        x[i] = total
        if not abs(total) < math.inf:
            return False
    return True


@kernel
def polish(n: int, gradient: Array1D, memory: ActiveSetMemory, x: Array1D) -> None:
    """Improve a solution by one Newton step along the active constraints.

    This corrects the rounding errors of P and q where the caller knows the gradient more exactly
    than P x + q.

    Args:
        gradient: of the cost at x, (n,).
        memory: as ``solve_program`` has left it.
    """
    count = 0
    for i in range(memory.is_active.shape[0]):
        count += 1 if memory.is_active[i] else 0
    for j in range(count, n):
        value = 0.0
        for k in range(n):
            value += memory.inverse[k, j] * gradient[k]
        memory.along[j] = value
    for i in range(n):
        value = 0.0
        for j in range(count, n):
            value += memory.inverse[i, j] * memory.along[j]
        x[i] = x[i] - value


@kernel
def recompute_multipliers(n: int, count: int, gradient: Array1D, memory: ActiveSetMemory) -> None:
    """Compute the multipliers of the ``count`` active constraints from the gradient at the solution.

    They are as exact as the gradient is, so more so than those of the search where P has lost digits.

    Args:
        gradient: of the cost at the solution, (n,).
        memory: as ``solve_program`` has left it.
    """
    for j in range(count - 1, -1, -1):
        value = 0.0
        for k in range(n):
            value += memory.inverse[k, j] * gradient[k]
        for k in range(j + 1, count):
            value -= memory.triangle[j, k] * memory.multipliers[k]
        memory.multipliers[j] = value / memory.triangle[j, j]


@kernel
def violation(n: int, program: QuadraticProgram, row: int, x: Array1D) -> float:
    """Compute the violation of a constraint by x; negative where x fulfils it."""
    total: float = -program.bound[row]
    for k in range(n):
        total += program.matrix[row, k] * x[k]
    return total


@kernel
def most_violated(
    n: int, m: int, program: QuadraticProgram, memory: ActiveSetMemory, x: Array1D
) -> int:
    """Return the constraint that x violates by the longest distance; -1 where it violates none."""
    found, largest = -1, 0.0
    for i in range(m):
        if memory.is_active[i]:
            continue
        size = memory.size[i]
        excess = violation(n, program, i, x)
        if excess <= _FEASIBLE * (size + abs(program.bound[i])):
            continue
        distance = excess / size if size > 0.0 else math.inf
        if distance > largest:
            found, largest = i, distance
    return found


@kernel
def find_step(
    n: int, count: int, new: int, excess: float, program: QuadraticProgram, memory: ActiveSetMemory
) -> tuple[int, float, float]:
    """Find the directions towards a new constraint, and how far they may be followed.

    Args:
        count: the number of active constraints.
        new: the constraint that is to become active; x violates it by ``excess``.

    Returns:
        The active constraint (its place in the list) whose multiplier becomes zero first, the step
        after which it does, and the step after which the new constraint is fulfilled. A step is -1
        where there is none.
    """
    inverse, along = memory.inverse, memory.along
    total, free = 0.0, 0.0
    for j in range(n):
        value = 0.0
        for k in range(n):
            value -= inverse[k, j] * program.matrix[new, k]
        along[j] = value
        total += value * value
        if j >= count:
            free += value * value
    for i in range(n):
        value = 0.0
        for j in range(count, n):
            value += inverse[i, j] * along[j]
        memory.step[i] = value
    for j in range(count - 1, -1, -1):
        value = along[j]
        for k in range(j + 1, count):
            value -= memory.triangle[j, k] * memory.exchange[k]
        memory.exchange[j] = value / memory.triangle[j, j]
    blocking, dual = -1, -1.0
    for j in range(count):
        rate = memory.exchange[j]
        if rate > 0.0:
            length = max(memory.multipliers[j], 0.0) / rate
            if blocking < 0 or length < dual:
                blocking, dual = j, length
    primal = excess / free if free > _DEPENDENT * _DEPENDENT * total else -1.0
    return blocking, dual, primal


@kernel
def add_constraint(n: int, count: int, new: int, memory: ActiveSetMemory) -> None:
    """Make a constraint active: rotate J so that its normal's image ends at element ``count``."""
    along, inverse = memory.along, memory.inverse
    for j in range(n - 1, count, -1):
        a, b = along[j - 1], along[j]
        if b == 0.0:
            continue
        size = math.sqrt(a * a + b * b)
        cosine, sine = a / size, b / size
        along[j - 1], along[j] = size, 0.0
        for i in range(n):
            a, b = inverse[i, j - 1], inverse[i, j]
            inverse[i, j - 1] = cosine * a + sine * b
            inverse[i, j] = cosine * b - sine * a
    for j in range(count + 1):
        memory.triangle[j, count] = along[j]
    memory.active[count] = new
    memory.is_active[new] = True


@kernel
def drop_constraint(n: int, count: int, place: int, memory: ActiveSetMemory) -> int:
    """Remove the active constraint at ``place``; returns how many remain."""
    triangle, inverse = memory.triangle, memory.inverse
    memory.is_active[memory.active[place]] = False
    for j in range(place + 1, count):
        memory.active[j - 1] = memory.active[j]
        memory.multipliers[j - 1] = memory.multipliers[j]
        for i in range(j + 1):
            triangle[i, j - 1] = triangle[i, j]
    count -= 1
    for j in range(place, count):  # each column has one element too many below the diagonal
        a, b = triangle[j, j], triangle[j + 1, j]
        if b == 0.0:
            continue
        size = math.sqrt(a * a + b * b)
        cosine, sine = a / size, b / size
        triangle[j, j], triangle[j + 1, j] = size, 0.0
        for k in range(j + 1, count):
            a, b = triangle[j, k], triangle[j + 1, k]
            triangle[j, k] = cosine * a + sine * b
            triangle[j + 1, k] = cosine * b - sine * a
        for i in range(n):
            a, b = inverse[i, j], inverse[i, j + 1]
            inverse[i, j] = cosine * a + sine * b
            inverse[i, j + 1] = cosine * b - sine * a
    return count
