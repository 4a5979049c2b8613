"""The load on each foot over time: the vertical forces on its contact points, added up.

A plot of every component of every contact force has a dozen lines in like colours. One line a foot
reads at a glance, so the viewer shows these first. The peak of a landing may be ten times the load
in stance; the plot's range shows the stance, and an event tells the peak.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ..file.changed_rows import ChangedRows
from ..file.format import PLOTS, Header, RecordedRows
from ..file.thinned_rows import ThinnedRows
from ..file.time_columns import time_columns
from .scene_contacts import GRAVITY

FOOT_FORCE = f"{PLOTS}/foot_force"
WEIGHT = f"{PLOTS}/weight"
"""The robot's weight, as a line in the same plot."""
COLORS = (
    0xFFA726FF, 0x26C6DAFF, 0xEC407AFF, 0xC0CA33FF, 0x7E57C2FF, 0x66BB6AFF,
)  # fmt: skip
GREY = 0x9E9E9EB0
RANGE = (-0.15, 3.0)
"""What the plot shows at first, in weights of the robot."""
AFTER_TOUCHDOWN = 0.1
"""How long after a touchdown its peak is looked for [s]."""


def weight_of(robot: RobotDescription) -> float:
    """The robot's weight [N]."""
    return GRAVITY * robot.total_mass


def loads_on_feet(robot: RobotDescription, force: Array) -> Array:
    """The vertical force on each foot [N], (n, n_feet), of forces on contacts (n, n_contacts, 3)."""
    foot = np.array(robot.foot_of_contact())
    columns = [force[:, foot == k, 2].sum(axis=1) for k in range(len(robot.feet))]
    return np.column_stack(columns)


class FootForces:
    """Writes ``plots/foot_force`` and ``plots/weight`` below ``root``, batch by batch."""

    def __init__(
        self,
        stream: Any,
        header: Header,
        force: str,
        root: str,
        picker: ChangedRows | ThinnedRows | None = None,
    ) -> None:
        assert header.robot is not None
        self._stream, self._header, self._robot = stream, header, header.robot
        self._force, self._root = force, root
        self._picker = picker

    def write_static(self) -> None:
        """Write names and colours."""
        import rerun as rr

        count = len(self._robot.feet)
        feet = rr.SeriesLines(
            names=[foot.name for foot in self._robot.feet],
            colors=np.array([COLORS[k % len(COLORS)] for k in range(count)], np.uint32),
            widths=[1.5] * count,
            aggregation_policy="Off",
        )
        self._stream.log(f"{self._root}{FOOT_FORCE}", feet, static=True)
        line = rr.SeriesLines(names=["weight"], colors=[GREY], aggregation_policy="Off")
        self._stream.log(f"{self._root}{WEIGHT}", line, static=True)

    def write(self, batch: RecordedRows) -> None:
        """Write the loads at every tick of a batch at which they change."""
        loads = loads_on_feet(self._robot, batch.signal(self._force))
        ticks = batch.ticks
        if self._picker is not None:
            ticks, loads = self._picker.pick(ticks, loads)
        self._send(FOOT_FORCE, ticks, loads)
        ends = batch.ticks[[0, -1]] if len(batch.ticks) > 1 else batch.ticks
        self._send(WEIGHT, ends, np.full((len(ends), 1), weight_of(self._robot)))

    def write_rest(self) -> None:
        """Write the last loads, if they were constant in the end."""
        rest = self._picker.rest() if self._picker is not None else None
        if rest is not None:
            self._send(FOOT_FORCE, *rest)

    def _send(self, entity: str, ticks: NDArray[np.int64], values: Array) -> None:
        import rerun as rr

        if len(ticks):
            columns = rr.Scalars.columns(scalars=np.ascontiguousarray(values))
            times = time_columns(self._header, ticks)
            self._stream.send_columns(f"{self._root}{entity}", times, columns)


class LandingPeaks:
    """Finds the largest load on a foot in the ``most`` ticks after each touchdown."""

    def __init__(self, robot: RobotDescription, most: int) -> None:
        self._robot, self._most = robot, most
        self._left = 0
        self._peak = (0.0, 0, "")

    def add(
        self, ticks: NDArray[np.int64], force: Array, touchdowns: list[int]
    ) -> list[tuple[int, str]]:
        """The events, as (tick, text), of further ticks (n,) with forces (n, n_contacts, 3)."""
        if not self._left and not touchdowns:
            return []
        events = []
        loads = loads_on_feet(self._robot, force)
        largest, which = loads.max(axis=1), loads.argmax(axis=1)
        for k, tick in enumerate(ticks.tolist()):
            if tick in touchdowns:
                self._left, self._peak = self._most, (0.0, tick, "")
            if self._left:
                if largest[k] > self._peak[0]:
                    self._peak = (float(largest[k]), tick, self._robot.feet[int(which[k])].name)
                self._left -= 1
                if not self._left and self._peak[2]:
                    force_, when, foot = self._peak
                    weights = force_ / weight_of(self._robot)
                    text = f"landing: {force_:.0f} N on {foot}, {weights:.1f} times the weight"
                    events.append((when, text))
        return events
