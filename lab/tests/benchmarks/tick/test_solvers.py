"""The benchmark of the solvers that ``wbc.solver`` takes."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.lab.benchmarks.tick import solvers
from aloft.lab.benchmarks.tick.controller import record_jump
from aloft.mathematics.quadratic_program import PACKAGES


@pytest.mark.long
def test_every_tested_solver_has_a_row_beside_the_own_one(monkeypatch: pytest.MonkeyPatch) -> None:
    found = solvers.find_spec
    monkeypatch.setattr(solvers, "find_spec", lambda name: name != "osqp" and found(name))
    own, *others = solvers.solvers(ticks=30)
    assert own.value is not None and own.note == "30 ticks"
    rows = {row.name.removeprefix("tick, wbc.solver: "): row for row in others}
    assert set(rows) == set(PACKAGES)
    assert rows["osqp"].value is None and rows["osqp"].note == "not installed: pip install osqp"
    assert rows["daqp"].note.startswith("no optimum in 0 of 30 ticks; torques apart by ")


def test_ticks_without_an_optimum_and_torques_apart_are_told() -> None:
    jump = record_jump(4)
    own, other = solvers.SolverController(jump), solvers.SolverController(jump, "daqp")
    own.stands[:3] = own.solved[:] = True
    other.solved[[0, 1]] = True
    other.torque[:] = np.array([1e-3, 3e-3, 9.0, 9.0])[:, None]
    assert solvers.agreement_note(own, other) == (
        "no optimum in 1 of 3 ticks; torques apart by 2.0e-03 N m in the median, 3.0e-03 at most"
    )
