"""Hops on without a rest at a speed that is commanded while it hops, by mixing plans of rows of several speeds."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import field_validator

from ....blocks.jumping.plan_progress import (
    PlanProgress,
    ProgressConstants,
    ProgressParameters,
    keep_in_time,
    plan_time,
)
from ....blocks.jumping.table_reading import interpolate_rows, write_columns, write_marks
from ....blocks.signals import DelayEstimate, DynamicsTerms, JumpReference
from ....mathematics.arrays import Array, Array1D
from ....mathematics.interpolation import minimum_jerk
from ....mathematics.kernel import kernel
from ....planner.library.jump_table import (
    FlightRotation,
    JumpTable,
    TableRows,
    integral,
    row_dimensions,
    table_rows,
)
from ....robots.description import RobotDescription
from ....runtime.language.block import Block, Input, Output, State
from ....runtime.language.context import Clock
from ....runtime.language.errors import AloftError, BlockError
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal
from ..planner.plan_outcome import PlanOutcome
from ..signals import BodyTwist, CourseGoal

if TYPE_CHECKING:
    from ....planner.task.task import JumpTask

ROW = 4
"""Jumps of a planned row: the first, one into the cycle, the cycle itself and the last."""
CYCLE = 2
"""The jump of a row that is repeated."""


class SpeedMemory(Signal):
    """Memory of ``SpeedPlan``."""

    jump = Field(dtype="int64", text="the jump of the planned rows that is under way")
    landed = Field(dtype="int64", text="touchdowns of the plan so far")
    skipped = Field(unit="s", text="time by which the repeated cycles have put off the rows")
    place = Field(unit="m", text="place of the planned feet, ahead of where they began")
    before = Field(unit="m", text="the length of the jump before")
    way = Field(unit="m", text="the length of the jump under way")
    goal = Field(unit="m", text="landing place of the last jump that has lifted off")
    begun = Field(dtype="int64", text="number of jumps that have begun")


class HoppingConstants(ProgressConstants):
    """Constants derived from the parameters and the rows."""

    hop_time = Field(unit="s", text="from one lift-off to the next")


class SpeedPlan(Block):
    """The reference of a row of jumps without a rest, at a speed that may change with every jump.

    For each of the ``speeds`` a row of four jumps of that length is planned when the graph is loaded, or taken from the plan library.
    All jumps have the same ``flight_time`` and ``contact_time``, so the rows last equally long. In the middle such rows are
    periodic: from its second touchdown to its third a row is repeated until ``jumps`` have been
    made. Nothing is planned while the robot moves.

    At each touchdown the speed ahead at ``twist`` is taken, within the speeds and changed by at most ``most_change``,
    as the length d of the next jump; the last jump is at most as fast as ``end_speed``. Let X_j(t) be the rows from where the feet stand, h_j(d) the hat functions of linear
    interpolation between their lengths, and s(u) the motion of ``minimum_jerk`` over the time on the ground. Then
    the reference is::

        X(t) = sum w_j X_j(t),     w_j = (1 - s) h_j(d_before) + s h_j(d),

    and the centre of mass has the velocity sum w_j v_j + w_j' x_j besides, and the like acceleration. In flight the weights do not
    change: a sum of falling motions falls. A mixture obeys the laws of motion as far as the rows depend linearly on
    the speed; the controller does the rest.

    ``goal`` tells where the feet should land, for ``CourseScore``.
    """

    class Params(ProgressParameters):
        flight_time: float = parameter(unit="s", gt=0.0, le=3.0, text="of each jump")
        contact_time: float = parameter(unit="s", gt=0.0, le=5.0, text="between two jumps")
        stand_time: float = parameter(
            0.4, unit="s", gt=0.0, text="standing before the row, for the estimator to settle"
        )
        lead: float | None = parameter(
            None, unit="s", ge=0.0, le=0.02,
            text="delay from sensing to torque that is compensated; none: the one at `delay`",
        )  # fmt: skip
        speeds: tuple[float, ...] = parameter(
            (0.0, 0.2, 0.4, 0.6, 0.8), unit="m/s", text="of the rows, rising"
        )
        jumps: int = parameter(30, ge=ROW, le=10000, text="number of jumps")
        most_change: float = parameter(
            0.2, unit="m/s", gt=0.0, text="change of the speed from one jump to the next at most"
        )
        end_speed: float = parameter(
            0.4, unit="m/s", ge=0.0, text="speed of the first and of the last jump at most"
        )

        @field_validator("speeds")
        @classmethod
        def _check_speeds(cls, speeds: tuple[float, ...]) -> tuple[float, ...]:
            if len(speeds) < 2 or any(b <= a for a, b in pairwise(speeds)):
                raise ValueError(f"expected two or more rising speeds, found {speeds}")
            return speeds

    class Scratch(Signal):
        """Scratch memory of one step."""

        mixed = Field("plan_width", text="columns of an instant")
        added = Field(2, text="velocity and acceleration ahead by the change of the weights")
        raised = Field(2, text="the same upwards")

    Constants = HoppingConstants
    needs = ("floating base", "feet")
    params: Params
    constants: HoppingConstants
    terms = Input(DynamicsTerms, text="the measured motion")
    delay = Input(DelayEstimate, default={"delay": 0.002}, text="the delay that is compensated")
    twist = Input(BodyTwist, text="commanded speed: linear[0]")
    reference = Output(JumpReference, text="the mixture at the present instant")
    goal = Output(CourseGoal, text="landing place of the feet")
    memory = State(SpeedMemory, text="the jump under way")
    progress = State(PlanProgress, text="delay of the plan")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """Return the width of a plan's rows."""
        return row_dimensions(robot)

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two speeds."""
        return {"flight_time": 0.262, "contact_time": 0.25, "speeds": (0.0, 0.2)}

    def setup(self) -> None:
        p = self.params
        ways = row_lengths(p)
        tables = [self._table_of(way) for way in ways]
        self.table, self.firsts = joined(tables), first_rows(tables)
        self.ways = np.array(ways)
        self.rotation = FlightRotation(*(np.zeros(size) for size in (1, 1, 1, 4)))
        self.constants.lead = -1.0 if self.params.lead is None else self.params.lead
        self.constants.follows_motion = self.params.by == "progress"
        self.constants.period = self.period
        self.constants.foot_of_point[:] = self.robot.foot_of_contact()
        self.constants.hop_time = p.flight_time + p.contact_time

    def _table_of(self, way: float) -> JumpTable:
        """Return the row of jumps of this length."""
        from ....planner.library.library import PlanLibrary
        from ....planner.library.validation_cache import cached_reference_table

        robot = self.robot
        try:
            plan, _ = PlanLibrary(robot).plan(row_task(self.params, robot.name, way))
        except AloftError as error:
            raise BlockError(f"no row of jumps of {way:g} m can be planned: {error}") from error
        return cached_reference_table(plan, robot, self.params.stand_time)

    @kernel
    @staticmethod
    def step(
        terms: DynamicsTerms,
        delay: DelayEstimate,
        twist: BodyTwist,
        reference: JumpReference,
        goal: CourseGoal,
        progress: PlanProgress,
        memory: SpeedMemory,
        table: TableRows,
        firsts: Array1D,
        ways: Array1D,
        rotation: FlightRotation,
        params: Params,
        constants: HoppingConstants,
        scratch: Scratch,
        clock: Clock,
    ) -> None:
        time, lead = plan_time(clock.base_period * clock.tick, delay, progress, constants)
        period = constants.hop_time
        slow, change = params.end_speed * period, params.most_change * period
        wanted = min(max(twist.linear[0] * period, ways[0]), ways[ways.shape[0] - 1])
        if time < table.marks[0]:  # all rows begin with the same standing
            memory.before = min(wanted, slow)
            memory.way = memory.before
        if memory.jump < ROW and time - memory.skipped >= table.jumps[memory.jump, 2]:
            left = params.jumps - memory.landed - 2
            begin_next_jump(min(wanted, slow + left * change), change, params.jumps, table, memory)
        now = time - memory.skipped
        mix_rows(now, lead, constants.period, table, firsts, ways, memory, reference, scratch)
        write_marks(table, now, reference)
        if memory.jump < ROW and now >= table.jumps[memory.jump, 1]:
            memory.goal = memory.place + memory.way
            memory.begun = memory.landed + 1
        tell_goal(memory, goal)
        reference.time += memory.skipped
        reference.lift_off_time += memory.skipped
        reference.touchdown_time += memory.skipped
        keep_in_time(
            reference.time, terms, reference, progress, rotation, params, constants
        )  # fmt: skip


def row_lengths(params: SpeedPlan.Params) -> list[float]:
    """Return the length of the jumps of each row [m]."""
    period = params.flight_time + params.contact_time
    return [round(speed * period, 6) for speed in params.speeds]


def row_task(params: SpeedPlan.Params, robot: str, way: float) -> JumpTask:
    """Return the task of a row of jumps of this length [m]."""
    from ....planner.task.task import make_task

    return make_task({
        "name": "hop_on", "robot": robot, "flight_time": params.flight_time,
        "contact_time": params.contact_time, "repeat": ROW, "distance_x": way,
    })  # fmt: skip


def first_rows(tables: list[JumpTable]) -> Array:
    """Return the start of each table among the ``joined`` ones [s], (n,)."""
    return np.asarray(2.0 * float(tables[0].time[-1]) * np.arange(len(tables)))


def joined(tables: list[JumpTable]) -> TableRows:
    """Tables one behind the other, so far apart that none is read for another."""
    parts = [table_rows(table) for table in tables]
    firsts = first_rows(tables)
    time = np.concatenate([part.time + first for part, first in zip(parts, firsts, strict=True)])
    rows = np.concatenate([part.rows for part in parts])
    contact = np.concatenate([part.contact for part in parts])
    return parts[0]._replace(time=time, rows=rows, sums=integral(time, rows), contact=contact)


@kernel
def begin_next_jump(
    wanted: float, change: float, jumps: int, table: TableRows, memory: SpeedMemory
) -> None:
    """Begin the next jump of the row, or the cycle again."""
    memory.landed += 1
    memory.place += memory.way
    memory.before = memory.way
    if memory.jump < ROW - 1:
        memory.way += min(max(wanted - memory.way, -change), change)
    if memory.jump == CYCLE and memory.landed + 1 < jumps:
        memory.skipped += table.jumps[CYCLE, 2] - table.jumps[CYCLE - 1, 2]
    else:
        memory.jump += 1


@kernel
def tell_goal(memory: SpeedMemory, goal: CourseGoal) -> None:
    """Write the ``goal`` of the feet."""
    goal.position[0], goal.position[1] = memory.goal, 0.0
    goal.heading, goal.height = 0.0, 0.0
    goal.number = memory.begun
    goal.outcome = PlanOutcome.PLANNED if memory.begun else PlanOutcome.NONE


@kernel
def triangle_weight(ways: Array1D, number: int, way: float) -> float:
    """Return the weight of a row in the linear interpolation between the ``ways`` at a ``way`` within them."""
    weight = 1.0
    if number > 0 and way < ways[number]:
        weight = (way - ways[number - 1]) / (ways[number] - ways[number - 1])
    elif number + 1 < ways.shape[0] and way > ways[number]:
        weight = (ways[number + 1] - way) / (ways[number + 1] - ways[number])
    return max(0.0, weight)


@kernel
def mix_rows(
    now: float,
    lead: float,
    hold: float,
    table: TableRows,
    firsts: Array1D,
    ways: Array1D,
    memory: SpeedMemory,
    reference: JumpReference,
    scratch: SpeedPlan.Scratch,
) -> None:
    """Write the columns of the reference at the rows' time ``now`` [s]; ``lead`` and ``hold`` as ``read_table`` has them."""
    jump, grown, rate, bend = memory.jump, 1.0, 0.0, 0.0
    if 0 < jump < ROW:
        landed = table.jumps[jump - 1, 2]
        ground = table.jumps[jump, 1] - landed
        grown, rate, bend = minimum_jerk((now - landed) / ground)
        rate, bend = rate / ground, bend / (ground * ground)
    scratch.mixed[:] = 0.0
    scratch.added[:] = 0.0
    scratch.raised[:] = 0.0
    stood = 0.0
    at = min(now, 0.5 * firsts[1] - lead - hold)
    for number in range(ways.shape[0]):
        start, end = (
            triangle_weight(ways, number, memory.before),
            triangle_weight(ways, number, memory.way),
        )
        if start == 0.0 and end == 0.0:
            continue
        interpolate_rows(table, firsts[number] + at, lead, hold, table.values)
        weight, change = start + grown * (end - start), end - start
        scratch.mixed[:] += table.values * weight
        place = table.values[0] - jump * ways[number]
        stood += weight * jump * ways[number]
        scratch.added[0] += change * rate * place
        scratch.added[1] += change * (2.0 * rate * table.values[3] + bend * place)
        scratch.raised[0] += change * rate * table.values[2]
        scratch.raised[1] += change * (2.0 * rate * table.values[5] + bend * table.values[2])
    write_columns(scratch.mixed, reference)
    reference.com[0] += memory.place - stood
    reference.com_velocity[0] += scratch.added[0]
    reference.com_velocity[2] += scratch.raised[0]
    reference.com_acceleration[0] += scratch.added[1]
    reference.com_acceleration[2] += scratch.raised[1]
    for foot in range(reference.foot_position.shape[0]):
        reference.foot_position[foot, 0] += memory.place - stood
