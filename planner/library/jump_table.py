"""A planned jump as a table over time, and how a reference is read from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import JumpReference, Phase
from ...mathematics.kernel import kernel
from ...mathematics.rotations import normalise

Array = NDArray[np.float64]

_FED_FORWARD = (
    "com_acceleration", "angular_momentum_rate", "joint_acceleration", "joint_torque",
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


class JumpTableReader:
    """Writes the reference of any instant of a table without allocating."""

    def __init__(self, table: JumpTable) -> None:
        self._table = table
        self._time = table.time
        self._columns = list(table.columns.items())
        self._scratch = {name: np.zeros(rows.shape[1:]) for name, rows in self._columns}
        self._ahead = {name: np.zeros(rows.shape[1:]) for name, rows in self._columns}
        self._sums = {
            name: integral(self._time, rows) for name, rows in self._columns if name in _FED_FORWARD
        }
        first = (table.thrust_time, table.lift_off_time, table.touchdown_time)
        self._jumps = [first, *table.later_jumps]
        self._touchdowns = np.array([jump[2] for jump in self._jumps])

    def read(
        self, time: float, reference: JumpReference, lead: float = 0.0, hold: float = 0.0
    ) -> None:
        """The reference at ``time``; before the table its first row, after it its last.

        Lift-off and touchdown times are those of the next flight, and from its middle on those of
        the one behind it: whoever lands, early or late, knows by them that it goes on.

        What a controller feeds forward, the acceleration, the rate of angular momentum and the
        torques, is that of ``lead`` seconds later; with ``hold`` its mean over so many seconds
        from then on, because a command holds until the next one. So a thrust that ends between two
        commands ends with the right momentum.
        """
        table = self._table
        here, there = locate(self._time, time), locate(self._time, time + lead)
        for name, rows in self._columns:
            out, scratch = getattr(reference, name), self._scratch[name]
            if hold > 0.0 and name in _FED_FORWARD:
                self._mean(name, rows, time + lead, hold, out)
                continue
            row, share = there if name in _FED_FORWARD else here
            np.subtract(rows[row + 1], rows[row], out=scratch)
            np.multiply(scratch, share, out=scratch)
            np.add(rows[row], scratch, out=out)
        normalise(reference.orientation, reference.orientation)
        jump = present_jump(time, self._touchdowns)
        thrust, lift_off, touchdown = self._jumps[jump]
        phase = planned_phase(
            time, table.squat_time, thrust, lift_off, touchdown, table.recover_time
        )
        if jump and phase < Phase.THRUST:  # between two jumps it has landed, and does not squat
            phase = int(Phase.LANDING)
        reference.time[()] = time
        reference.phase[()] = phase
        if jump + 1 < len(self._jumps) and time >= 0.5 * (lift_off + touchdown):
            _, lift_off, touchdown = self._jumps[jump + 1]
        reference.lift_off_time[()] = lift_off
        reference.touchdown_time[()] = touchdown
        reference.contact[...] = phase != Phase.FLIGHT
        if table.contact is not None and phase != Phase.FLIGHT:
            reference.contact[...] = table.contact[here[0]]

    def _mean(self, name: str, rows: Array, begin: float, hold: float, out: Array) -> None:
        """The mean of a column from ``begin`` on over ``hold`` seconds."""
        scratch, ahead = self._scratch[name], self._ahead[name]
        self._sum_to(name, rows, begin + hold, ahead)
        self._sum_to(name, rows, begin, out)
        np.subtract(ahead, out, out=scratch)
        np.divide(scratch, hold, out=out)

    def _sum_to(self, name: str, rows: Array, time: float, out: Array) -> None:
        """The integral of a column, linear between its rows, from its first row to ``time``."""
        scratch, times = self._scratch[name], self._time
        row, share = locate(times, time)
        length = float(times[row + 1]) - float(times[row])
        np.subtract(rows[row + 1], rows[row], out=scratch)
        np.multiply(scratch, 0.5 * share, out=scratch)
        np.add(scratch, rows[row], out=scratch)
        np.multiply(scratch, share * length, out=scratch)
        np.add(self._sums[name][row], scratch, out=out)
        outside = time - min(max(time, float(times[0])), float(times[-1]))
        if outside:
            np.multiply(rows[0 if outside < 0.0 else -1], outside, out=scratch)
            np.add(out, scratch, out=out)


def integral(times: Array, rows: Array) -> Array:
    """The integral of rows (n, ...) that are linear between ``times`` (n,) up to each of them."""
    steps = np.diff(times).reshape(-1, *(1,) * (rows.ndim - 1))
    sums = np.zeros_like(rows)
    np.cumsum(0.5 * steps * (rows[1:] + rows[:-1]), axis=0, out=sums[1:])
    return sums


@kernel
def locate(times: Array, time: float) -> tuple[int, float]:
    """The row before ``time`` and the share of the way from it to the next, from 0 to 1."""
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
    return low, (time - float(times[low])) / (float(times[high]) - float(times[low]))


@kernel
def present_jump(time: float, touchdowns: Array) -> int:
    """The jump that is under way or comes next, by when the jumps end; behind the last one that."""
    number = 0
    while number + 1 < touchdowns.shape[0] and time >= float(touchdowns[number]):
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
    """The phase a plan is in at ``time``, from when its phases begin."""
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
