"""What ``aloft plan`` shows of a plan: tables, JSON, and the motion for a recording."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..shared.output import number, table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from ...logs.recording.motion_recording import RecordedMotion
    from ...planner.library.nearest_feasible import NearestFeasible
    from ...planner.task.errors import PlanError
    from ...planner.task.plan import JumpPlan
    from ...planner.task.task import JumpTask
    from ...robots.description import RobotDescription
    from ...studies.batch.plan_grid import GridRow

SHOWN_STATISTICS = ("solver", "iterations", "cpu_s", "violation", "cost", "warm")


def print_plan(screen: Console, plan: JumpPlan, *, tests: bool = True) -> None:
    """Print what the recipe chose, what the plan does, how it was solved, and every test."""
    chosen = [
        (each["parameter"], _shown(each["value"]), each["why"])
        for each in plan.statistics.get("chosen", ())
    ]
    if chosen:
        title = f"{plan.task.name}: chosen by the recipe"
        screen.print(table(title, ("parameter", "value", "why"), chosen))
    figures = [(name, number(value)) for name, value in plan.report["figures"].items()]
    figures += [
        (name, number(plan.statistics[name]))
        for name in SHOWN_STATISTICS
        if name in plan.statistics
    ]
    screen.print(table(f"{plan.task.name}: the plan", ("figure", ">value"), figures))
    if not tests:
        return
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


def _shown(value: Any) -> str:
    """What the recipe chose, as text: a sequence of phases by their times."""
    if isinstance(value, list):
        return ", ".join(
            f"{span['phase']}{' on ' + span['contacts'] if span['contacts'] != 'all' else ''}"
            + (f" {span['time']:g} s" if "time" in span else "")
            for span in value
        )
    if isinstance(value, dict) and "thrust" in value:
        return ", ".join(f"{count} {name}" for name, count in value.items())
    if isinstance(value, dict):
        return ", ".join(f"{name} {low:g} to {high:g} rad" for name, (low, high) in value.items())
    return number(value) if isinstance(value, float) else str(value).lower()


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
        "chosen": list(plan.statistics.get("chosen", ())),
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


def nearest_json(found: NearestFeasible, path: Path) -> dict[str, Any]:
    """The nearest task that has a plan as part of the JSON output."""
    return {
        "parameter": found.parameter,
        "asked": found.asked,
        "value": found.value,
        "beyond": found.beyond,
        "others": {
            name: dict(zip(("asked", "value", "beyond"), way, strict=True))
            for name, way in found.others.items()
        },
        "text": found.text,
        "binds": list(found.binds),
        "solves": found.solves,
        "cpu_s": found.cpu_s,
        "path": str(path),
    }


def summary(rows: Sequence[Mapping[str, Any]]) -> Table:
    """One line for every task of the command line."""
    cells = []
    for row in rows:
        figures = row.get("figures", {})
        names = ("rise_m", "flight_time_s", "peak_motor_torque_N_m", "peak_motor_speed_rad_s")
        shown = [number(figures[name]) if name in figures else "" for name in names]
        cpu = row.get("cpu_s")
        took = "" if cpu is None else number(cpu)
        first = str(row["reason"]).partition("\n")[0]
        cells.append((row["task"], "yes" if row["success"] else "NO", *shown, took, first))
    columns = (
        "task", "valid", ">rise [m]", ">flight [s]", ">torque [N m]", ">speed [rad/s]",
        ">CPU [s]", "what came of it",
    )  # fmt: skip
    return table("", columns, cells)


def listed_row(path: Path, header: Mapping[str, Any]) -> dict[str, Any]:
    """A kept plan as an entry of the JSON output, from its file's header."""
    report = header.get("report") or {}
    return {
        "task": header.get("task", {}).get("name", ""),
        "hash": path.stem.rpartition("-")[2],
        "path": str(path),
        "valid": bool(report.get("valid", False)),
        "asked": header.get("task", {}),
        "figures": report.get("figures", {}),
    }


def listing(rows: Sequence[Mapping[str, Any]]) -> Table:
    """One line for every kept plan."""
    cells = []
    for row in rows:
        asked = [f"{100 * (row['asked'].get(name) or 0.0):.4g}" for name in
                 ("rise", "distance_x", "distance_y", "landing_height")]  # fmt: skip
        twist = f"{np.degrees(row['asked'].get('twist') or 0.0):.4g}"
        folder = str(Path(row["path"]).parent)
        cells.append(
            (row["task"], "yes" if row["valid"] else "NO", *asked, twist, row["hash"], folder)
        )
    columns = (
        "task", "valid", ">rise [cm]", ">ahead [cm]", ">left [cm]", ">up [cm]", ">twist [deg]",
        "hash", "folder",
    )  # fmt: skip
    return table("", columns, cells)


def failure_rows(rows: Sequence[GridRow]) -> list[tuple[str, str]]:
    """A line for every task of a grid that has no plan."""
    return [(row.task.name, row.reason.partition("\n")[0]) for row in rows]


def recorded_motion(plan: JumpPlan, robot: RobotDescription) -> RecordedMotion:
    """The plan as a motion with time series, with an instant about every 10 ms."""
    from ...logs.recording.motion_recording import RecordedMotion
    from ...planner.checking.evidence import Evidence
    from ...planner.checking.plan_tests import allowed_motor_torque
    from ...planner.checking.replay import replay
    from ...planner.library.reference_table import reference_table

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
