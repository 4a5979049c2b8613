"""A planned jump as a table over time, and the rotation of its flight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array, Array1D, Array2D, Flags1D, Flags2D
from ...robots.description import RobotDescription

COLUMNS = (
    "com", "com_velocity", "com_acceleration", "orientation", "angular_velocity", "angular_acceleration",
    "angular_momentum", "angular_momentum_rate", "foot_position", "foot_velocity", "foot_yaw", "foot_pitch",
    "joint_position", "joint_velocity", "joint_acceleration", "joint_torque",
)  # fmt: skip
"""The fields of ``JumpReference`` that a table has columns of, in the order of ``write_columns``."""
_COLUMN = "column "
_MARKS = ("squat_time", "thrust_time", "lift_off_time", "touchdown_time", "recover_time")
_FED_FORWARD = (
    "com_acceleration", "angular_acceleration", "angular_momentum_rate", "joint_acceleration",
    "joint_torque",
)  # fmt: skip


@dataclass(frozen=True)
class JumpTable:
    """A planned jump, row by row in time.

    Attributes:
        time: increasing times since the plan began [s], (n,). Two rows may share an instant
            where something jumps, such as the joint velocities at touchdown.
        columns: by the name of a ``JumpReference`` field its values over time, (n, ...).
        squat_time, thrust_time, lift_off_time, touchdown_time, recover_time: when the phases of
            these names begin, flight beginning with lift-off and landing with touchdown [s]; of the
            first jump, but for the last.
        later_jumps: when thrust, flight and landing of the jumps after the first begin [s].
        contact: by row which points carry load, (n, n_contacts); ``None``: all of them, but in
            flight.
    """

    time: Array
    columns: dict[str, Array]
    squat_time: float
    thrust_time: float
    lift_off_time: float
    touchdown_time: float
    recover_time: float
    later_jumps: tuple[tuple[float, float, float], ...] = ()
    contact: NDArray[np.bool_] | None = None

    def as_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Return all of it as arrays, for a file; ``from_arrays`` is the way back."""
        arrays: dict[str, NDArray[Any]] = {f"{_COLUMN}{n}": c for n, c in self.columns.items()}
        arrays["time"] = self.time
        arrays["marks"] = np.array([getattr(self, name) for name in _MARKS])
        arrays["later_jumps"] = np.array(self.later_jumps, dtype=np.float64).reshape(-1, 3)
        if self.contact is not None:
            arrays["contact"] = self.contact
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> JumpTable:
        """Return the table whose ``as_arrays`` these are."""
        columns = {
            name.removeprefix(_COLUMN): array
            for name, array in arrays.items()
            if name.startswith(_COLUMN)
        }
        squat, thrust, lift_off, touchdown, recover = arrays["marks"].tolist()
        later = tuple((float(a), float(b), float(c)) for a, b, c in arrays["later_jumps"])
        return cls(
            arrays["time"], columns, squat, thrust, lift_off, touchdown, recover, later,
            arrays.get("contact"),
        )  # fmt: skip


class TableRows(NamedTuple):
    """The columns of a table side by side, in the order of ``COLUMNS``.

    ``time`` (n,) [s]; ``rows`` (n, width); ``sums`` (n, width), the integrals of what is ``fed`` (width,)
    forward; ``marks`` (2,) [s], when the squat and when the recovery begins; ``jumps`` (n_jumps, 3) [s],
    when thrust, flight and landing begin, and ``touchdowns`` (n_jumps,) the last of these again;
    ``toes_first`` (n_jumps,), whether only some of the points carry load then;
    ``contact`` (n, n_contacts), or no row where all points carry load but in flight; and room for the
    ``values`` (width,) of an instant.
    """

    time: Array1D
    rows: Array2D
    sums: Array2D
    fed: Flags1D
    marks: Array1D
    jumps: Array2D
    touchdowns: Array1D
    toes_first: Flags1D
    contact: Flags2D
    values: Array1D


def table_rows(table: JumpTable) -> TableRows:
    """Return a table as ``read_table`` takes it."""
    n = len(table.time)
    columns = [table.columns[name].reshape(n, -1) for name in COLUMNS]
    fed = _fed([rows.shape[1] for rows in columns])
    rows = np.ascontiguousarray(np.concatenate(columns, axis=1), dtype=np.float64)
    first = (table.thrust_time, table.lift_off_time, table.touchdown_time)
    jumps = np.array([first, *table.later_jumps], dtype=np.float64)
    contact = np.zeros((0, 1), np.bool_) if table.contact is None else table.contact
    return TableRows(
        np.ascontiguousarray(table.time, dtype=np.float64), rows, integral(table.time, rows), fed,
        np.array([table.squat_time, table.recover_time]), jumps, jumps[:, 2].copy(),
        lands_in_part(table.time, contact, jumps[:, 2]), np.ascontiguousarray(contact),
        np.zeros(rows.shape[1]),
    )  # fmt: skip


def _fed(widths: Sequence[int]) -> NDArray[np.bool_]:
    """Return which columns are fed forward, where those of ``COLUMNS`` are so wide."""
    names = zip(COLUMNS, widths, strict=True)
    return np.concatenate([np.full(width, name in _FED_FORWARD) for name, width in names])


def fed_forward(n_feet: int, n_joints: int) -> NDArray[np.bool_]:
    """Return which columns of a robot's table are fed forward, (width,)."""
    feet = (3 * n_feet, 3 * n_feet, n_feet, n_feet)
    return _fed((3, 3, 3, 4, 3, 3, 3, 3, *feet, *(n_joints,) * 4))


def row_dimensions(robot: RobotDescription | None) -> dict[str, int]:
    """Return the dimension ``plan_width`` of blocks that have the rows of a table in their signals."""
    return (
        {}
        if robot is None
        else {"plan_width": len(fed_forward(len(robot.feet), len(robot.joints)))}
    )


def lands_in_part(times: Array, contact: NDArray[np.bool_], touchdowns: Array) -> NDArray[np.bool_]:
    """Return whether some points carry load right after each of the ``touchdowns`` [s], and others do not."""
    if not len(contact):
        return np.zeros(len(touchdowns), np.bool_)
    after = np.searchsorted(times, touchdowns, side="right")
    rows = contact[np.minimum(after, len(times) - 1)]
    return np.asarray(rows.any(axis=1) & ~rows.all(axis=1))


def integral(times: Array, rows: Array) -> Array:
    """Return the integral of rows (n, ...) that are linear between ``times`` (n,) up to each of them."""
    steps = np.diff(times).reshape(-1, *(1,) * (rows.ndim - 1))
    sums = np.zeros_like(rows)
    np.cumsum(0.5 * steps * (rows[1:] + rows[:-1]), axis=0, out=sums[1:])
    return sums


PITCH = 1
"""The axis of a somersault: the world's y axis, which is the body's too."""
WHOLE = math.pi
"""A flight that turns further than this [rad] is a somersault."""
TUCKED = 0.9
"""The legs are tucked from when the rate is this share of its greatest."""
OUT = 0.3
"""The legs are out when this share of the rate's way from its greatest to its last value is left."""
ROUNDING = 1e-9


class FlightRotation(NamedTuple):
    """The flight of a somersault as a rotation about the pitch axis.

    ``time`` (n,) [s] of the plan, from lift-off to touchdown. ``rate`` (n,) [rad/s], the angular momentum
    divided by the inertia of the whole robot in the plan's pose, without a sign. ``left`` (n,) [rad], its
    integral from then until touchdown. ``marks`` (4,): when the legs are tucked and when they are out
    again [s], the greatest rate [rad/s], and the direction, 1 forwards and -1 backwards.
    """

    time: Array1D
    rate: Array1D
    left: Array1D
    marks: Array1D


def flight_rotation(table: JumpTable, robot: RobotDescription) -> FlightRotation | None:
    """Return the rotation of a plan that turns over in its only flight; ``None`` for every other plan."""
    if table.later_jumps:
        return None
    first, end = (
        int(np.searchsorted(table.time, time - ROUNDING))
        for time in (table.lift_off_time, table.touchdown_time)
    )
    rows = slice(first, end + 1)  # a second row at touchdown is of after the impact
    momentum = table.columns["angular_momentum"][rows, PITCH]
    time, inertia = np.array(table.time[rows]), _inertia(table, rows, robot)
    direction = math.copysign(1.0, float(momentum.sum()))
    rate = np.asarray(direction * momentum / inertia)
    parts = 0.5 * np.diff(time) * (rate[1:] + rate[:-1])
    left = np.concatenate([np.cumsum(parts[::-1])[::-1], [0.0]])
    greatest, last = float(rate.max()), float(rate[-1])
    tucked = np.flatnonzero(rate >= TUCKED * greatest)
    folded = np.flatnonzero(rate - last >= OUT * (greatest - last))
    if left[0] < WHOLE or folded[-1] == len(rate) - 1:
        return None
    marks = np.array([time[tucked[0]], time[folded[-1]], greatest, direction])
    return FlightRotation(time, rate, left, marks)


def _inertia(table: JumpTable, rows: slice, robot: RobotDescription) -> Array:
    """Return the inertia of the whole robot about its pitch axis [kg m^2] in those rows."""
    from ..models.exact_dynamics import ExactDynamics  # which only somersaults need

    dynamics, spin = ExactDynamics(robot), np.zeros(6 + len(robot.joints))
    spin[3 + PITCH] = 1.0
    poses = zip(
        table.columns["orientation"][rows], table.columns["joint_position"][rows], strict=True
    )
    return np.array([
        dynamics.centroidal(np.concatenate([np.zeros(3), turn, joints]), spin)[2][PITCH]
        for turn, joints in poses
    ])  # fmt: skip
