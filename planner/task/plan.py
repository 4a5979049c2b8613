"""A planned jump as data, and the file it is kept in.

The file is NumPy's ``.npz``: one array a quantity and ``header``, a JSON text with the task, the
units, the names of joints, feet and contacts, what made the plan and whether it is valid. To read
it without any of this code::

    file = numpy.load("forward_10cm.npz")
    header, com = json.loads(str(file["header"])), file["com"]
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...runtime.language.errors import AloftError
from .files import write_whole
from .phase import Phase
from .task import JumpTask, JumpTaskError, make_task

FILE_FORMAT = "aloft jump plan 1"


class PlanFileError(AloftError, ValueError):
    """A file is no plan, or one of another format."""


class InvalidPlanError(AloftError):
    """A plan failed the validity check; the message names the tests that failed. ``plan`` is that
    plan with its report, to look at and not to run."""

    def __init__(self, message: str, plan: PlannedJump) -> None:
        super().__init__(message)
        self.plan = plan


@dataclass(frozen=True)
class PlannedJump:
    """A planned jump over N knots.

    The world's origin is the ground midway between the soles at the start, x forward; joints, feet
    and contacts are in the order of the robot's description. Velocities and accelerations are
    Pinocchio's: the base's linear and angular part in the body frame, then the joints.

    Rows of ``acceleration``, ``contact_force``, ``contact`` and ``joint_torque`` belong to the
    interval that begins with their knot; the last repeats the one before it. An interval of no
    length is an impact: velocities change, positions do not, and ``contact_force`` is an impulse
    [N s] there.

    Attributes:
        task: what was asked for.
        time: of the knots [s], from zero, never decreasing, (N,).
        position: base position [m], base quaternion x, y, z, w, joint angles [rad], (N, 7 + n).
        velocity: generalised velocity, (N, 6 + n).
        acceleration: its derivative, (N, 6 + n).
        contact_force: on the robot in the world [N], (N, n_contacts, 3).
        contact: which points carry load, (N, n_contacts).
        phase: ``Phase`` values of the intervals, (N,).
        joint_torque: [N m], (N, n).
        com, com_velocity: centre of mass in the world [m, m/s], (N, 3).
        angular_momentum: about it, world axes [N m s], (N, 3).
        lift_off_time, touchdown_time: of the first flight [s].
        later_flights: lift-off and touchdown times of the flights after it [s].
        statistics: how it was solved: solver, iterations, cpu_s, violation, cost and the like.
        versions: of the packages that made it.
        report: the validity report as plain data; empty until the plan is checked.
    """

    task: JumpTask
    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    contact_force: Array
    contact: NDArray[np.bool_]
    phase: NDArray[np.int64]
    joint_torque: Array
    com: Array
    com_velocity: Array
    angular_momentum: Array
    lift_off_time: float
    touchdown_time: float
    later_flights: tuple[tuple[float, float], ...] = ()
    statistics: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    report: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        knots = len(self.time)
        for name in ARRAYS:
            if len(getattr(self, name)) != knots:
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} rows, but the plan has {knots} knots"
                )
        if knots < 2 or np.any(self.steps < 0.0):
            raise ValueError("a plan needs two knots or more, with times that never decrease")

    @cached_property
    def steps(self) -> Array:
        """How long the intervals last [s], (N - 1,); those of impacts do not."""
        return np.asarray(self.time[1:] - self.time[:-1])

    @cached_property
    def lasting(self) -> NDArray[np.int64]:
        """The intervals that last."""
        return np.flatnonzero(self.steps > 0.0)

    @cached_property
    def flight_knots(self) -> tuple[tuple[int, int], ...]:
        """The knots at lift-off and at touchdown of every flight, the latter before any impact.

        Raises:
            ValueError: there are more or fewer flights than jumps.
        """
        flying = np.flatnonzero((self.phase[:-1] == Phase.FLIGHT) & (self.steps > 0.0))
        found = [
            (int(run[0]), int(run[-1]) + 1)
            for run in np.split(flying, np.flatnonzero(np.diff(flying) > 1) + 1)
            if len(run)
        ]
        jumps = len(self.task.hops())
        if len(found) != jumps:
            raise ValueError(
                f"a plan has a flight, of intervals one after the other, for every jump; found "
                f"{len(found)} for {jumps}"
            )
        return tuple(found)

    @property
    def duration(self) -> float:
        """Time from the first knot to the last [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def flights(self) -> tuple[tuple[float, float], ...]:
        """Lift-off and touchdown times of all flights [s]."""
        return ((self.lift_off_time, self.touchdown_time), *self.later_flights)

    @property
    def lift_off_times(self) -> tuple[float, ...]:
        """Starts of the flights [s]."""
        return tuple(start for start, _ in self.flights)

    @property
    def touchdown_times(self) -> tuple[float, ...]:
        """Ends of the flights [s]."""
        return tuple(end for _, end in self.flights)

    @property
    def flight_time(self) -> float:
        """Time from lift-off to touchdown of the first flight [s]."""
        return self.touchdown_time - self.lift_off_time

    @property
    def valid(self) -> bool:
        """True if the plan was checked and every test passed."""
        return bool(self.report.get("valid", False))

    def knot_at(self, time: float) -> int:
        """Return the last knot at or before ``time``, but for rounding."""
        return max(0, int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1)

    def with_report(self, report: Mapping[str, Any]) -> PlannedJump:
        """Return the same plan with that validity report."""
        return replace(self, report=dict(report))


ARRAYS = {
    "time": "s",
    "position": "m, unit quaternion x y z w, rad",
    "velocity": "m/s and rad/s in the body frame, rad/s",
    "acceleration": "m/s^2 and rad/s^2 in the body frame, rad/s^2",
    "contact_force": "N in the world frame",
    "contact": "true where the point carries load",
    "phase": "0 stand, 1 squat, 2 thrust, 3 flight, 4 landing, 5 recover",
    "joint_torque": "N m",
    "com": "m in the world frame",
    "com_velocity": "m/s in the world frame",
    "angular_momentum": "N m s about the centre of mass, world axes",
}
"""The arrays of a plan with their units, as they stand in the file."""

_SCALARS = tuple(f.name for f in fields(PlannedJump) if f.name not in (*ARRAYS, "task"))


def plan_bytes(plan: PlannedJump, names: Mapping[str, list[str]] | None = None) -> bytes:
    """Return the plan's file.

    The same task gives the same bytes, also from another process: no time of day, no processor
    time and no machine's name is in it.
    """
    statistics = {name: x for name, x in plan.statistics.items() if not name.endswith("cpu_s")}
    header = {
        "format": FILE_FORMAT,
        "task": plan.task.model_dump(mode="json"),
        **{name: getattr(plan, name) for name in _SCALARS},
        "statistics": statistics,
        "lift_off_times": list(plan.lift_off_times),
        "touchdown_times": list(plan.touchdown_times),
        "units": ARRAYS,
        "names": dict(names or {}),
    }
    arrays: dict[str, Any] = {name: np.asarray(getattr(plan, name)) for name in ARRAYS}
    memory = io.BytesIO()
    np.savez_compressed(memory, header=np.array(json.dumps(header, default=_plain)), **arrays)
    return memory.getvalue()


def motor_load(time: Array, joint_torque: Array, robot: RobotDescription) -> dict[str, float]:
    """Return the integral of the squared torque of every motor over a motion [N^2 m^2 s], by its name.

    Args:
        time: of the knots [s], (n,).
        joint_torque: from each of them to the next [N m], (n, n_joints).
    """
    torque = np.asarray(joint_torque[:-1] @ robot.torque_to_motor.T)
    load = (torque**2 * np.diff(time)[:, None]).sum(axis=0)
    return dict(zip(robot.transmission.motors, load.tolist(), strict=True))


def _plain(value: Any) -> Any:
    """Return NumPy's numbers and arrays as JSON has them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be kept in a plan file")


def write_plan(
    path: str | Path, plan: PlannedJump, names: Mapping[str, list[str]] | None = None
) -> Path:
    """Write the plan's file as a whole or not at all, replacing what is there.

    ``names`` may hold the names of ``joints``, ``feet`` and ``contacts``, for readers without the
    robot's description.
    """
    return write_whole(Path(path), plan_bytes(plan, names))


def task_of_header(header: Mapping[str, Any], where: str = "task") -> JumpTask:
    """Return the task of a plan's file, which holds all of it: in files from before there were recipes too.

    Raises:
        KeyError, TypeError, JumpTaskError: the header has no such task.
    """
    return make_task({"recipe": "paper", **header["task"]}, where=where)


def read_plan(path: str | Path) -> PlannedJump:
    """Return the plan in a file.

    Raises:
        PlanFileError: there is no file, it is broken, or it is of another format.
    """
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            header = json.loads(str(file["header"]))
            arrays = {name: file[name] for name in ARRAYS}
    except OSError as error:
        raise PlanFileError(f"cannot read {path}: {error.strerror or error}") from error
    except Exception as error:  # a damaged archive raises nearly anything: zlib.error, TokenError
        raise PlanFileError(f"{path} is no plan file: {error or type(error).__name__}") from error
    if not isinstance(header, dict):
        raise PlanFileError(f"{path} is no plan file: its header is no object")
    if header.get("format") != FILE_FORMAT:
        raise PlanFileError(
            f"{path} is of format {header.get('format')!r}, expected {FILE_FORMAT!r}; "
            "plan it anew with 'aloft plan'"
        )
    try:
        task = task_of_header(header, where=f"{path}: task")
        values = {name: header[name] for name in _SCALARS if name != "later_flights"}
        times = [(float(start), float(end)) for start, end in header.get("later_flights", [])]
        return PlannedJump(task=task, **arrays, **values, later_flights=tuple(times))
    except (KeyError, ValueError, TypeError, AttributeError, JumpTaskError) as error:
        raise PlanFileError(f"{path} is no plan file: {error}") from error
