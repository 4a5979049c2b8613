"""Plans the next jump while the robot moves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from ....planner.library.jump_table import row_dimensions, table_rows
from ....robots.description import RobotDescription
from ....runtime.language.block import (
    Block,
    Context,
    Input,
    Metric,
    Output,
    State,
    UnmetRequirement,
)
from ....runtime.language.errors import BlockError
from ....runtime.language.parameters import Parameters
from ....runtime.language.signals import Field
from ..planner.hop_request import HopRequest
from ..planner.plan_outcome import PlanOutcome
from ..signals import PLAN_ROWS, SEGMENT_ROWS, PlanRequest, PlanRows, PlanSegment

if TYPE_CHECKING:
    from ..planner.next_hop import HopPlan


class PlanAnswer(PlanRows):
    """The state of ``OnlinePlanner``: the last plan, and how much of it has been handed over."""

    number = Field(dtype="int64", text="of the request that was planned last")
    segments = Field(dtype="int64", text="number of its segments")
    given = Field(dtype="int64", text="number of parts handed over")
    outcomes = Field(len(PlanOutcome), dtype="int64", text="number of plans of each PlanOutcome")


class OnlinePlanner(Block):
    """Plans the requested jump, and hands the plan over, a part in every run.

    It belongs in the background (``background: {latency: 250 ms}``): a plan takes a tenth of a second on a busy machine.
    A motion is interpolated from the robot's stored plans of hops (``extensions/hopping/planner/plan_samples``), and corrected in a few steps
    until it fulfils all constraints of the whole-body problem of ``aloft plan``, on 44 knots with all coordinates
    (``extensions/hopping/planner/correction``). The plan must pass the check with exact dynamics that every plan passes. A jump out of
    reach is replaced by the nearest within it; where no motion is found, or it fails the check, the
    nearest stored plan is the answer. ``segment.outcome`` reports that, and the metrics count it.

    A plan follows from its request alone: the same requests give the same bytes on the same machine.
    The metrics have the times of planning.
    """

    needs = ("floating base", "feet")
    array_allocations = 10**9
    allocation_reason = (
        "a plan is made by the planner and its solver; run this block in the background"
    )
    request = Input(PlanRequest, text="the jump that should be planned")
    segment = Output(PlanSegment, text="the next rows of its plan")
    answer = State(PlanAnswer, text="the plan that is handed over")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """Return the width of a plan's rows."""
        return row_dimensions(robot)

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a robot without stored plans."""
        from ..planner.hop_plans import missing_plans

        assert context.robot is not None
        return missing_plans(context.robot)

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, object]]:
        """No request: a plan takes long."""
        return {"request": {"number": 0}}

    def setup(self) -> None:
        from ....planner.task.plan import PlanFileError
        from ..planner.hop_plans import hop_table, samples_of_hops, samples_of_steps
        from ..planner.next_hop import HopPlanner

        try:
            samples = samples_of_hops(self.robot), samples_of_steps(self.robot)
        except PlanFileError as error:
            raise BlockError(str(error)) from error
        self._planner = HopPlanner(self.robot, *samples)
        self._planner.prepare()
        self._table = hop_table
        self._times: list[float] = []

    def step(self) -> None:
        request, answer, segment = self.request, self.answer, self.segment
        number = int(request.number)
        if number != int(answer.number):
            found = self._planner.plan(
                HopRequest(
                    float(request.ahead),
                    float(request.aside),
                    float(request.turn),
                    float(request.up),
                )
            )
            self._keep(found, number)
        answer.given[()] = min(int(answer.given) + 1, int(answer.segments))
        given = max(int(answer.given) - 1, 0)
        rows = slice(given * SEGMENT_ROWS, (given + 1) * SEGMENT_ROWS)
        segment.number[()], segment.segment[()], segment.segments[()] = (
            answer.number,
            given,
            answer.segments,
        )
        segment.time[:] = answer.time[rows]
        segment.rows[:] = answer.rows[rows]
        segment.contact[:] = answer.contact[rows]
        segment.marks[:], segment.jump[:] = answer.marks, answer.jumps[0]
        segment.toes_first[()], segment.outcome[()] = answer.toes_first[0], answer.outcome
        segment.ahead[()], segment.aside[()], segment.turn[()], segment.up[()] = answer.done

    def _keep(self, found: HopPlan, number: int) -> None:
        """Write a plan's table into the state."""
        answer = self.answer
        table = table_rows(self._table(found.plan, self.robot))
        n = len(table.time)
        if n > PLAN_ROWS:
            raise BlockError(f"the plan has {n} rows, which is more than {PLAN_ROWS}")
        answer.time[:n], answer.rows[:n] = table.time, table.rows
        answer.contact[:n] = table.contact if len(table.contact) else True
        for array in (answer.time, answer.rows, answer.contact):
            array[n:] = array[n - 1]
        answer.marks[:], answer.jumps[:] = table.marks, table.jumps
        answer.toes_first[:] = table.toes_first
        answer.number[()], answer.given[()] = number, 0
        answer.segments[()] = -(-n // SEGMENT_ROWS)
        answer.outcomes[found.outcome] += 1
        answer.outcome[()] = int(found.outcome)
        answer.done[:] = found.done
        self._times.append(found.solve_s + found.check_s)

    def metrics(self) -> Mapping[str, Metric]:
        """Return the number of plans of each kind, and the processor time of solver and check."""
        counts = {
            f"plans_{outcome.name.lower()}": int(self.answer.outcomes[outcome])
            for outcome in PlanOutcome
            if outcome != PlanOutcome.NONE
        }
        if not self._times:
            return counts
        return {
            **counts,
            "planning_median_s": float(np.median(self._times)),
            "planning_longest_s": float(max(self._times)),
        }
