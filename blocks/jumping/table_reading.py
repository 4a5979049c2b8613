"""Reads a reference from the table of a planned jump: ``read_table``."""

from __future__ import annotations

from ...mathematics.arrays import Array1D, Array2D
from ...mathematics.kernel import kernel
from ...mathematics.rotations import normalise
from ...planner.library.jump_table import TableRows
from ..signals import JumpReference, Phase


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
    """Interpolate all columns at ``time``; the fed-forward ones as by ``read_table``."""
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
