"""Common parts of all drawing: the amount of a run that is drawn, and the choice of values, times
and places.

A viewer joins neighbouring values by straight lines. So ``ThinnedRows`` leaves out values that lie on
the line between those around them, but for less than one can see. Every value that is written is
exact; a peak is the value farthest from any line, so it is among them. ``ChangedRows`` leaves out a
value that has the same bits as the values of the tick before and of the tick after. Where a signal
does not change, the first and the last of the equal values are written: the force on a foot in
flight is drawn as the zero that it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.kinematics import LinkPoses, link_poses
from ...robots.robot_description import RobotDescription
from ..file.format import Header, RecordedRows, time_columns
from .robot_shapes import scale_of
from .scene_ports import PoseSource, ScenePorts


class ChangedRows:
    """Chooses the values of one signal, batch by batch. The ticks must come in order."""

    def __init__(self) -> None:
        self._tick: NDArray[np.int64] | None = None
        self._value: NDArray[Any] | None = None
        self._left_out = False

    def pick(
        self, ticks: NDArray[np.int64], values: NDArray[Any]
    ) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """Return the ticks (m,) and values (m, k) to write of a batch: ``ticks`` (n,), ``values``
        (n, k)."""
        changed = self._changes(values)
        needed = changed.copy()
        needed[:-1] |= changed[1:]
        last_tick, last_value = self._tick, self._value
        before = bool(changed[0]) and self._left_out
        self._tick, self._value = ticks[-1:].copy(), values[-1:].copy()
        self._left_out = not needed[-1]
        if not needed.all():
            ticks, values = ticks[needed], values[needed]
        if before:  # the end of a constant stretch, which nobody knew to be one
            assert last_tick is not None and last_value is not None
            return np.concatenate([last_tick, ticks]), np.concatenate([last_value, values])
        return ticks, values

    def rest(self) -> tuple[NDArray[np.int64], NDArray[Any]] | None:
        """Return the last tick and value, if they were left out. They are written when no more
        ticks come."""
        if not self._left_out or self._tick is None or self._value is None:
            return None
        self._left_out = False
        return self._tick, self._value

    def _changes(self, values: NDArray[Any]) -> NDArray[np.bool_]:
        """Tell which of ``values`` (n, k) have other bits than the one before, (n,)."""
        whole = f"i{values.itemsize}"  # as -0.0 equals 0.0, and no NaN itself
        bits = np.ascontiguousarray(values).view(whole)
        changed = np.ones(len(bits), np.bool_)
        changed[1:] = (bits[1:] != bits[:-1]).any(axis=1)
        if self._value is not None:
            changed[0] = bool((bits[0] != self._value.view(whole)[0]).any())
        return changed


class ThinnedRows:
    """Chooses the values of one signal, batch by batch. The ticks must come in order.

    Args:
        tolerance: how far a value that is left out may be from the line that is drawn instead, as a
            share of the range of all elements of the signal so far.
    """

    def __init__(self, tolerance: float) -> None:
        self._changed, self._tolerance = ChangedRows(), tolerance
        self._least, self._most = np.inf, -np.inf

    def pick(
        self, ticks: NDArray[np.int64], values: NDArray[Any]
    ) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """Return the ticks (m,) and values (m, k) to write of a batch: ``ticks`` (n,), ``values``
        (n, k)."""
        ticks, values = self._changed.pick(ticks, values)
        numbers = values.astype(np.float64)
        if len(ticks) < 3 or not numbers.size or not np.isfinite(numbers).all():
            return ticks, values
        self._least = min(self._least, float(numbers.min()))
        self._most = max(self._most, float(numbers.max()))
        needed = on_lines(ticks, numbers, self._tolerance * (self._most - self._least))
        return ticks[needed], values[needed]

    def rest(self) -> tuple[NDArray[np.int64], NDArray[Any]] | None:
        """Return the last tick and value, if they were left out. They are written when no more
        ticks come."""
        return self._changed.rest()


def on_lines(
    ticks: NDArray[np.int64], values: NDArray[np.float64], tolerance: float
) -> NDArray[np.bool_]:
    """Mark those of ``values`` (n, k) at ``ticks`` (n,) that must be joined by lines, (n,), so that
    no other value is farther than ``tolerance`` from them (Ramer, Douglas and Peucker, vertical
    distance).

    The first and the last are among them, and both ends of each stretch of equal values.
    """
    needed = np.zeros(len(ticks), np.bool_)
    needed[[0, -1]] = True
    equal = (values[1:] == values[:-1]).all(axis=1)
    needed[1:] |= equal
    needed[:-1] |= equal
    ends = np.flatnonzero(needed).tolist()
    open_stretches = [(a, b) for a, b in pairwise(ends) if b - a > 1]
    while open_stretches:
        a, b = open_stretches.pop()
        share = (ticks[a + 1 : b] - ticks[a]) / (ticks[b] - ticks[a])
        line = values[a] + share[:, None] * (values[b] - values[a])
        away = np.abs(values[a + 1 : b] - line).max(axis=1)
        farthest = int(away.argmax())
        if away[farthest] > tolerance:
            middle = a + 1 + farthest
            needed[middle] = True
            open_stretches += [(c, d) for c, d in ((a, middle), (middle, b)) if d - c > 1]
    return needed


@dataclass(frozen=True)
class Detail:
    """The level of detail of a drawing.

    Attributes:
        main_only: only the curves and lanes that the viewer shows first; else those of every field
            with at most ``most`` elements, such as are no mass matrices.
        tolerance: how far a curve may be from a value that is left out, as a share of the signal's
            range; without it, only values are left out that do not change.
        row_rate: how often a value is taken [Hz]; by default in every tick.
        picture_rate: how often the scene in 3D is drawn [Hz].
        extras: whether it has the estimated robot beside the true one, and the friction cones.
    """

    main_only: bool = False
    tolerance: float | None = None
    row_rate: float | None = None
    picture_rate: float = 100.0
    extras: bool = True
    most: int = 64

    def picker(self) -> ChangedRows | ThinnedRows | None:
        """Make the object that chooses the values of one signal; ``None`` if all that are taken are
        written."""
        if self.row_rate is not None:
            return None  # or else a curve would end where its signal does not change
        return ChangedRows() if self.tolerance is None else ThinnedRows(self.tolerance)


RECORDED = Detail(main_only=True, tolerance=1.0 / 250.0, picture_rate=50.0, extras=False)
"""Detail of a recording beside its numbers: enough for a first look with any Rerun. The tolerance
is less than a pixel of a plot."""
WHOLE = Detail()
"""Detail of ``aloft view``, which draws from the numbers."""
LIVE = Detail(row_rate=100.0)
"""Detail of a run that is shown while it goes on."""


@dataclass(frozen=True)
class Colors:
    """The colours in which one run is drawn, as 0xRRGGBBAA."""

    robot: int = 0x90A4AEFF
    estimate: int = 0x42A5F5FF
    force: int = 0xE53935FF
    cone: int = 0xFFB74DFF
    com: int = 0xFDD835FF
    plan: int = 0x66BB6AFF
    target: int = 0xAB47BCFF
    support: int = 0x26C6DAFF
    push: int = 0xFF4081FF


OTHER_RUN = Colors(robot=0xD7A86EFF, estimate=0xFFCC80FF, force=0xB71C1CFF, com=0xFB8C00FF)
"""The colours of the run that another is compared with."""


@dataclass(frozen=True)
class Moments:
    """The instants of a batch that are drawn.

    Attributes:
        batch: the ticks and their signals.
        due: which of the batch's ticks are drawn, (n,).
        times: their times, as Rerun's columns.
    """

    batch: RecordedRows
    due: NDArray[np.int64]
    times: list[Any]

    def __len__(self) -> int:
        return len(self.due)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a signal at these instants, (n, ...)."""
        return self.batch.signal(name)[self.due]

    def poses(self, robot: RobotDescription, source: PoseSource) -> LinkPoses:
        """Compute the poses of the links at these instants."""
        base, turn = source.base(self.__getitem__, len(self))
        return link_poses(robot, base, turn, self[source.joint_position])


class SceneDisplay:
    """Draws one thing of the scene. ``write_static`` is called once, ``write`` for every batch.

    ``scale`` is the factor by which the sizes of marks and lines suit the robot.
    """

    def __init__(
        self,
        stream: Any,
        header: Header,
        ports: ScenePorts,
        world: str,
        colors: Colors,
        detail: Detail,
    ) -> None:
        assert header.robot is not None
        self.stream, self.header, self.ports = stream, header, ports
        self.robot: RobotDescription = header.robot
        self.world, self.colors, self.detail = world, colors, detail
        self.scale = scale_of(self.robot)
        self._last: dict[str, NDArray[Any]] = {}

    def write_static(self) -> None:
        """Write what does not change: shapes, colours, sizes."""

    def write(self, moments: Moments) -> None:
        """Write the part at these instants."""
        raise NotImplementedError

    def log(self, name: str, what: Any) -> None:
        """Write something that does not change to an entity below ``world``."""
        self.stream.log(f"{self.world}/{name}", what, static=True)

    def changing(self, name: str, moments: Moments, *values: NDArray[Any]) -> Moments:
        """Return the instants at which some of ``values``, each (n, ...), differ from the instant
        before.

        A viewer keeps what it has, so what stands still for long, as a plan's feet, is written once.
        ``name`` tells apart what is drawn.
        """
        count = len(moments)
        rows = np.column_stack([value.reshape(count, -1) for value in values])
        before = self._last.get(name)
        new = np.ones(count, np.bool_)
        new[1:] = (rows[1:] != rows[:-1]).any(axis=1)
        if before is not None:
            new[0] = bool((rows[0] != before).any())
        self._last[name] = rows[-1].copy()
        due = moments.due[new]
        return Moments(moments.batch, due, time_columns(self.header, moments.batch.ticks[due]))

    def send(self, name: str, moments: Moments, columns: Any) -> None:
        """Write columns with one row for each instant to an entity below ``world``."""
        self.stream.send_columns(f"{self.world}/{name}", moments.times, columns)


@contextmanager
def opened_stream(path: Path, name: str, layout: Any) -> Iterator[Any]:
    """Open a Rerun stream into a file, which is there at the end. Raises ``OSError``."""
    import rerun as rr

    path.parent.mkdir(parents=True, exist_ok=True)
    path.open("wb").close()  # Rerun would only warn, so find out here whether it can be written
    stream = rr.RecordingStream("aloft", recording_id=name, send_properties=False)
    rr.set_log_time_enabled(False, recording=stream)
    stream.save(path, default_blueprint=layout)
    try:
        yield stream
    finally:
        stream.flush(timeout_sec=30)
        stream.disconnect()
