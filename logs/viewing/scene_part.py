"""What the parts of the 3D scene share: where they write to, and the instants that are drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ...robots.kinematics import LinkPoses, link_poses
from ..file.format import Header, RecordedRows
from ..file.time_columns import time_columns
from .detail import Detail
from .robot_shapes import scale_of
from .scene_ports import PoseSource, ScenePorts


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
        """A signal at these instants, (n, ...)."""
        return self.batch.signal(name)[self.due]

    def poses(self, robot: RobotDescription, source: PoseSource) -> LinkPoses:
        """Where the links are at these instants. A fixed base is at the origin."""
        base, turn = np.zeros((len(self), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(self), 1))
        if source.base_position is not None and source.base_orientation is not None:
            base, turn = self[source.base_position], self[source.base_orientation]
        return link_poses(robot, base, turn, self[source.joint_position])


class ScenePart:
    """One part of the scene. ``write_static`` is called once, ``write`` for every batch.

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
        """The instants at which some of ``values``, each (n, ...), differ from the instant before.

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
