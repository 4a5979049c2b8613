"""Assembly of pieces on knots into one sparse problem in fatrop's order.

Variables are ordered knot by knot: state, then controls. Constraint rows are ordered knot by knot:
the gap to the next state (next state minus what this knot leads to), then the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...mathematics.arrays import Array, Indices
from .stage_functions import StageFunction


@dataclass
class Knot:
    """A knot of the problem: numbers of states and controls, and its pieces.

    A piece's ``take`` are the indices of its variables in the knot's (states, then controls) and
    ``rows`` those of its constraint rows that are kept after the gap rows. ``gap`` names the piece
    whose first rows are the gap, ``hold`` the index of a control that becomes the next knot's last
    state.
    """

    states: int
    controls: int
    pieces: dict[str, tuple[Indices, Indices]] = field(default_factory=dict)
    gap: str = ""
    hold: int | None = None
    fixed: tuple[int, ...] = ()


class Assembly:
    """The structure of the whole problem: where everything is in its vectors.

    Attributes:
        variables, constraints, parameters: the sizes.
        state_start, control_start: where a knot's states and controls begin among the variables.
        gap_start, row_start: where its gap rows and its other rows begin among the constraints;
            the kept rows of its pieces follow each other in the order of ``Knot.pieces``.
        parameter_start: (piece, knot) -> where the piece's parameters begin.
        users: by piece the knots that have it, of which the next ones have a row each:
        piece_columns, piece_rows: the indices of a piece's variables and of its rows, -1 for those left out.
        piece_parameters: by piece all of its parameters.
        linear_terms: rows, variables and signs of what the rows have beside the pieces.
    """

    def __init__(self, knots: Sequence[Knot], pieces: Mapping[str, StageFunction]) -> None:
        self.knots, self.pieces = list(knots), dict(pieces)
        self.nx = [knot.states for knot in knots]
        self.nu = [knot.controls for knot in knots]
        self.ng = [
            sum(len(rows) for _, rows in knot.pieces.values()) + len(knot.fixed) for knot in knots
        ]
        sizes = np.array(self.nx) + np.array(self.nu)
        self.state_start = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        self.control_start = self.state_start + np.array(self.nx)
        self.variables = int(sizes.sum())
        gaps = np.array([*self.nx[1:], 0])
        heights = gaps + np.array(self.ng)
        self.gap_start = np.concatenate([[0], np.cumsum(heights)[:-1]]).astype(np.int64)
        self.row_start = self.gap_start + gaps
        self.constraints = int(heights.sum())
        self.users: dict[str, list[int]] = {
            name: [k for k, knot in enumerate(knots) if name in knot.pieces] for name in pieces
        }
        self.users = {name: users for name, users in self.users.items() if users}
        self.parameter_start: dict[tuple[str, int], int] = {}
        self.piece_parameters: dict[str, slice] = {}
        self.parameters = 0
        for name, users in self.users.items():
            size = int(pieces[name].value.size1_in(1))
            self.piece_parameters[name] = slice(
                self.parameters, self.parameters + size * len(users)
            )
            for k in users:
                self.parameter_start[name, k] = self.parameters
                self.parameters += size
        self._place()

    @cached_property
    def signature(self) -> tuple[object, ...]:
        """Equal for problems of the same structure and functions."""
        shape = tuple(
            (
                knot.states, knot.controls, knot.gap, knot.hold, knot.fixed,
                tuple((name, tuple(take), tuple(rows))
                      for name, (take, rows) in knot.pieces.items()),
            )
            for knot in self.knots
        )  # fmt: skip
        return (shape, *(id(piece) for piece in self.pieces.values()))

    def rows_of(self, name: str, k: int) -> tuple[int, Indices]:
        """Return the place at which the kept rows of a piece on a knot begin, and which of its rows they are."""
        start = int(self.row_start[k])
        for other, (_, rows) in self.knots[k].pieces.items():
            if other == name:
                return start, rows
            start += len(rows)
        raise KeyError(name)

    def fixed_rows(self, k: int) -> Indices:
        """Return the rows of a knot's fixed variables."""
        end = int(self.row_start[k]) + self.ng[k]
        return np.arange(end - len(self.knots[k].fixed), end)

    def _place(self) -> None:
        """Compute the global indices of every piece's variables and rows; -1 for rows left out."""
        self.piece_columns: dict[str, Indices] = {}
        self.piece_rows: dict[str, Indices] = {}
        for name, users in self.users.items():
            count = self.pieces[name].rows
            columns, rows = [], np.full((len(users), count), -1, dtype=np.int64)
            for i, k in enumerate(users):
                take, kept = self.knots[k].pieces[name]
                columns.append(self.state_start[k] + take)
                if self.knots[k].gap == name:
                    gap = self.nx[k + 1] - (self.knots[k].hold is not None)
                    rows[i, :gap] = self.gap_start[k] + np.arange(gap)
                rows[i, kept] = self.rows_of(name, k)[0] + np.arange(len(kept))
            self.piece_columns[name], self.piece_rows[name] = np.array(columns), rows
        # next state: + in its gap row; a held control: - in the last gap row
        linear_rows, linear_columns, signs = [], [], []
        for k, knot in enumerate(self.knots):
            linear_rows += list(self.fixed_rows(k))
            linear_columns += list(self.state_start[k] + np.array(knot.fixed, dtype=np.int64))
            signs += [1.0] * len(knot.fixed)
            if k + 1 == len(self.knots):
                break
            size = self.nx[k + 1]
            linear_rows += list(self.gap_start[k] + np.arange(size))
            linear_columns += list(self.state_start[k + 1] + np.arange(size))
            signs += [1.0] * size
            if knot.hold is not None:
                linear_rows.append(self.gap_start[k] + size - 1)
                linear_columns.append(self.control_start[k] + knot.hold)
                signs.append(-1.0)
        self.linear_terms = (
            np.array(linear_rows, dtype=np.int64),
            np.array(linear_columns, dtype=np.int64),
            np.array(signs),
        )

    def row_sources(self) -> Indices:
        """Return by row its place among the rows of all pieces side by side; behind them is a zero."""
        index = np.concatenate([self.piece_rows[name].ravel() for name in self.users])
        source = np.full(self.constraints, len(index), dtype=np.int64)
        source[index[index >= 0]] = np.flatnonzero(index >= 0)
        return source

    def jacobian_pattern(self) -> tuple[Any, Indices]:
        """Return where the Jacobian has entries, and by entry its place among those of all pieces side by side; behind
        them are the signs of the linear terms.
        """
        rows, columns = [], []
        for name in self.users:
            triplets = self.pieces[name].jacobian.sparsity_out(1).get_triplet()
            local_rows, local_columns = (np.array(x, dtype=np.int64) for x in triplets)
            rows.append(self.piece_rows[name][:, local_rows].ravel())
            columns.append(self.piece_columns[name][:, local_columns].ravel())
        linear_rows, linear_columns, _ = self.linear_terms
        row = np.concatenate([*rows, linear_rows])
        column = np.concatenate([*columns, linear_columns])
        kept = row >= 0
        pattern = _sparse(row[kept], column[kept], (self.constraints, self.variables))
        source = np.empty(pattern.nnz(), dtype=np.int64)
        source[_positions(pattern, row[kept], column[kept])] = np.flatnonzero(kept)
        return pattern, source

    def hessian_pattern(self, upper: bool) -> tuple[Any, Indices, list[tuple[Indices, Indices]]]:
        """Return where the symmetric Hessian has entries, or its upper triangle; by entry the place of its first value among
        those of all pieces side by side; and then, until no value is left, the entries that have a further one, and its place.
        """
        rows, columns = [], []
        for name in self.users:
            triplets = self.pieces[name].hessian.sparsity_out(1).get_triplet()
            local_rows, local_columns = (np.array(x, dtype=np.int64) for x in triplets)
            rows.append(self.piece_columns[name][:, local_rows].ravel())
            columns.append(self.piece_columns[name][:, local_columns].ravel())
        row, column = np.concatenate(rows), np.concatenate(columns)
        source = np.flatnonzero(row <= column) if upper else np.arange(len(row))
        row, column = row[source], column[source]
        pattern = _sparse(row, column, (self.variables, self.variables))
        place = _positions(pattern, row, column)
        layers: list[tuple[Indices, Indices]] = []
        while len(place):
            entries, index = np.unique(place, return_index=True)
            layers.append((entries, source[index]))
            place, source = np.delete(place, index), np.delete(source, index)
        return pattern, layers[0][1], layers[1:]


def _sparse(rows: Indices, columns: Indices, shape: tuple[int, int]) -> Any:
    import casadi as ca

    # Sorted here: NumPy's ``unique`` hashes whole numbers first, which takes six times as long.
    order = np.sort(columns.astype(np.int64) * shape[0] + rows)
    order = order[np.concatenate([[True], order[1:] != order[:-1]])] if len(order) else order
    starts = np.searchsorted(order // shape[0], np.arange(shape[1] + 1))
    return ca.Sparsity(shape[0], shape[1], starts.tolist(), (order % shape[0]).tolist())


def _positions(pattern: Any, rows: Indices, columns: Indices) -> Indices:
    """Return the number of each entry among the pattern's non-zeros."""
    height = pattern.size1()
    own_rows, own_columns = (np.array(x, dtype=np.int64) for x in pattern.get_triplet())
    return np.asarray(np.searchsorted(own_columns * height + own_rows, columns * height + rows))


@dataclass(frozen=True)
class NonlinearProgram:
    """Nonlinear program of any formulation, as the solver takes it.

    Attributes:
        assembly: the structure and functions.
        lower, upper: bounds of the variables.
        row_lower, row_upper: bounds of the constraint rows.
        parameters: their values.
        families: of every constraint row the name of what it asks for.
    """

    assembly: Assembly
    lower: Array
    upper: Array
    row_lower: Array
    row_upper: Array
    parameters: Array
    families: list[str]

    @property
    def knots(self) -> int:
        """The number of knots, one more than intervals."""
        return len(self.assembly.knots)
