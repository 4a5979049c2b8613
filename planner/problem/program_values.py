"""Cost, constraint rows and derivatives of a whole problem.

The pieces of a problem are evaluated for all of their knots at once, and what they give is put where it belongs, so
nothing is differentiated here. Where several values meet they are added in the order of the pieces and their knots.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Indices
from ...mathematics.compiling.lanes import Lanes
from ..models.interpreted import InterpretedFunction
from .assembly import Assembly


class _Evaluated(NamedTuple):
    """One function of all pieces on their knots. Of each of its results the entries of all pieces lie side by side, with
    room for others behind them.
    """

    lanes: list[Lanes]
    results: list[Array]

    def run(self) -> list[Array]:
        """Return the results, in the same memory every time."""
        for each in self.lanes:
            each.run()
        return self.results


class ProgramValues:
    """The functions of problems of one structure, in memory that is kept.

    Args:
        assembly: the structure and the pieces' functions.

    Attributes:
        starts, rows: where the Jacobian has entries: the columns' starts and the entries' rows.
        values: (m,), the rows' values at the variables of the last ``evaluate``.
        entries: (k,), the Jacobian's entries at the variables of the last ``evaluate`` before ``differentiate``.
    """

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        users, columns, rows = assembly.users, assembly.piece_columns, assembly.piece_rows
        pattern, self._entry_sources = assembly.jacobian_pattern()
        self.starts = np.array(pattern.colind(), dtype=np.int64)
        self.rows = np.array(pattern.row(), dtype=np.int64)
        self._row_sources = assembly.row_sources()
        self._linear_rows, self._linear_columns, self._signs = assembly.linear_terms
        self.values, self.entries = np.zeros(assembly.constraints), np.zeros(pattern.nnz())
        # What all pieces take and give lies side by side.
        self._columns = np.concatenate([columns[name].ravel() for name in users])
        self._rows = np.concatenate([rows[name].ravel() for name in users])
        self._variables, self._multipliers = np.zeros(len(self._columns)), np.zeros(len(self._rows))
        self._parameters = np.zeros(assembly.parameters)
        self._factors = np.zeros(sum(map(len, users.values())))
        self._given = {
            name: (
                variables,
                self._parameters[assembly.piece_parameters[name]],
                factors,
                multipliers,
            )
            for name, variables, factors, multipliers in zip(
                users,
                _parts(self._variables, [columns[name].size for name in users]),
                _parts(self._factors, [len(each) for each in users.values()]),
                _parts(self._multipliers, [rows[name].size for name in users]),
                strict=True,
            )
        }

    def _evaluated(self, kind: str, *behind: Array) -> _Evaluated:
        """Return the pieces' functions of a kind, and for each of their results what comes behind the entries."""
        counts = [len(users) for users in self._assembly.users.values()]
        functions: list[InterpretedFunction] = [
            getattr(self._assembly.pieces[name], kind) for name in self._given
        ]
        results, found = [], []
        for number, more in enumerate(behind):
            sizes = [
                count * len(function.outputs[number].rows)
                for count, function in zip(counts, functions, strict=True)
            ]
            results.append(np.concatenate([np.zeros(sum(sizes)), more]))
            found.append(_parts(results[-1], sizes))
        lanes = [
            function.lanes(count, given[: function.n_in()], own)
            for function, count, given, *own in zip(
                functions, counts, self._given.values(), *found, strict=True
            )
        ]
        return _Evaluated(lanes, results)

    @cached_property
    def _of_values(self) -> _Evaluated:
        return self._evaluated("value", np.zeros(0), np.zeros(1))

    @cached_property
    def _of_gradient(self) -> _Evaluated:
        return self._evaluated("gradient", np.zeros(0))

    @cached_property
    def _of_jacobian(self) -> _Evaluated:
        return self._evaluated("jacobian", np.zeros(0), self._signs)

    @cached_property
    def _of_hessian(self) -> _Evaluated:
        return self._evaluated("hessian", self._signs, np.zeros(0))

    def _set(self, variables: Array, parameters: Array) -> None:
        np.take(variables, self._columns, out=self._variables, mode="clip")
        self._parameters[:] = parameters

    def evaluate(self, variables: Array, parameters: Array) -> None:
        """Compute the rows' values, and the cost of each piece."""
        self._set(variables, parameters)
        of_pieces = self._of_values.run()[1]
        terms = self._signs * variables[self._linear_columns]
        linear = np.bincount(self._linear_rows, terms, len(self.values))
        np.add(of_pieces[self._row_sources], linear, out=self.values)

    def cost(self) -> Array:
        """Return the cost at the variables of the last ``evaluate``, (1,)."""
        sums = [np.add.accumulate(each.outputs[0].ravel())[-1] for each in self._of_values.lanes]
        return np.add.accumulate(sums)[-1:]

    def differentiate(self) -> None:
        """Compute the Jacobian's entries where the values were computed, which takes ten times as long."""
        entries = self._of_jacobian.run()[1]
        np.take(entries, self._entry_sources, out=self.entries, mode="clip")

    def jacobian(self, variables: Array, parameters: Array) -> None:
        """Compute the Jacobian's entries."""
        self._set(variables, parameters)
        self.differentiate()

    def gradient(self, variables: Array, parameters: Array) -> Array:
        """Return the cost's gradient, (n,)."""
        self._set(variables, parameters)
        (slopes,) = self._of_gradient.run()
        return self._summed(self._columns, slopes)

    def hessian(
        self, variables: Array, parameters: Array, factor: Array, multipliers: Array
    ) -> Array:
        """Return the entries of all pieces' Hessians side by side, of the cost times ``factor`` (1,) and the rows times
        their ``multipliers`` (m,).
        """
        self._set(variables, parameters)
        self._factors[:] = factor
        # Rows left out, of which the index is -1, have the multiplier zero.
        np.take(np.append(multipliers, 0.0), self._rows, out=self._multipliers, mode="wrap")
        return self._of_hessian.run()[1]

    def slope(self, multipliers: Array) -> Array:
        """Return the gradient (n,) of what the last ``hessian`` was of."""
        slopes = self._of_hessian.results[0]
        slopes[len(self._columns) :] = multipliers[self._linear_rows] * self._signs
        columns = np.concatenate([self._columns, self._linear_columns])
        return self._summed(columns, slopes)

    def _summed(self, columns: Indices, slopes: Array) -> Array:
        return np.asarray(np.bincount(columns, slopes, self._assembly.variables), np.float64)


def _parts(whole: Array, sizes: list[int]) -> list[Array]:
    """Return views of so many entries that follow each other."""
    return np.split(whole, np.cumsum(sizes))[: len(sizes)]
