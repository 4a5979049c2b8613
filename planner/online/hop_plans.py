"""The plans of hops that ship with a robot, and what blocks take from them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...runtime.language.block import UnmetRequirement
from ..library.jump_table import COLUMNS, JumpTable
from ..library.library import SHIPPED
from ..library.reference_table import COARSE_STEPS, reference_table
from ..task.plan import PlannedJump
from .plan_samples import PlanSamples, read_samples


def samples_path(robot: str) -> Path:
    """Where the plans of hops of a robot ship."""
    return SHIPPED / "hops" / f"{robot}.npz"


def missing_plans(robot: RobotDescription) -> Iterator[UnmetRequirement]:
    """What a block that needs the plans of hops of a robot does not have."""
    path = samples_path(robot.name)
    if path.is_file():
        return
    there = sorted(file.stem for file in path.parent.glob("*.npz"))
    yield UnmetRequirement(
        f"there are no stored plans of hops for {robot.name}",
        expected=f"a robot with such plans: {', '.join(there)}",
        found=robot.name,
        fix=f"robot: {there[0]}, as a key of the graph" if there else "",
    )


@lru_cache(maxsize=4)
def shipped_samples(robot: str) -> PlanSamples:
    """The plans of hops of a robot.

    Raises:
        PlanFileError: there are none, or the file is broken.
    """
    return read_samples(samples_path(robot))


def hop_table(plan: PlannedJump, robot: RobotDescription) -> JumpTable:
    """The plan as a table of few rows, which begins with the squat."""
    return reference_table(plan, robot, 0.0, COARSE_STEPS)


def side_by_side(table: JumpTable) -> Array:
    """The columns of a table in the order of ``COLUMNS``, (n, width)."""
    n = len(table.time)
    return np.concatenate([table.columns[name].reshape(n, -1) for name in COLUMNS], axis=1)


def standing_row(robot: RobotDescription) -> Array:
    """The row of a table in which the robot stands as every hop begins, (width,)."""
    table = hop_table(shipped_samples(robot.name).plan(0), robot)
    return np.asarray(side_by_side(table)[0])
