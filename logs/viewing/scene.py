"""Draws the robot in 3D with its contacts, its motion and its plan."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..file.format import EVENTS, Header, RecordedRows
from ..file.time_columns import time_columns, timed
from .detail import Detail
from .flights import SHORTEST_FLIGHT, TOUCHDOWN, Flights
from .foot_forces import AFTER_TOUCHDOWN, FootForces, LandingPeaks
from .scene_contacts import ContactPart
from .scene_motion import FootTargetPart, MassCentrePart, PlanPart
from .scene_part import Colors, Moments
from .scene_ports import ScenePorts
from .scene_push import PushPart
from .scene_robot import RobotPart
from .scene_sensors import SensorPart
from .scene_terrain import TerrainPart

PARTS = (
    TerrainPart,
    RobotPart,
    ContactPart,
    MassCentrePart,
    PlanPart,
    FootTargetPart,
    PushPart,
    SensorPart,
)


class Scene:
    """Writes the scene to a Rerun ``stream``, batch by batch, below ``root``."""

    def __init__(
        self,
        stream: Any,
        header: Header,
        ports: ScenePorts,
        root: str,
        colors: Colors,
        detail: Detail,
    ) -> None:
        self._stream, self._header, self._ports = stream, header, ports
        self._root = root
        self._every = max(1, round(header.base_rate / detail.picture_rate))
        self._parts = [
            part(stream, header, ports, f"{root}world", colors, detail) for part in PARTS
        ]
        self._flights = Flights(max(1, round(SHORTEST_FLIGHT * header.base_rate)))
        self._loads = self._peaks = None
        if ports.contact_force is not None and header.robot is not None and header.robot.feet:
            self._loads = FootForces(stream, header, ports.contact_force, root, detail.picker())
            after = max(1, round(AFTER_TOUCHDOWN * header.base_rate))
            self._peaks = LandingPeaks(header.robot, after)

    def write_static(self) -> None:
        """Write everything that does not move."""
        import rerun as rr

        self._stream.log(f"{self._root}world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for part in self._parts:
            part.write_static()
        if self._loads is not None:
            self._loads.write_static()

    def write(self, batch: RecordedRows) -> None:
        """Write the instants of a batch that are drawn, and the flights that begin or end in it."""
        due = np.flatnonzero(batch.ticks % self._every == 0)
        if len(due):
            moments = Moments(batch, due, time_columns(self._header, batch.ticks[due]))
            for part in self._parts:
                part.write(moments)
        if self._loads is not None:
            self._loads.write(batch)
        self._write_flights(batch)

    def write_rest(self) -> None:
        """Write the last forces on the feet, if they were constant in the end."""
        if self._loads is not None:
            self._loads.write_rest()

    def _write_flights(self, batch: RecordedRows) -> None:
        import rerun as rr

        if self._ports.contact_force is None:
            return
        force = batch.signal(self._ports.contact_force)
        events = self._flights.add(batch.ticks, (force != 0.0).any(axis=2))
        if self._peaks is not None:
            touchdowns = [tick for tick, text in events if text == TOUCHDOWN]
            events = sorted(events + self._peaks.add(batch.ticks, force, touchdowns))
        if events:
            ticks = np.array([tick for tick, _ in events])
            times = time_columns(self._header, ticks)
            texts = timed(self._header, ticks, [text for _, text in events])
            columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(texts))
            self._stream.send_columns(f"{self._root}{EVENTS}", times, columns)
