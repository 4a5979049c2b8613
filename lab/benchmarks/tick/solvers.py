"""One tick of the controller of a jump with every solver of quadratic programs that ``wbc.solver`` takes, beside the
own one.

All of them run the same recorded jump in turns of ``CHUNK`` ticks. A ratio is the median over the ratios of single
ticks in which feet are on the ground: in the air the controller has no program of this size.
"""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from ....blocks.control.whole_body_controller import WholeBodyController
from ....mathematics.quadratic_program import PACKAGES
from ....runtime.graph import load
from ..rows import Row, compare
from .controller import GRAPH, RecordedController, RecordedJump, record_jump

CHUNK = 20
"""Ticks of a turn."""
OWN = "tick, the own solver"


class SolverController(RecordedController):
    """The controller of a recorded jump, with a solver; it notes which ticks have a program and what comes out.

    Attributes:
        torque: the joint torques of every tick [N m], (ticks, n_joints).
        stands: whether feet are on the ground, by tick.
        solved: whether the solver found the optimum, by tick.
    """

    def __init__(self, jump: RecordedJump, solver: str = "") -> None:
        overrides = {"wbc.solver": solver} if solver else {}
        super().__init__(replace(jump, graph=load(GRAPH, overrides).checked))
        block = self.bound.blocks["wbc"]
        assert isinstance(block, WholeBodyController)
        self._block = block
        self.torque = np.zeros((jump.ticks, block.command.torque.shape[0]))
        self.stands = np.zeros(jump.ticks, dtype=bool)
        self.solved = np.zeros(jump.ticks, dtype=bool)

    def note(self, tick: int) -> None:
        """Keep what the controller has computed in a tick."""
        command = self._block.command
        self.torque[tick] = command.torque
        self.stands[tick] = bool(np.any(self._block.phase.stance))
        self.solved[tick] = bool(command.solved)


def solvers(ticks: int | None = None) -> list[Row]:
    """Measure and return the rows: the own tick, and a row a solver with how far its torques are from the own ones.

    Args:
        ticks: how much of the jump is used; by default all.
    """
    jump = record_jump(ticks)
    installed = [name for name, package in PACKAGES.items() if find_spec(package)]
    cases = {OWN: SolverController(jump)}
    cases |= {f"tick, wbc.solver: {name}": SolverController(jump, name) for name in installed}
    for case in cases.values():  # warm
        case.run(min(CHUNK, jump.ticks))
        case.again()
        case.times.clear()
    names = list(cases)
    for turn in range(-(-jump.ticks // CHUNK)):
        shift = turn % len(names)
        for name in (*names[shift:], *names[:shift]):
            cases[name].run(CHUNK, cases[name].note)
    own = cases[OWN]
    times = {name: np.array(case.times)[own.stands] for name, case in cases.items()}
    rows = [Row(OWN, float(np.median(times[OWN])), "us/tick", note=f"{own.stands.sum()} ticks")]
    rows += [compare(name, times, OWN, note=agreement_note(own, cases[name])) for name in names[1:]]
    for name, package in PACKAGES.items():
        if name not in installed:
            note = f"not installed: pip install {package}"
            rows.append(Row(f"tick, wbc.solver: {name}", None, "us/tick", OWN, note=note))
    return rows


def agreement_note(own: SolverController, other: SolverController) -> str:
    """Say in how many ticks on the ground a solver found no optimum, and by how much its torques differ where it did."""
    found: NDArray[np.bool_] = own.stands & own.solved & other.solved
    missed = int((own.stands & own.solved & ~other.solved).sum())
    apart = np.abs(own.torque - other.torque)[found].max(axis=1, initial=0.0)
    return (
        f"no optimum in {missed} of {own.stands.sum()} ticks; torques apart by "
        f"{np.median(apart):.1e} N m in the median, {apart.max(initial=0.0):.1e} at most"
    )
