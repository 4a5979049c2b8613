"""A planned jump as a table over time, and how a reference is read from it: ``read_table``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import JumpReference, Phase
from ...mathematics.arrays import Array, Array1D, Array2D, Flags1D, Flags2D
from ...mathematics.kernel import kernel
from ...mathematics.rotations import normalise
from ...robots.description import RobotDescription
from ..models.exact_dynamics import ExactDynamics

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


@kernel
def integrate_rows(table: TableRows) -> None:
    """Write the sums of a table whose rows have changed in a tick, as ``integral`` does before a run."""
    for k in range(table.rows.shape[1]):
        table.sums[0, k] = 0.0
    for row in range(1, table.rows.shape[0]):
        half = 0.5 * (table.time[row] - table.time[row - 1])
        for k in range(table.rows.shape[1]):
            risen = half * (table.rows[row, k] + table.rows[row - 1, k])
            table.sums[row, k] = table.sums[row - 1, k] + risen


@kernel
def read_table(
    table: TableRows, time: float, lead: float, hold: float, reference: JumpReference
) -> None:
    """Write the reference at ``time`` [s]; before the table its first row, after it its last.

    Lift-off and touchdown times are those of the next flight, and from its middle on those of
    the one behind it: whoever lands, early or late, knows by them that it goes on.

    What a controller feeds forward, accelerations, the rate of angular momentum and the
    torques, is that of ``lead`` seconds later; with ``hold`` its mean over so many seconds
    from then on, because a command holds until the next one. So a thrust that ends between two
    commands ends with the right momentum.
    """
    interpolate_rows(table, time, lead, hold, table.values)
    write_columns(table.values, reference)
    write_marks(table, time, reference)


@kernel
def sum_to(table: TableRows, time: float, sign: float, out: Array1D) -> None:
    """Add ``sign`` times the integral of what is fed forward, from the first row to ``time``.

    Between its rows a column is linear.
    """
    rows, last = table.rows, table.rows.shape[0] - 1
    row, share = locate(table.time, time)
    length = table.time[row + 1] - table.time[row]
    outside = time - min(max(time, table.time[0]), table.time[last])
    beyond = 0 if outside < 0.0 else last
    for k in range(out.shape[0]):
        if not table.fed[k]:
            continue
        risen = (rows[row + 1, k] - rows[row, k]) * (0.5 * share)
        part = (risen + rows[row, k]) * (share * length)
        total = table.sums[row, k] + part
        if outside != 0.0:
            total += rows[beyond, k] * outside
        out[k] += sign * total


@kernel
def interpolate_rows(table: TableRows, time: float, lead: float, hold: float, out: Array1D) -> None:
    """Interpolate all columns at ``time``; the fed-forward ones follow ``read_table``."""
    rows = table.rows
    here, part = locate(table.time, time)
    there, later = locate(table.time, time + lead)
    for k in range(out.shape[0]):
        row, share = (there, later) if table.fed[k] else (here, part)
        if table.fed[k] and hold > 0.0:
            out[k] = 0.0
            continue
        out[k] = rows[row, k] + (rows[row + 1, k] - rows[row, k]) * share
    if hold > 0.0:
        sum_to(table, time + lead + hold, 1.0, out)
        sum_to(table, time + lead, -1.0, out)
        for k in range(out.shape[0]):
            if table.fed[k]:
                out[k] /= hold


@kernel
def take(values: Array1D, first: int, out: Array1D) -> int:
    """Fill ``out`` with the values from ``first`` on; returns where the next ones begin."""
    for k in range(out.shape[0]):
        out[k] = values[first + k]
    return first + len(out)


@kernel
def take_rows(values: Array1D, first: int, out: Array2D) -> int:
    """Fill the rows of ``out`` as ``take`` does."""
    for row in range(out.shape[0]):
        first = take(values, first, out[row])
    return first


@kernel
def write_columns(values: Array1D, reference: JumpReference) -> None:
    """Write the values of all ``COLUMNS`` to the fields of the reference."""
    first = take(values, 0, reference.com)
    first = take(values, first, reference.com_velocity)
    first = take(values, first, reference.com_acceleration)
    first = take(values, first, reference.orientation)
    first = take(values, first, reference.angular_velocity)
    first = take(values, first, reference.angular_acceleration)
    first = take(values, first, reference.angular_momentum)
    first = take(values, first, reference.angular_momentum_rate)
    first = take_rows(values, first, reference.foot_position)
    first = take_rows(values, first, reference.foot_velocity)
    first = take(values, first, reference.foot_yaw)
    first = take(values, first, reference.foot_pitch)
    first = take(values, first, reference.joint_position)
    first = take(values, first, reference.joint_velocity)
    first = take(values, first, reference.joint_acceleration)
    take(values, first, reference.joint_torque)
    normalise(reference.orientation, reference.orientation)


@kernel
def write_marks(table: TableRows, time: float, reference: JumpReference) -> None:
    """Write the phase, the times of the flight, and which points carry load."""
    jump = present_jump(time, table.touchdowns)
    thrust, lift_off = table.jumps[jump, 0], table.jumps[jump, 1]
    touchdown = table.jumps[jump, 2]
    squat, recover = table.marks[0], table.marks[1]
    phase = planned_phase(time, squat, thrust, lift_off, touchdown, recover)
    if jump > 0 and phase < Phase.THRUST:  # between two jumps it has landed, and does not squat
        phase = Phase.LANDING
    reference.time = time
    reference.phase = phase
    if jump + 1 < table.jumps.shape[0] and time >= 0.5 * (lift_off + touchdown):
        lift_off, touchdown = table.jumps[jump + 1, 1], table.jumps[jump + 1, 2]
    reference.lift_off_time = lift_off
    reference.touchdown_time = touchdown
    reference.toes_first = table.toes_first[jump]
    row, _ = locate(table.time, time)
    for point in range(reference.contact.shape[0]):
        planned = table.contact.shape[0] == 0 or bool(table.contact[row, point])
        reference.contact[point] = phase != Phase.FLIGHT and planned


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


@kernel
def locate(times: Array1D, time: float) -> tuple[int, float]:
    """Return the row before ``time`` and the share of the way from it to the next, from 0 to 1."""
    low, high = 0, times.shape[0] - 1
    if time <= times[0]:
        return 0, 0.0
    if time >= times[high]:
        return high - 1, 1.0
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= time:
            low = middle
        else:
            high = middle
    return low, (time - times[low]) / (times[high] - times[low])


@kernel
def present_jump(time: float, touchdowns: Array1D) -> int:
    """Return the jump that is under way or comes next, by when the jumps end; behind the last one that."""
    number = 0
    while number + 1 < touchdowns.shape[0] and time >= touchdowns[number]:
        number += 1
    return number


@kernel
def planned_phase(
    time: float,
    squat_time: float,
    thrust_time: float,
    lift_off_time: float,
    touchdown_time: float,
    recover_time: float,
) -> int:
    """Return the phase a plan is in at ``time``, from when its phases begin."""
    if time < squat_time:
        return 0
    if time < thrust_time:
        return 1
    if time < lift_off_time:
        return 2
    if time < touchdown_time:
        return 3
    if time < recover_time:
        return 4
    return 5


PITCH = 1
"""The axis of a somersault: the world's y axis, which is the body's too."""
WHOLE = math.pi
"""A flight that turns further than this [rad] is a somersault."""
TUCKED = 0.9
"""The legs are tucked from when the rate is this share of its greatest."""
OUT = 0.3
"""They are out when this share of the rate's way from its greatest to its last value is left."""
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
    dynamics, spin = ExactDynamics(robot), np.zeros(6 + len(robot.joints))
    spin[3 + PITCH] = 1.0
    poses = zip(
        table.columns["orientation"][rows], table.columns["joint_position"][rows], strict=True
    )
    return np.array([
        dynamics.centroidal(np.concatenate([np.zeros(3), turn, joints]), spin)[2][PITCH]
        for turn, joints in poses
    ])  # fmt: skip
