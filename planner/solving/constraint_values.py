"""Values of all constraint rows of a problem and their Jacobian, without CasADi.

The pieces of a problem are evaluated for all of their knots at once, and what they give is put where it
belongs. The values are the bits of ``Assembly.functions``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Indices
from ...mathematics.compiling.lanes import Lanes
from ..models.interpreted import InterpretedFunction
from ..problem.assembly import Assembly


class _Piece(NamedTuple):
    """A piece's function on its knots.

    Attributes:
        lanes: the function.
        columns: which variables it takes, by knot.
        parameters: which of all parameters are its own.
        found: the result that is needed.
    """

    lanes: Lanes
    columns: Indices
    parameters: slice
    found: Array


class ConstraintValues:
    """The constraint rows of problems of one structure, in memory that is kept.

    Attributes:
        starts, rows: where the Jacobian has entries: the columns' starts and the entries' rows.
        values: the rows' values at the variables of the last ``evaluate``.
        entries: the Jacobian's entries at those of the last ``differentiate``.
    """

    def __init__(self, assembly: Assembly) -> None:
        pattern, self._entry_sources = assembly.jacobian_pattern()
        self.starts = np.array(pattern.colind(), dtype=np.int64)
        self.rows = np.array(pattern.row(), dtype=np.int64)
        self._row_sources = assembly.row_sources()
        self._linear_rows, self._linear_columns, self._signs = assembly.linear_terms
        self.values, self.entries = np.zeros(assembly.constraints), np.zeros(pattern.nnz())
        self._of_rows = _pieces(assembly, "value")
        self._of_jacobian = _pieces(assembly, "jacobian")
        self._piece_rows = np.zeros(sum(each.found.size for each in self._of_rows) + 1)
        count = sum(each.found.size for each in self._of_jacobian)
        self._piece_entries = np.concatenate([np.zeros(count), self._signs])

    def set_parameters(self, parameters: Array) -> None:
        """Take a problem's parameters for what follows."""
        for piece in (*self._of_rows, *self._of_jacobian):
            own = piece.lanes.inputs[1]
            own[:] = parameters[piece.parameters].reshape(own.shape)

    def evaluate(self, variables: Array) -> None:
        """Compute the rows' values."""
        _evaluate(self._of_rows, variables, self._piece_rows)
        terms = self._signs * variables[self._linear_columns]
        linear = np.bincount(self._linear_rows, terms, len(self.values))
        np.add(self._piece_rows[self._row_sources], linear, out=self.values)

    def differentiate(self, variables: Array) -> None:
        """Compute the Jacobian's entries, which takes ten times as long."""
        _evaluate(self._of_jacobian, variables, self._piece_entries)
        np.take(self._piece_entries, self._entry_sources, out=self.entries, mode="clip")


def _evaluate(pieces: list[_Piece], variables: Array, found: Array) -> None:
    """Put what all pieces give side by side."""
    place = 0
    for piece in pieces:
        np.take(variables, piece.columns, out=piece.lanes.inputs[0], mode="clip")
        piece.lanes.run()
        found[place : place + piece.found.size] = piece.found.reshape(-1)
        place += piece.found.size


def _pieces(assembly: Assembly, kind: str) -> list[_Piece]:
    """Return all pieces' functions of a kind on their knots; of both kinds the second result is needed."""
    found = []
    for name, users in assembly.users.items():
        function: InterpretedFunction = getattr(assembly.pieces[name], kind)
        columns, parameters = assembly.piece_columns[name], assembly.piece_parameters[name]
        lanes = function.lanes(len(users))
        found.append(_Piece(lanes, columns, parameters, lanes.outputs[1]))
    return found
