"""Assembly of pieces on knots into one sparse problem in fatrop's order.

Variables are ordered knot by knot: state, then controls. Constraint rows are ordered knot by knot:
the gap to the next state (next state minus what this knot leads to), then the rest. The functions
of the whole problem are CasADi graphs that call the pieces' functions and gather their non-zeros,
so nothing is differentiated here.
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
    """The functions of the whole problem, and where everything is in its vectors.

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

    # The functions of the whole problem

    def functions(self, *, upper: bool = True) -> dict[str, Any]:
        """Return ``f``, ``g`` (symbols and expressions in a dict for nlpsol) and the derivative functions ``nlp_f``,
        ``nlp_g``, ``nlp_grad_f``, ``nlp_jac_g``, ``nlp_hess_l`` with the signatures nlpsol's own would have; with
        ``upper`` also ``hess_lag``, the upper triangle of the Hessian alone.
        """
        import casadi as ca

        x, p = ca.MX.sym("x", self.variables), ca.MX.sym("p", self.parameters)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.constraints)
        cost: Any = ca.MX(0)
        value_rows, gradient, hessian_values, slopes = [], [], [], []
        jacobian_cost_rows: list[Indices] = []
        padded = ca.vertcat(lam_g, 0.0)
        for name, users in self.users.items():
            piece, count = self.pieces[name], len(users)
            z = _gather(x, self.piece_columns[name].ravel(), (-1, count))
            w = ca.reshape(p[self.piece_parameters[name]], -1, count)
            costs, rows = piece.value.map(count)(z, w)
            cost = cost + ca.sum2(costs)
            value_rows.append(ca.vec(rows))
            gradient.append(ca.vec(piece.gradient.map(count)(z, w)))
            jacobian_cost_rows.append(self.piece_columns[name].ravel())
            index = np.where(self.piece_rows[name] < 0, self.constraints, self.piece_rows[name])
            multipliers = _gather(padded, index.ravel(), (-1, count))
            slope, hessian = piece.hessian.map(count)(z, w, ca.repmat(lam_f, 1, count), multipliers)
            slopes.append(ca.vec(slope))
            hessian_values.append(_nonzeros(hessian))
        g = self._sum_rows(x, value_rows)
        columns = np.concatenate(jacobian_cost_rows)
        grad = _scatter(ca.vertcat(*gradient), columns, self.variables)
        whole, *triangle = self._hessian(hessian_values, upper)
        linear_rows, linear_columns, signs = self.linear_terms
        pushed = _gather(lam_g, linear_rows, (-1, 1)) * ca.DM(signs)
        slope = _scatter(
            ca.vertcat(*slopes, pushed), np.concatenate([columns, linear_columns]), self.variables
        )
        names = ["x", "p"]
        lagrangian = ["x", "p", "lam_f", "lam_g"]
        found = {
            "x": x, "p": p, "f": cost, "g": g,
            "nlp_f": ca.Function("nlp_f", [x, p], [cost], names, ["f"]),
            "nlp_g": ca.Function("nlp_g", [x, p], [g], names, ["g"]),
            "nlp_grad_f": ca.Function("nlp_grad_f", [x, p], [grad], names, ["grad_f_x"]),
            "grad_f": ca.Function("nlp_grad_f", [x, p], [cost, grad], names, ["f", "grad_f_x"]),
            "nlp_jac_g": self.jacobian(),
            "nlp_hess_l": ca.Function(
                "nlp_hess_l", [x, p, lam_f, lam_g], [slope, whole], lagrangian,
                ["grad_gamma_x", "hess_gamma_x_x"]),
            # nlpsol evaluates this once after fatrop ends; nobody reads its gradients.
            "nlp_grad": ca.Function(
                "nlp_grad", [x, p, lam_f, lam_g],
                [cost, g, ca.MX.zeros(self.variables), ca.MX.zeros(self.parameters)], lagrangian,
                ["f", "g", "grad_gamma_x", "grad_gamma_p"]),
        }  # fmt: skip
        if triangle:
            found["hess_lag"] = ca.Function(
                "nlp_hess_l", [x, p, lam_f, lam_g], triangle, lagrangian, ["triu_hess_gamma_x_x"]
            )
        return found

    def jacobian(self) -> Any:
        """Return the function ``nlp_jac_g`` alone."""
        import casadi as ca

        x, p = ca.MX.sym("x", self.variables), ca.MX.sym("p", self.parameters)
        rows, values = [], []
        for name, users in self.users.items():
            z = _gather(x, self.piece_columns[name].ravel(), (-1, len(users)))
            w = ca.reshape(p[self.piece_parameters[name]], -1, len(users))
            found, jacobian = self.pieces[name].jacobian.map(len(users))(z, w)
            rows.append(ca.vec(found))
            values.append(_nonzeros(jacobian))
        matrix = self._jacobian(values)
        return ca.Function("nlp_jac_g", [x, p], [self._sum_rows(x, rows), matrix],
                           ["x", "p"], ["g", "jac_g_x"])  # fmt: skip

    def row_sources(self) -> Indices:
        """Return by row its place among the rows of all pieces side by side; behind them is a zero."""
        index = np.concatenate([self.piece_rows[name].ravel() for name in self.users])
        source = np.full(self.constraints, len(index), dtype=np.int64)
        source[index[index >= 0]] = np.flatnonzero(index >= 0)
        return source

    def _sum_rows(self, x: Any, rows: list[Any]) -> Any:
        import casadi as ca

        linear_rows, linear_columns, signs = self.linear_terms
        sums = _gather(ca.vertcat(*rows, 0.0), self.row_sources(), (-1, 1))
        matrix = _sparse(linear_rows, linear_columns, (self.constraints, self.variables))
        order = _positions(matrix, linear_rows, linear_columns)
        values = np.zeros(len(signs))
        values[order] = signs
        return sums + ca.mtimes(ca.DM(matrix, values), x)

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

    def _jacobian(self, values: list[Any]) -> Any:
        import casadi as ca

        pattern, source = self.jacobian_pattern()
        everything = ca.vertcat(*values, ca.DM(self.linear_terms[2]))
        return ca.MX(pattern, _gather(everything, source, (-1, 1)))

    def _hessian(self, values: list[Any], upper: bool) -> list[Any]:
        """Return the whole symmetric matrix, and its upper triangle if ``upper`` is set."""
        import casadi as ca

        rows, columns = [], []
        for name in self.users:
            triplets = self.pieces[name].hessian.sparsity_out(1).get_triplet()
            local_rows, local_columns = (np.array(x, dtype=np.int64) for x in triplets)
            rows.append(self.piece_columns[name][:, local_rows].ravel())
            columns.append(self.piece_columns[name][:, local_columns].ravel())
        row, column = np.concatenate(rows), np.concatenate(columns)
        everything = ca.vertcat(*values, 0.0)
        found = []
        for kept in (np.full(len(row), True), row <= column)[: 1 + upper]:
            pattern = _sparse(row[kept], column[kept], (self.variables, self.variables))
            place = _positions(pattern, row[kept], column[kept])
            source = np.flatnonzero(kept)
            layers = _layers(place, source, pattern.nnz(), len(row))
            total: Any = _gather(everything, layers[0], (-1, 1))
            for entries, index in layers[1:]:
                total = total + _scatter(
                    _gather(everything, index, (-1, 1)), entries, pattern.nnz()
                )
            found.append(ca.MX(pattern, total))
        return found


def _layers(place: Indices, source: Indices, size: int, empty: int) -> list[Any]:
    """Return sums of several values an entry as gathers: the first value of every entry, then the entries and values
    that are still left over, until none is.
    """
    first = np.full(size, empty, dtype=np.int64)
    layers: list[Any] = [first]
    while len(place):
        entries, index = np.unique(place, return_index=True)
        if len(layers) == 1 and layers[0] is first and np.all(first == empty):
            first[entries] = source[index]
        else:
            layers.append((entries, source[index]))
        left = np.ones(len(place), dtype=bool)
        left[index] = False
        place, source = place[left], source[left]
    return layers


def _gather(vector: Any, index: Indices, shape: tuple[int, int]) -> Any:
    """Return those entries of a dense vector."""
    import casadi as ca

    return ca.reshape(vector.nz[index.tolist()], *shape) if len(index) else ca.MX(0, 1)


def _scatter(values: Any, index: Indices, size: int) -> Any:
    """Return a dense vector with the values added up at their entries."""
    import casadi as ca

    columns = np.arange(len(index))
    matrix = ca.DM(_sparse(index, columns, (size, len(index))), 1.0)
    return ca.densify(ca.mtimes(matrix, values))


def _nonzeros(matrix: Any) -> Any:
    """Return the non-zeros as a dense column."""
    import casadi as ca

    return matrix.nz[:] if matrix.nnz() else ca.MX(0, 1)


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
