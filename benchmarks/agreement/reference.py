"""The minimum of a whole-body program, proved: its conditions of optimality hold in extended precision.

A solver only proposes which constraints are active. Newton's method solves the conditions of optimality for
these, with residuals in extended precision; then all conditions are checked. A convex program has one minimum
where they hold, so it does not matter who has proposed it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...blocks.control.whole_body_program import WholeBodyProgram, rows_without_pyramids
from ...mathematics.arrays import Array, Flags, Indices

Long = NDArray[np.longdouble]

NEWTON_STEPS = 12
FEASIBLE = 1e-8
"""By how much a constraint may be violated [N, N m], and a multiplier be negative, times ``size``."""
INSIDE, EDGE, APEX = 0, 1, 2
"""Where in its cone a force is."""


class Proposal(NamedTuple):
    """What may hold at the minimum: a solution x, the active inequalities, and where in its cone each
    force is. Without ``places`` friction is among the inequalities."""

    x: Array
    active: Flags
    places: Indices


def proved_minimum(program: WholeBodyProgram, proposal: Proposal, friction: float) -> Array | None:
    """The minimiser, or ``None`` if the proposal is not right.

    Args:
        friction: of the round cones, if the proposal has any.
    """
    (p, q), (a, b), (g, h) = program.cost, program.equality, program.inequality
    places, n = proposal.places, len(q)
    if len(places):
        kept = rows_without_pyramids(len(places), len(h))
        g, h = g[kept], h[kept]
    first = n - 3 * len(places)
    held = [first + 3 * j + k for j in np.flatnonzero(places == APEX) for k in range(3)]
    edges = [first + 3 * int(j) for j in np.flatnonzero(places == EDGE)]
    lines = np.vstack((a, g[proposal.active], np.eye(n)[held])).astype(np.longdouble)
    right = np.hstack((b, h[proposal.active], np.zeros(len(held)))).astype(np.longdouble)
    m, k = len(lines), len(edges)
    hessian, gradient = p.astype(np.longdouble), q.astype(np.longdouble)
    x, y, v = (
        proposal.x.astype(np.longdouble),
        np.zeros(m, np.longdouble),
        np.zeros(k, np.longdouble),
    )
    for step in range(NEWTON_STEPS):
        normals, bends = _normals(x, edges, friction, v)
        matrix = np.zeros((n + m + k, n + m + k))
        matrix[:n, :n] = p + bends
        sides = np.vstack((lines.astype(np.float64), normals.astype(np.float64)))
        matrix[:n, n:], matrix[n:, :n] = sides.T, sides
        outside = np.array(
            [np.hypot(x[i], x[i + 1]) - np.longdouble(friction) * x[i + 2] for i in edges],
            np.longdouble,
        )
        residual = np.hstack(
            (hessian @ x + gradient + lines.T @ y + normals.T @ v, lines @ x - right, outside)
        )
        try:
            change = np.linalg.solve(matrix, residual.astype(np.float64))
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(change).all():
            return None
        x, y, v = x - change[:n], y - change[n : n + m], v - change[n + m :]
        if step > 2 and np.abs(change[:n]).max() < 1e-13 * (1.0 + float(np.abs(x).max())):
            break
    size = 1.0 + float(np.abs(q).max())
    prices = y[len(b) : len(b) + int(proposal.active.sum())].astype(np.float64)
    answer = x.astype(np.float64)
    normals, _ = _normals(x, edges, friction, v)
    slope = hessian @ x + gradient + lines.T @ y + normals.T @ v
    fine = (
        float(np.abs(slope).max()) < 1e-9 * size
        and float((g @ answer - h).max(initial=-1.0)) < FEASIBLE
        and float(prices.min(initial=0.0)) > -FEASIBLE * size
        and float(v.min(initial=0.0)) > -FEASIBLE * size
        and all(
            np.hypot(*answer[i : i + 2]) - friction * answer[i + 2] < FEASIBLE
            for i in range(first, n, 3)
            if len(places)
        )
    )
    pushes = y[m - len(held) :].astype(np.float64).reshape(-1, 3)
    fine = fine and all(friction * np.hypot(s[0], s[1]) + s[2] < FEASIBLE * size for s in pushes)
    return answer if fine else None


def _normals(x: Long, edges: list[int], friction: float, multipliers: Long) -> tuple[Long, Array]:
    """The gradients of |f_t| - mu f_z of the forces at their cones' edges, and their curvature."""
    normals, bends = np.zeros((len(edges), len(x)), np.longdouble), np.zeros((len(x), len(x)))
    for row, i in enumerate(edges):
        size = np.hypot(x[i], x[i + 1])
        u = x[i : i + 2] / size if size > 0.0 else np.zeros(2, np.longdouble)
        normals[row, i : i + 2], normals[row, i + 2] = u, -friction
        across = np.array([-u[1], u[0]], np.float64)
        share = float(multipliers[row] / size) if size > 0.0 else 0.0
        bends[i : i + 2, i : i + 2] = share * np.outer(across, across)
    return normals, bends
