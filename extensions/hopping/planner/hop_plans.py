"""The stored plans of a robot's hops, those that ship or the user's own, and what blocks take from them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from ....files.cache import trusted_file
from ....mathematics.arrays import Array
from ....planner.library.jump_table import JumpTable, table_rows
from ....planner.library.library import SHIPPED, readable_name, user_folder
from ....planner.library.reference_table import COARSE_STEPS, reference_table
from ....planner.task.plan import PlanFileError, PlannedJump
from ....planner.task.task import content_name, planned_robot
from ....robots.description import RobotDescription, robot_names
from ....runtime.language.block import UnmetRequirement
from .hop_request import HopReach, StepReach
from .plan_samples import FILE_FORMAT, PlanSamples, read_samples

LEVEL_FILE, STEPS_FILE = "level.npz", "steps.npz"


def shipped_path(robot: str, *, steps: bool = False) -> Path:
    """Return the file of a robot's shipped hop plans: those on level ground, or those up and down."""
    return SHIPPED / "hops" / robot / (STEPS_FILE if steps else LEVEL_FILE)


def own_path(robot: RobotDescription, *, steps: bool = False) -> Path:
    """Return the file of a user's own: with those of tasks, under the robot's name and content."""
    content = content_name({"format": FILE_FORMAT, "robot": planned_robot(robot)})
    name = f"{readable_name(robot.name)}-{content}"
    return user_folder() / "hops" / name / (STEPS_FILE if steps else LEVEL_FILE)


def samples_file(robot: RobotDescription, *, steps: bool = False) -> Path | None:
    """Return the file of a robot's plans of hops: one that ships comes first, so that a cache changes no run with
    it.
    """
    shipped = shipped_path(robot.name, steps=steps)
    if shipped.is_file():
        return shipped
    own = own_path(robot, steps=steps)
    return own if trusted_file(own) and _readable(own) else None


def _readable(path: Path) -> bool:
    """Return whether a file holds plans of hops; one that is damaged is made anew."""
    try:
        _read(path)
    except PlanFileError:
        return False
    return True


def missing_plans(robot: RobotDescription) -> Iterator[UnmetRequirement]:
    """Yield what a block that needs the plans of hops of a robot lacks."""
    if samples_file(robot) is not None:
        return
    there = sorted(file.parent.name for file in (SHIPPED / "hops").glob(f"*/{LEVEL_FILE}"))
    yield UnmetRequirement(
        f"there are no stored plans of hops for {robot.name}",
        expected=f"a robot with such plans: {', '.join(there)}, or those that 'aloft steer --robot' makes",
        found=robot.name,
        fix=f"aloft steer --robot {robot.name if robot.name in robot_names() else 'FILE'}",
    )


_read = lru_cache(maxsize=4)(read_samples)


def samples_of_hops(robot: RobotDescription, *, steps: bool = False) -> PlanSamples:
    """Return the plans of hops of a robot on level ground, or of those up and down.

    Raises:
        PlanFileError: there are none, or the file is broken.
    """
    return _read(samples_file(robot, steps=steps) or shipped_path(robot.name, steps=steps))


def samples_of_steps(robot: RobotDescription) -> PlanSamples | None:
    """Return the plans of hops of a robot up and down, if it has any."""
    there = samples_file(robot, steps=True) is not None
    return samples_of_hops(robot, steps=True) if there else None


def level_reach(robot: RobotDescription) -> HopReach:
    """Return the reach of a robot's hops on level ground."""
    reach = samples_of_hops(robot).reach
    assert isinstance(reach, HopReach)
    return reach


def step_reach(robot: RobotDescription) -> StepReach:
    """Return the reach of a robot's hops up and down, which must have such plans."""
    reach = samples_of_hops(robot, steps=True).reach
    assert isinstance(reach, StepReach)
    return reach


def hop_table(plan: PlannedJump, robot: RobotDescription) -> JumpTable:
    """Return the plan as a table of few rows, which begins with the squat."""
    return reference_table(plan, robot, 0.0, COARSE_STEPS)


def standing_row(robot: RobotDescription) -> Array:
    """Return the row of a table in which the robot stands as every hop begins, (width,)."""
    first: Array = table_rows(hop_table(samples_of_hops(robot).plan(0), robot)).rows[0]
    return first
