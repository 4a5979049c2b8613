"""Plans a task or a grid of tasks for ``aloft plan`` and ``aloft jump``, with tables, JSON, pictures and the motion for
a recording."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.language.errors import ExitCode
from .output import number, print_error, print_json, say, stopped_by_signals, table
from .viewing import how_to_view

if TYPE_CHECKING:
    from rich.console import Console

    from ...logs.recording.motion_recording import MotionRecording
    from ...planner.library.library import PlanLibrary
    from ...planner.library.nearest_feasible import NearestFeasible
    from ...planner.task.files import PlanError
    from ...planner.task.plan import PlannedJump
    from ...planner.task.task import JumpTask
    from ...robots.description import RobotDescription
    from ...studies.batch.plan_grid import GridRow
    from .plain_console import Table


SHOWN_STATISTICS = ("solver", "iterations", "cpu_s", "violation", "cost", "warm")


def print_plan(
    screen: Console, plan: PlannedJump, robot: RobotDescription, *, tests: bool = True
) -> None:
    """Print what the recipe chose, what the plan does to ``robot``, how it was solved, and every test."""
    chosen = [
        (each["parameter"], _shown(each["value"]), each["why"])
        for each in plan.statistics.get("chosen", ())
    ]
    if chosen:
        title = f"{plan.task.name}: chosen by the recipe"
        screen.print(table(title, ("parameter", "value", "why"), chosen))
    figures = [(name, number(value)) for name, value in plan.report["figures"].items()]
    heat = winding_heat(plan, robot)
    hottest = max(heat, key=lambda motor: heat[motor])
    figures.append((f"winding_heat_j, {hottest}", number(heat[hottest])))
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


def winding_heat(plan: PlannedJump, robot: RobotDescription) -> dict[str, float]:
    """Compute the copper heat of each motor's winding from the first knot to the last [J], by the
    resistance and the torque constant that ``blocks.SafetyMonitor`` takes by default.

    A run also stands before and after: in simulation ``winding_heat_j`` of jumps of 12 cm is 10 J more.
    """
    from ...blocks.control.safety_monitor import SafetyMonitor
    from ...planner.task.plan import motor_load

    copper = SafetyMonitor.Params()
    each = copper.winding_resistance / copper.torque_constant**2
    load = motor_load(plan.time, plan.joint_torque, robot)
    return {motor: each * squared for motor, squared in load.items()}


def _shown(value: Any) -> str:
    """Format a choice of the recipe: a sequence of phases by their times."""
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
    plan: PlannedJump, robot: RobotDescription, path: Path | None, kept: bool, reason: str
) -> dict[str, Any]:
    """Return a plan as an entry of the JSON output."""
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
        "winding_heat_j": winding_heat(plan, robot),
        **plan.report,
    }


def failure(task: JumpTask, robot: RobotDescription, error: PlanError) -> dict[str, Any]:
    """Return a task that could not be planned as an entry of the JSON output."""
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
    """Return the nearest task that has a plan as part of the JSON output."""
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
    """Make one line for every task of the command line."""
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
    """Return a kept plan as an entry of the JSON output, from its file's header."""
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
    """Make one line for every kept plan."""
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
    """Return a line for every task of a grid that has no plan."""
    return [(row.task.name, row.reason.partition("\n")[0]) for row in rows]


def recorded_motion(plan: PlannedJump, robot: RobotDescription) -> MotionRecording:
    """Return the plan as a motion with time series, with an instant about every 10 ms."""
    from ...logs.recording.motion_recording import MotionRecording
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
    return MotionRecording(
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


def plan_grid(
    grid: Path,
    keep: Path | None,
    anew: bool,
    workers: int,
    cluster: str,
    screen: Console,
    as_json: bool,
) -> ExitCode:
    """Fill the library with a grid of tasks. If a signal stops it, print how much is done."""
    from ...planner.library.library import PlanLibrary
    from ...studies.batch.plan_grid import fill, read_grid, robot_of
    from .output import progress_bar

    tasks = read_grid(grid)
    library = PlanLibrary(robot_of(tasks), keep)
    there = library.hashes()
    missing = [task for task in tasks if task.hash(library.robot) not in there]
    counts = dict.fromkeys(("planned", "kept", "failed", "known"), 0)
    rows: list[GridRow] = []
    with stopped_by_signals() as received:
        if missing and not cluster:
            derive_once(library, missing, screen)
        with (
            progress_bar(screen, f"planning {len(tasks)} jumps", len(tasks)) as (bar, bar_task),
            closing(
                fill(tasks, library, workers=workers, cluster=cluster or None, again=anew)
            ) as results,
        ):
            for row in results:
                counts[row.outcome] += 1
                rows.append(row)
                text = ", ".join(f"{n} {what}" for what, n in counts.items() if n)
                bar.update(bar_task, advance=1, description=text)
    failed = [row for row in rows if row.outcome in ("failed", "known")]
    if failed:
        screen.print(table("", ("task", "why there is no plan"), failure_rows(failed)))
    reason = ", ".join(f"{n} {what}" for what, n in counts.items())
    code = ExitCode.NOT_SUCCESSFUL if failed else ExitCode.SUCCESS
    if received:
        code = ExitCode(128 + received[0])
        reason = (
            f"stopped by {received[0].name} after {len(rows)} of {len(tasks)}: {reason}; the same "
            "command goes on from here"
        )
    say(screen, f"{reason}; library: {library.folder}")
    if as_json:
        listed = [
            {
                "task": row.task.name,
                "outcome": row.outcome,
                "reason": row.reason,
                "path": str(row.path) if row.path else None,
            }
            for row in sorted(rows, key=lambda row: row.task.name)
        ]
        success = code == ExitCode.SUCCESS
        print_json({"success": success, "reason": reason, "counts": counts, "rows": listed})
    return code


def derive_once(library: PlanLibrary, tasks: list[JumpTask], screen: Console) -> None:
    """Derive functions before the workers start; otherwise each of them would derive the same ones."""
    from ...planner.solving.solve import make_problem
    from ...planner.task.files import PlanError
    from ...planner.task.task import JumpTaskError

    # In the plane and out of it there are other functions, and for every formulation.
    kinds = {(t.formulation, bool(t.distance_y or t.twist), t.impact): t for t in tasks}
    with screen.status("deriving the robot's functions, once") as status:

        def progress(text: str, done: int, total: int) -> None:
            status.update(f"{text} ({done} of {total})")

        for task in kinds.values():
            try:
                make_problem(task, library.robot, progress=progress)
            except (PlanError, JumpTaskError, ValueError):
                continue  # the task itself will say so


def plan_task(
    task: JumpTask, library: PlanLibrary, anew: bool, out: Path | None, nearest: bool,
    screen: Console, *, tests: bool = True,
) -> dict[str, Any]:  # fmt: skip
    """Plan one task, print and draw the plan, and return its row. Without ``tests`` those of a valid
    plan are not printed."""
    from ...planner.solving.solver_process import cpu_time
    from ...planner.task.files import PlanError
    from ...planner.task.plan import InvalidPlanError

    robot, started = library.robot, cpu_time()
    try:
        with screen.status(f"planning {task.name}") as status:
            found, kept = library.plan(task, solver_with_progress(status.update), anew=anew)
        reason = "kept from before" if kept else "planned"
    except InvalidPlanError as error:
        found, kept, reason = error.plan, False, str(error)
    except PlanError as error:
        print_error(str(error))
        row = failure(task, robot, error)
        spent = cpu_time() - started
        return row | (search_nearest(task, library, error.family, spent, screen) if nearest else {})
    row = plan_json(found, robot, library.path_of(task), kept, reason)
    row["cpu_s"] = None if kept else cpu_time() - started
    print_plan(screen, found, robot, tests=tests or not found.valid)
    if not found.valid:
        print_error(reason)
    if out is not None:
        row |= write_pictures(found, robot, out, screen)
    if row["path"]:
        say(screen, f"plan: {row['path']} ({reason})")
    if not found.valid and nearest:
        row |= search_nearest(task, library, "", cpu_time() - started, screen)
    return row


def search_nearest(
    task: JumpTask, library: PlanLibrary, family: str, spent: float, screen: Console
) -> dict[str, Any]:
    """Search the nearest task that has a plan, after so much processor time [s] was ``spent`` on it;
    keep that plan, and return it for the failed task's row."""
    from ...planner.library.nearest_feasible import nearest_feasible, seconds_left

    with screen.status("searching the nearest task that can be planned") as status:

        def progress(text: str) -> None:
            status.update(f"searching the nearest task that can be planned: {text}")

        found = nearest_feasible(
            task, library.robot, family=family, seconds=seconds_left(spent), progress=progress,
            library=library,
        )  # fmt: skip
    if found is None:
        say(screen, "a short search found no task near it that can be planned")
        return {"nearest": None}
    say(screen, found.text)
    return {"nearest": nearest_json(found, library.add(found.plan))}


def solver_with_progress(tell: Any) -> Any:
    """Return the planner, which prints what it is deriving."""
    from ...planner.solving.solve import solve_jump

    def make(
        task: JumpTask, robot: RobotDescription, warm_start: PlannedJump | None
    ) -> PlannedJump:
        def progress(text: str, done: int, total: int) -> None:
            tell(f"planning {task.name}: {text} ({done} of {total})")

        return solve_jump(task, robot, warm_start=warm_start, progress=progress)

    return make


def write_pictures(
    found: PlannedJump, robot: RobotDescription, out: Path, screen: Console
) -> dict[str, str]:
    """Write the picture and the recording of a plan."""
    from ...logs.recording.motion_recording import write_motion
    from ...planner.drawing.picture import write_picture

    name = found.task.name
    picture = write_picture(out / f"{name}.svg", found, robot)
    recording = write_motion(out / f"{name}.rrd", recorded_motion(found, robot), name)
    say(screen, f"picture: {picture}")
    say(screen, f"recording: {recording}; to see it: {how_to_view(recording)}")
    return {"picture": str(picture), "recording": str(recording)}
