"""A reference for standing still, or for a squat, of any robot with feet; it needs no plan."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...planner.library.jump_table import JumpTable, TableRows
from ...robots.description import RobotDescription
from ...robots.pinocchio_model import build_pinocchio_model
from ...runtime.language.block import Input, State
from ...runtime.language.context import Clock
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DelayEstimate, JumpReference, Phase, PhaseState
from .guided_motion import (
    NEVER,
    GuidedBody,
    GuidedMotion,
    GuidedParameters,
    GuidedReference,
    MotionRecorder,
    check_limits,
)
from .table_reading import read_table


class StandReference(GuidedReference):
    """The whole body stands as described, and with a ``squat_depth`` squats and rises.

    The feet stand still and the base stays level. For ``stand_time`` the robot stands in its
    standing pose. With a ``squat_depth`` above zero its centre of mass then goes down by that much
    with least jerk within ``squat_time``, and over the middle of the feet; it waits there for
    ``pause_time`` and rises within ``rise_time`` to the height it stood at. Then it goes on
    standing. All joints follow from feet, centre of mass and base (see ``guided_motion``);
    joints that the description holds stay at their held angle.

    The phase is STAND, and SQUAT from the squat on; no lift-off is ever planned. The reference is
    made at load and follows time alone: it does not know what the robot really does. The load
    report has a problem for a robot with too few joints; a squat that takes a joint past its limit
    or a motor past its speed raises ``BlockError`` at load.
    """

    class Params(GuidedParameters):
        squat_depth: float = parameter(
            0.0, unit="m", ge=0.0, le=0.5, text="descent of the centre of mass; 0: no squat"
        )
        stand_time: float = parameter(
            0.5, unit="s", gt=0.0, text="standing before the squat, for the estimator to settle"
        )
        squat_time: float = parameter(0.5, unit="s", gt=0.1, text="going down")
        pause_time: float = parameter(0.3, unit="s", gt=0.0, text="waiting at the bottom")
        rise_time: float = parameter(0.6, unit="s", gt=0.1, text="rising to standing height")

    params: Params

    def make_table(self) -> JumpTable:
        """Compute the stance, and the squat if there is one."""
        p = self.params
        times = (p.stand_time, p.squat_time, p.pause_time, p.rise_time)
        return _plan(self.robot.model_dump_json(), float(p.squat_depth), times)


class TriggerMemory(Signal):
    """Start of the motion."""

    began = Field(unit="s", text="the time of the run at which the robot stood")


class TriggeredStandReference(StandReference):
    """A ``StandReference`` that begins when the robot stands, and not with the run.

    While the ``phase`` of the tick before is HANG the reference is its beginning, and ``reference.time`` is
    negative. Wire it with ``{from: phase.phase, delay: 1, initial: {phase: -1}}``.
    """

    phase = Input(PhaseState, text="the phase; the motion begins after HANG")
    memory = State(TriggerMemory, text="start of the motion")

    @kernel
    @staticmethod
    def step(  # type: ignore[override]  # it has another port
        delay: DelayEstimate,
        phase: PhaseState,
        reference: JumpReference,
        memory: TriggerMemory,
        table: TableRows,
        hold: float,
        params: StandReference.Params,
        clock: Clock,
    ) -> None:
        now = clock.base_period * clock.tick
        if phase.phase == Phase.HANG:
            memory.began = now + clock.base_period
            read_table(table, -clock.base_period, 0.0, hold, reference)
            return
        read_table(table, now - memory.began + delay.ahead, params.lead, hold, reference)


@lru_cache(maxsize=8)
def _plan(robot: str, depth: float, times: tuple[float, float, float, float]) -> JumpTable:
    """Compute the motion for a robot given as JSON, once for all runs of a process."""
    description = RobotDescription.model_validate_json(robot)
    return plan_stand(description, depth, times)


def plan_stand(
    robot: RobotDescription, depth: float, times: tuple[float, float, float, float]
) -> JumpTable:
    """Compute the stance, and with a ``depth`` above zero [m] the squat, as a table.

    Args:
        robot: the robot that stands.
        depth: how far the centre of mass goes down [m].
        times: standing, going down, waiting and rising [s].

    Raises:
        BlockError: the squat takes a joint past its limit or a motor past its speed.
    """
    stand_time, squat_time, pause_time, rise_time = times
    body = GuidedBody(build_pinocchio_model(robot), robot)
    table = MotionRecorder(body, body.standing(robot.standing_position))
    still = np.zeros((len(robot.feet), 3))
    home = body.com(table.q)
    low = np.array([0.0, 0.0, float(home[2]) - depth])
    high = np.array([0.0, 0.0, float(home[2])])

    def between(start: Array, end: Array, duration: float, t: float) -> GuidedMotion:
        share, rate, bend = minimum_jerk(t / duration)
        return GuidedMotion(
            com=start + share * (end - start),
            com_velocity=rate / duration * (end - start),
            com_acceleration=bend / duration**2 * (end - start),
            rotation=np.zeros(3),
            rotation_rate=np.zeros(3),
            by_momentum=(False, False, False),
            foot_velocity=still,
        )

    table.run(stand_time, lambda t: between(home, home, stand_time, t))
    if depth > 0.0:
        table.run(squat_time, lambda t: between(home, low, squat_time, t))
        table.run(pause_time, lambda t: between(low, low, pause_time, t))
        table.run(rise_time, lambda t: between(low, high, rise_time, t))
    columns = {name: np.array(rows) for name, rows in table.rows.items()}
    check_limits(robot, columns)
    squat = stand_time if depth > 0.0 else NEVER
    return JumpTable(np.array(table.time), columns, squat, NEVER, NEVER, NEVER, NEVER)
