"""Whether TSID and the own method find the same torques where both have the same program."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from ...blocks.control.dynamics import LEAST_OFFSET, LEAST_SCALE, Dynamics
from ...blocks.control.tasks.contact_points import ContactPoints
from ...blocks.control.whole_body_controller import WholeBodyController
from ...mathematics.compiling.compile_calls import compile_calls
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.whole_body_solution import (
    NO_LIMITS,
    SOLVED,
    Solution,
    solution_memory,
    solve_whole_body,
)
from .controller import RecordedController
from .tsid import TsidProgram

EVERY = 40
"""One in so many ticks is compared."""
TORQUE_ERROR = 1e-2
"""How much the torques may differ [N m]: TSID's solver adds 1e-8 to the diagonal of the Hessian, a
ten-thousandth of the weight of forces, which alone decides between forces that do not move the base."""


class TsidCheck:
    """Compares torques in the states of a recorded jump in which the two programs are the same one.

    For that TSID's model gets the mass and the centre of mass of the moment, and a weight of the base's
    acceleration; the own method's model loses the inertia of coupled rotors, and its limits on torque. What is
    left of the differences is one weight for each task, so the thrust is left out, and states in which
    friction binds a point: there the torques differ by more (0.11 N m in a squat), which is not explained.

    Attributes:
        errors: the largest difference of a torque in every state that was compared [N m].
    """

    def __init__(self, tsid: ModuleType, own: RecordedController) -> None:
        block, dynamics = own.bound.blocks["wbc"], own.bound.blocks["dynamics"]
        assert isinstance(block, WholeBodyController) and isinstance(dynamics, Dynamics)
        assert any(type(task) is ContactPoints for task in block._tasks["stand"])
        self._tsid, self._block, self._dynamics = tsid, block, dynamics
        n, contacts = len(block.command.acceleration), len(block.command.force)
        self._mass = np.zeros((n, n))
        self._found = Solution(
            np.zeros(n - 6), np.zeros(n), np.zeros((contacts, 3)), np.zeros(1, np.int64)
        )
        self._solve = KernelCall(
            solve_whole_body, block._rows, block._model._replace(mass_matrix=self._mass),
            block.phase.stance, block.joints.velocity, block._weights, NO_LIMITS, block._motors,
            solution_memory(n, contacts), self._found,
        )  # fmt: skip
        compile_calls([self._solve])
        self.errors: list[float] = []

    def compare(self, tick: int) -> None:
        """Compare the present state, if it is one of those.

        Raises:
            AssertionError: the torques differ by more than ``TORQUE_ERROR``.
        """
        block, weighed = self._block, self._dynamics.mass
        if tick % EVERY or not block.phase.stance.any() or block.phase.stepping.any():
            return
        described = block.robot.total_mass
        program = TsidProgram(
            self._tsid, block, self._dynamics.base.orientation, exact=True,
            mass=round(float(weighed.mass) / described / LEAST_SCALE) * LEAST_SCALE * described,
            com_offset=np.rint(weighed.com_offset / LEAST_OFFSET) * LEAST_OFFSET,
        )  # fmt: skip
        if program.kind == "thrust":
            return
        self._mass[...] = block._model.mass_matrix - program.coupling
        self._solve.run()
        if int(self._found.code[0]) != SOLVED or not program.solve():
            raise AssertionError(f"tick {tick}: TSID or the own method found no solution")
        force = self._found.force
        if (np.abs(force[:, :2]).max(axis=1) > 0.999 * block.params.friction * force[:, 2]).any():
            return
        apart = float(np.abs(program.torque - self._found.torque).max())
        if apart > TORQUE_ERROR:
            raise AssertionError(f"tick {tick}: TSID's torque is {apart:.2g} N m from the own one")
        self.errors.append(apart)
