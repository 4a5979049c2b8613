"""The plans of hops that ship with a robot, and what blocks take from them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...runtime.language.block import UnmetRequirement
from ..library.jump_table import JumpTable, table_rows
from ..library.library import SHIPPED
from ..library.reference_table import COARSE_STEPS, reference_table
from ..task.plan import PlannedJump
from .hop_request import HopReach, StepReach
from .plan_samples import PlanSamples, read_samples


def samples_path(robot: str, *, steps: bool = False) -> Path:
    """Where the plans of hops of a robot ship: those on level ground, or those up and down."""
    return SHIPPED / "hops" / robot / ("steps.npz" if steps else "level.npz")


def missing_plans(robot: RobotDescription) -> Iterator[UnmetRequirement]:
    """What a block that needs the plans of hops of a robot does not have."""
    path = samples_path(robot.name)
    if path.is_file():
        return
    there = sorted(file.parent.name for file in path.parent.parent.glob(f"*/{path.name}"))
    yield UnmetRequirement(
        f"there are no stored plans of hops for {robot.name}",
        expected=f"a robot with such plans: {', '.join(there)}",
        found=f"{robot.name}; python -m aloft.planner.online.make_samples {robot.name} makes them",
        fix=f"robot: {there[0]}, as a key of the graph" if there else "",
    )


@lru_cache(maxsize=4)
def shipped_samples(robot: str, *, steps: bool = False) -> PlanSamples:
    """The plans of hops of a robot on level ground, or of those up and down.

    Raises:
        PlanFileError: there are none, or the file is broken.
    """
    return read_samples(samples_path(robot, steps=steps))


def shipped_steps(robot: str) -> PlanSamples | None:
    """The plans of hops of a robot up and down, if it has any."""
    there = samples_path(robot, steps=True).is_file()
    return shipped_samples(robot, steps=True) if there else None


def level_reach(robot: str) -> HopReach:
    """How far a robot hops on level ground."""
    reach = shipped_samples(robot).reach
    assert isinstance(reach, HopReach)
    return reach


def step_reach(robot: str) -> StepReach:
    """How far a robot hops up and down, which must have such plans."""
    reach = shipped_samples(robot, steps=True).reach
    assert isinstance(reach, StepReach)
    return reach


def hop_table(plan: PlannedJump, robot: RobotDescription) -> JumpTable:
    """The plan as a table of few rows, which begins with the squat."""
    return reference_table(plan, robot, 0.0, COARSE_STEPS)


def standing_row(robot: RobotDescription) -> Array:
    """The row of a table in which the robot stands as every hop begins, (width,)."""
    first: Array = table_rows(hop_table(shipped_samples(robot.name).plan(0), robot)).rows[0]
    return first
