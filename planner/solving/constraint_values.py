"""Values of all constraint rows of a problem and their Jacobian, without CasADi.

The pieces of a problem are evaluated for all of their knots at once, and what they give is put where it
belongs. The values are the bits of ``Assembly.functions``.
"""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.compiling.lanes import Lanes
from ..models.interpreted import InterpretedFunction
from ..problem.assembly import Assembly


class ConstraintValues:
    """The constraint rows of problems of one structure, in memory that is kept.

    Attributes:
        starts, rows: where the Jacobian has entries: the columns' starts and the entries' rows.
        values: the rows' values at the variables of the last ``evaluate``.
        entries: the Jacobian's entries at the variables of the last ``evaluate`` before ``differentiate``.
    """

    def __init__(self, assembly: Assembly) -> None:
        pattern, self._entry_sources = assembly.jacobian_pattern()
        self.starts = np.array(pattern.colind(), dtype=np.int64)
        self.rows = np.array(pattern.row(), dtype=np.int64)
        self._row_sources = assembly.row_sources()
        self._linear_rows, self._linear_columns, self._signs = assembly.linear_terms
        self.values, self.entries = np.zeros(assembly.constraints), np.zeros(pattern.nnz())
        # What all pieces take and give lies side by side.
        self._columns = np.concatenate(
            [assembly.piece_columns[name].ravel() for name in assembly.users]
        )
        self._variables = np.zeros(len(self._columns))
        self._parameters = np.zeros(assembly.parameters)
        self._of_rows, self._piece_rows = self._lanes(assembly, "value", np.zeros(1))
        self._of_jacobian, self._piece_entries = self._lanes(assembly, "jacobian", self._signs)

    def _lanes(self, assembly: Assembly, kind: str, behind: Array) -> tuple[list[Lanes], Array]:
        """Return all pieces' functions of a kind on their knots, and the second result of each of them, with what comes
        behind.
        """
        users = assembly.users
        functions: list[InterpretedFunction] = [getattr(assembly.pieces[n], kind) for n in users]
        sizes = [
            len(users[n]) * len(f.outputs[1].rows) for n, f in zip(users, functions, strict=True)
        ]
        found = np.concatenate([np.zeros(sum(sizes)), behind])
        *results, _ = np.split(found, np.cumsum(sizes))
        *given, _ = np.split(
            self._variables, np.cumsum([assembly.piece_columns[n].size for n in users])
        )
        return [
            Lanes(
                function.program, len(users[name]),
                (taken, self._parameters[assembly.piece_parameters[name]]),
                (len(function.outputs[0].rows), own),
            )
            for name, function, taken, own in zip(users, functions, given, results, strict=True)
        ], found  # fmt: skip

    def set_parameters(self, parameters: Array) -> None:
        """Take a problem's parameters for what follows."""
        self._parameters[:] = parameters

    def evaluate(self, variables: Array) -> None:
        """Compute the rows' values."""
        np.take(variables, self._columns, out=self._variables, mode="clip")
        for lanes in self._of_rows:
            lanes.run()
        terms = self._signs * variables[self._linear_columns]
        linear = np.bincount(self._linear_rows, terms, len(self.values))
        np.add(self._piece_rows[self._row_sources], linear, out=self.values)

    def differentiate(self) -> None:
        """Compute the Jacobian's entries where the values were computed, which takes ten times as long."""
        for lanes in self._of_jacobian:
            lanes.run()
        np.take(self._piece_entries, self._entry_sources, out=self.entries, mode="clip")
