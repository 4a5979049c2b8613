"""What ``aloft plan`` shows of a plan: tables, JSON, and the motion for a recording."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .output import number, table

if TYPE_CHECKING:
    from rich.console import Console

    from ..blocks.planner.errors import PlanError
    from ..blocks.planner.grid import GridRow
    from ..blocks.planner.plan import JumpPlan
    from ..blocks.planner.task import JumpTask
    from ..logs.motion_recording import RecordedMotion
    from ..runtime.description import RobotDescription

SHOWN_STATISTICS = ("solver", "iterations", "cpu_s", "violation", "cost", "warm")


def print_plan(screen: Console, plan: JumpPlan) -> None:
    """Print what the plan does, how it was solved, and every test."""
    figures = [(name, number(value)) for name, value in plan.report["figures"].items()]
    figures += [
        (name, number(plan.statistics[name]))
        for name in SHOWN_STATISTICS
        if name in plan.statistics
    ]
    screen.print(table(f"{plan.task.name}: the plan", ("figure", ">value"), figures))
    rows = [
        (
            test["name"],
            "yes" if test["passed"] else "NO",
            f"{test['value']:.3g}",
            f"{test['limit']:.3g}",
            test["unit"],
            test["where"],
        )
        for test in plan.report["tests"]
    ]
    columns = ("test", "passed", ">found", ">allowed", "unit", "where")
    screen.print(table(f"{plan.task.name}: validity", columns, rows))


def plan_json(
    plan: JumpPlan, robot: RobotDescription, path: Path | None, kept: bool, reason: str
) -> dict[str, Any]:
    """A plan as an entry of the JSON output."""
    return {
        "task": plan.task.name,
        "success": plan.valid,
        "reason": reason,
        "hash": plan.task.hash(robot),
        "path": str(path) if path else None,
        "kept": kept,
        "cpu_s": plan.statistics.get("cpu_s"),
        "statistics": dict(plan.statistics),
        **plan.report,
    }


def failure(task: JumpTask, robot: RobotDescription, error: PlanError) -> dict[str, Any]:
    """A task that could not be planned as an entry of the JSON output."""
    return {
        "task": task.name,
        "success": False,
        "reason": str(error),
        "hash": task.hash(robot),
        "path": None,
        "family": error.family,
        "violation": error.violation,
    }


def failure_rows(rows: Sequence[GridRow]) -> list[tuple[str, str]]:
    """A line for every task of a grid that has no plan."""
    return [(row.task.name, row.reason.partition("\n")[0]) for row in rows]


def recorded_motion(plan: JumpPlan, robot: RobotDescription) -> RecordedMotion:
    """The plan with its series, every 10 ms or so."""
    from ..blocks.planner.evidence import Evidence
    from ..blocks.planner.plan_tests import allowed_motor_torque
    from ..blocks.planner.reference_table import reference_table
    from ..blocks.planner.replay import replay
    from ..logs.motion_recording import RecordedMotion

    evidence = Evidence(plan, robot, replay(plan, robot))
    samples = evidence.replay.samples
    # Between knots the centre follows its parabola, which the reference's rows have.
    dense = reference_table(plan, robot, stand_time=1.0)
    com = dense.columns["com"]
    com = np.array([np.interp(samples.time, dense.time - 1.0, com[:, k]) for k in range(3)]).T
    momentum = np.array(
        [np.interp(samples.time, plan.time, plan.angular_momentum[:, axis]) for axis in range(3)]
    ).T
    share = np.abs(evidence.motor_torque) / np.maximum(allowed_motor_torque(evidence, 1.0), 1e-3)
    motors, contacts = robot.transmission.motors, [c.name for c in robot.contacts]
    force = plan.contact_force[samples.knot]
    return RecordedMotion(
        robot=robot,
        time=samples.time,
        base_position=samples.position[:, :3],
        base_orientation=samples.position[:, 3:7],
        joint_position=samples.position[:, 7:],
        com=com,
        contact_position=samples.points,
        contact_force=force,
        series={
            "centre of mass [m]": (com, ("x", "y", "z")),
            "angular momentum [N m s]": (momentum, ("roll", "pitch", "yaw")),
            "vertical force [N]": (force[:, :, 2], contacts),
            "motor torque [share of what the speed allows]": (np.minimum(share, 2.0), motors),
            "motor speed [rad per s]": (evidence.motor_speed, motors),
            "foot height [m]": (samples.points[:, :, 2], contacts),
        },
        events=[
            (time, what)
            for flight in plan.flights
            for time, what in zip(flight, ("lift-off", "touchdown"), strict=True)
        ],
        properties={
            "task": json.dumps(plan.task.model_dump(mode="json")),
            "statistics": json.dumps(dict(plan.statistics), default=str),
            "valid": str(plan.valid),
        },
    )
