"""What the formulations ``paper`` and ``srbm`` hand to the solver, and how they fill it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ..models.stance import Stance
from ..models.symbolic_model import SymbolicModel
from ..task.task import JumpTask
from .assembly import Assembly, Knot
from .one_flight import Grid
from .stage_functions import Piece


@dataclass(frozen=True)
class Program:
    """A problem ready to be solved: what ``solver.solve`` reads, on a fixed grid.

    Attributes:
        assembly: the problem's structure and functions.
        lower, upper: bounds of the variables.
        row_lower, row_upper: bounds of the constraint rows.
        parameters: their values.
        families: of every constraint row the name of what it asks for.
        guess: where the solver begins.
        grid: phases and times of the intervals; in flight by their mean where that is a variable.
        start, end: the stances.
    """

    task: JumpTask
    model: SymbolicModel
    assembly: Assembly
    lower: Array
    upper: Array
    row_lower: Array
    row_upper: Array
    parameters: Array
    families: list[str]
    guess: Array
    grid: Grid
    start: Stance
    end: Stance

    @property
    def knots(self) -> int:
        """The number of knots, one more than intervals."""
        return len(self.assembly.knots)

    def state(self, values: Array, k: int) -> Array:
        """The states of a knot."""
        start = self.assembly.state_start[k]
        return values[start : start + self.assembly.nx[k]]

    def control(self, values: Array, k: int) -> Array:
        """The controls of a knot."""
        start = self.assembly.control_start[k]
        return values[start : start + self.assembly.nu[k]]


class Filler:
    """An assembly's bounds, rows and parameters while they are written; nothing is bound at first."""

    def __init__(
        self,
        knots: Sequence[Knot],
        pieces: Mapping[str, Piece],
        sizes: Mapping[str, Mapping[str, int]],
    ) -> None:
        self.assembly = Assembly(knots, pieces)
        self.pieces, self.sizes = pieces, sizes
        variables, rows = self.assembly.variables, self.assembly.constraints
        self.lower, self.upper = np.full(variables, -np.inf), np.full(variables, np.inf)
        self.row_lower, self.row_upper = np.zeros(rows), np.zeros(rows)
        self.families = ["integration"] * rows
        self.parameters = np.zeros(self.assembly.parameters)
        self.guess = np.zeros(variables)

    def rows(self, name: str, k: int, families: list[tuple[str, int, float, float]]) -> None:
        """Families, numbers and bounds of a piece's kept rows on a knot, in order."""
        start, kept = self.assembly.rows_of(name, k)
        for family, count, low, high in families:
            self.families[start : start + count] = [family] * count
            self.row_lower[start : start + count] = low
            self.row_upper[start : start + count] = high
            start += count
        assert start == self.assembly.rows_of(name, k)[0] + len(kept)

    def set(self, name: str, k: int, **values: Any) -> None:
        """Parameters of a piece on a knot."""
        start = self.assembly.parameter_start[name, k]
        for key, size in self.sizes[name].items():
            self.parameters[start : start + size] = values[key]
            start += size

    def fix(self, k: int, family: str, values: Array | list[float]) -> None:
        """The values of a knot's fixed variables."""
        rows = self.assembly.fixed_rows(k)
        self.row_lower[rows] = self.row_upper[rows] = values
        for row in rows:
            self.families[row] = family

    def done(self, task: JumpTask, model: SymbolicModel, grid: Grid, start: Stance, end: Stance
             ) -> Program:  # fmt: skip
        """The program."""
        return Program(
            task, model, self.assembly, self.lower, self.upper, self.row_lower, self.row_upper,
            self.parameters, self.families, np.clip(self.guess, self.lower, self.upper), grid,
            start, end,
        )  # fmt: skip
