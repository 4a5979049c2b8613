"""Bodies that can exist, nearest to what a fit found.

A link's mass, first moments h and inertia I about its joint's frame belong to a body exactly if its pseudo-inertia

    [ tr(I)/2 E - I   h ]
    [ h'              m ]

is positive definite (Wensing, Kim and Slotine, 2018): this holds a positive mass, positive moments of inertia and the triangle
inequality among them. Friction and rotors are at least zero. Of all such values those are taken that are nearest to the fit's, by the
fit's covariance; what that does not tell stays near the description. It is a semidefinite program, solved by Clarabel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....mathematics.arrays import Array
from .dynamics_fit import DynamicsModel, FittedDynamics
from .identification import IdentificationError

DESCRIBED = 1e-4
"""Weight of the distance to the description, beside that to the fit: it decides only what the fit leaves open."""
OPEN = 1e-4
"""The least information of a direction, in that of what was known beforehand."""
LEAST = 1e-4
"""The smallest eigenvalue of a pseudo-inertia, in units of the link's described mass and size."""
NEAR = 2.0
"""Values that had to move by more standard deviations are reported."""
NOT_NEGATIVE = ("rotor inertia", "coulomb", "viscous", "load")


@dataclass(frozen=True)
class LinkInertia:
    """A link's ``mass`` [kg], ``com`` [m, link frame] and ``inertia`` about it [kg m^2]: xx, yy, zz, xy, xz, yz."""

    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class ConsistentDynamics:
    """The nearest values that bodies can have.

    Attributes:
        value: of all unknowns, in the fit's order.
        links: by name.
        moved: by the unknown's name, how far it had to move [standard deviations], where that is more than ``NEAR``.
    """

    value: Array
    links: dict[str, LinkInertia]
    moved: dict[str, float]


def consistent_dynamics(model: DynamicsModel, fit: FittedDynamics) -> ConsistentDynamics:
    """Return the values nearest to a fit that bodies can have.

    Raises:
        IdentificationError: the solver finds none.
    """
    import clarabel
    from scipy import linalg, sparse

    links, count = model.links, len(fit.value)
    described = links.described
    scales = _scales(described)
    width = len(described)
    base = model.part("base")
    others = [k for k in range(count) if not base.start <= k < base.stop]
    # variables: the links' parameters in units of their scales, then the other unknowns
    to_value = np.zeros((count, width + len(others)))
    to_value[base, :width] = links.lumped * scales
    to_value[others, range(width, width + len(others))] = 1.0
    covariance = _by_the_logs(model, fit) if model.first else fit.covariance
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    # where a log tells little of many links, rounding makes it indefinite
    least = 1e-9 - 2.0 * min(0.0, float(np.linalg.eigvalsh(correlation)[0]))
    spread = deviation[:, None] * np.linalg.cholesky(correlation + least * np.eye(count))
    # Steps from values with what was fitted, in its standard deviations and in what it leaves open: from zero, or in plain
    # numbers, the solver's tolerance is many deviations.
    home = np.concatenate([described / scales, fit.value[others]])
    back = np.linalg.pinv(to_value)
    start = home + back @ (fit.value - to_value @ home)
    steps = np.hstack([back @ spread, linalg.null_space(to_value)])
    quadratic = DESCRIBED * steps[:width].T @ steps[:width]
    quadratic[range(count), range(count)] += 1.0
    linear = DESCRIBED * steps[:width].T @ (start - home)[:width]
    blocks, right, cones = [], [], []
    for link in range(width // 10):
        block, side = _pseudo_rows(link, to_value.shape[1], scales)
        blocks.append(block)
        right.append(side)
        cones.append(clarabel.PSDTriangleConeT(4))
    positive = [k for kind in NOT_NEGATIVE for k in range(*model.part(kind).indices(count))]
    if positive:
        block = np.zeros((len(positive), to_value.shape[1]))
        for row, k in enumerate(positive):
            block[row, width + others.index(k)] = -1.0 / max(deviation[k], 1e-12)
        blocks.append(block)
        right.append(np.zeros(len(positive)))
        cones.append(clarabel.NonnegativeConeT(len(positive)))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    all_rows = np.vstack(blocks)
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(quadratic)), linear, sparse.csc_matrix(all_rows @ steps),
        np.concatenate(right) - all_rows @ start, cones, settings,
    )  # fmt: skip
    solution = solver.solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        raise IdentificationError(
            f"no bodies near to what was fitted were found (Clarabel: {solution.status})"
        )
    found = start + steps @ np.array(solution.x)
    value = to_value @ found
    value[model.part("load").start + model.without_load] = 0.0
    moved = np.abs(value - fit.value) / np.sqrt(np.diag(fit.covariance))
    return ConsistentDynamics(
        value,
        {name: _inertia(found[10 * k : 10 * k + 10] * scales[10 * k : 10 * k + 10])
         for k, name in enumerate(links.links)},
        {fit.unknowns.names[k]: float(moved[k]) for k in np.flatnonzero(moved > NEAR)},
    )  # fmt: skip


def _by_the_logs(model: DynamicsModel, fit: FittedDynamics) -> Array:
    """Return the covariance without what was known beforehand of the links: of a floating base's many links logs leave most open,
    and within a prior so wide bodies would be any."""
    prior = np.diag(fit.prior_std**2)
    part = model.part("base")
    prior[part, part] = model.base_prior
    root = np.linalg.cholesky(prior + 1e-12 * np.diag(fit.prior_std**2))
    half = np.linalg.solve(root, fit.covariance)
    shares, axes = np.linalg.eigh(np.linalg.solve(root, half.T))
    information = axes / np.maximum(shares, 1e-12) @ axes.T
    information[range(part.start, part.stop), range(part.start, part.stop)] -= 1.0
    told, axes = np.linalg.eigh(information)
    spread = root @ axes / np.sqrt(np.maximum(told, OPEN))
    return np.asarray(spread @ spread.T)


def _scales(described: Array) -> Array:
    """Return the size of each link's parameters: mass, mass times length, mass times length squared."""
    each = described.reshape(-1, 10)
    mass = np.maximum(each[:, 0], 1e-4)
    length = np.sqrt(np.maximum(each[:, [4, 6, 9]].sum(axis=1) / mass, 1e-6))
    powers = np.array([0, 1, 1, 1, *(2,) * 6])
    return np.asarray((mass[:, None] * length[:, None] ** powers).reshape(-1))


def _pseudo_rows(link: int, width: int, scales: Array) -> tuple[Array, Array]:
    """Return the rows by which a link's pseudo-inertia, in units of its scales, is in the cone: b - A x."""
    # In these units mass, moments and inertia are plain numbers, and so is the matrix.
    entries = np.zeros((4, 4, 10))
    for k, (row, column) in {
        4: (0, 0),
        5: (0, 1),
        6: (1, 1),
        7: (0, 2),
        8: (1, 2),
        9: (2, 2),
    }.items():
        entries[row, column, k] -= 1.0
        if row == column:
            for diagonal in range(3):
                entries[diagonal, diagonal, k] += 0.5
    for axis in range(3):
        entries[axis, 3, 1 + axis] = 1.0
    entries[3, 3, 0] = 1.0
    block, side = np.zeros((10, width)), np.zeros(10)
    place = 0
    for column in range(4):
        for row in range(column + 1):
            factor = 1.0 if row == column else np.sqrt(2.0)
            block[place, 10 * link : 10 * link + 10] = -factor * entries[row, column]
            side[place] = -LEAST if row == column else 0.0
            place += 1
    return block, side


def _inertia(parameters: Array) -> LinkInertia:
    mass = float(parameters[0])
    com = parameters[1:4] / mass
    xx, xy, yy, xz, yz, zz = parameters[4:].tolist()
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    tensor -= mass * (com @ com * np.eye(3) - np.outer(com, com))
    x, y, z = com.tolist()
    at = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()
    return LinkInertia(mass, (x, y, z), (at[0], at[1], at[2], at[3], at[4], at[5]))
