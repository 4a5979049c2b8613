"""A planned jump that begins when the robot stands."""

from __future__ import annotations

from ...mathematics.kernel import kernel
from ...planner.library.jump_table import FlightRotation, TableRows, read_table
from ...runtime.language.block import Input
from ...runtime.language.context import Clock
from ..signals import DelayEstimate, DynamicsTerms, JumpReference, Phase, PhaseState
from .jump_plan import JumpPlan, follow_plan
from .plan_progress import PlanProgress, ProgressConstants


class TriggeredJumpPlan(JumpPlan):
    """A ``JumpPlan`` that begins when the robot stands, and not with the run.

    While the ``phase`` of the tick before is HANG the reference is the beginning of the plan, and
    ``reference.time`` is negative. Wire it with ``{from: phase.phase, delay: 1, initial: {phase: -1}}``.
    """

    phase = Input(PhaseState, text="the phase; the plan begins after HANG")

    @kernel
    @staticmethod
    def step(  # type: ignore[override]  # it has another port
        terms: DynamicsTerms,
        delay: DelayEstimate,
        phase: PhaseState,
        reference: JumpReference,
        progress: PlanProgress,
        table: TableRows,
        rotation: FlightRotation,
        params: JumpPlan.Params,
        constants: ProgressConstants,
        clock: Clock,
    ) -> None:
        now = clock.base_period * clock.tick
        if phase.phase == Phase.HANG:
            progress.late = now + clock.base_period
            read_table(table, -constants.period, 0.0, constants.period, reference)
            return
        follow_plan(
            now, terms, delay, reference, progress, table, rotation, params, constants
        )  # fmt: skip
