"""The robot in 3D: its links posed, the forces under its feet, its centre of mass.

Everything is taken from one output port that knows the base's pose, the joint angles and, where it
has them, contact points, contact forces and the centre of mass: the simulator's truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.description import Link, RobotDescription, Shape
from ..runtime.kinematics import link_poses
from .format import Header, RecordedRows
from .time_columns import time_columns

Array = NDArray[np.float64]

POSE_FIELDS = ("base_position", "base_orientation", "joint_position")
POSE_RATE = 100.0
"""Pictures a second [Hz]: more than an eye sees, a fifth of the bytes."""
FORCE_SCALE = 0.002
"""Length of an arrow [m] for each newton: the weight of BRUCE is 10 cm."""
SHORTEST_FLIGHT = 0.03
"""Without load for less [s] is a bounce, not a flight."""
SIMULATED, FORCE, MASS_CENTRE = 0x90A4AEFF, 0xE53935FF, 0xFDD835FF


def port_with_pose(header: Header) -> str | None:
    """The first output, as ``block.port``, whose signal says where every link is."""
    if header.robot is None:
        return None
    ports: dict[str, set[str]] = {}
    for field in header.bus.fields:
        if not field.constant:
            ports.setdefault(field.name.rpartition(".")[0], set()).add(field.field_name)
    return next((port for port, names in ports.items() if names.issuperset(POSE_FIELDS)), None)


class RobotWriter:
    """Writes the robot that ``port`` poses to a Rerun ``stream``, batch by batch."""

    def __init__(self, stream: Any, header: Header, port: str) -> None:
        assert header.robot is not None
        self._stream, self._header, self._robot, self._port = stream, header, header.robot, port
        self._every = max(1, round(header.base_rate / POSE_RATE))
        known = {field.name for field in header.bus.fields if not field.constant}
        self._has_forces = {f"{port}.contact_position", f"{port}.contact_force"} <= known
        self._has_com = f"{port}.com" in known
        self._flights = Flights(max(1, round(SHORTEST_FLIGHT * header.base_rate)))

    def write_static(self) -> None:
        """Write what does not move: the links' shapes, colours and sizes."""
        import rerun as rr

        stream = self._stream
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for link in self._robot.links:
            shapes = capsules(shapes_of(self._robot, link))
            stream.log(f"world/robot/{link.name}", shapes, static=True)
        if self._has_forces:
            arrows = rr.Arrows3D.from_fields(colors=[FORCE])
            stream.log("world/contact_forces", arrows, static=True)
        if self._has_com:
            ball = rr.Points3D.from_fields(colors=[MASS_CENTRE], radii=[0.012])
            stream.log("world/com", ball, static=True)

    def write(self, batch: RecordedRows) -> None:
        """Write the ticks of a batch that are due, and the flights that ended in it."""
        due = np.flatnonzero(batch.ticks % self._every == 0)
        if len(due):
            self._write_poses(batch, due)
        if self._has_forces:
            force = batch.signal(f"{self._port}.contact_force")
            self._write_flights(batch.ticks, (force != 0.0).any(axis=2))

    def _write_poses(self, batch: RecordedRows, due: NDArray[np.int64]) -> None:
        import rerun as rr

        times, stream = time_columns(self._header, batch.ticks[due]), self._stream
        base, orientation, joints = (
            batch.signal(f"{self._port}.{name}")[due] for name in POSE_FIELDS
        )
        poses = link_poses(self._robot, base, orientation, joints)
        for link in self._robot.links:
            position, rotation = poses.of(link.name)
            transforms = rr.Transform3D.columns(translation=position, mat3x3=rotation)
            stream.send_columns(f"world/robot/{link.name}", times, transforms)
        if self._has_forces:
            position = batch.signal(f"{self._port}.contact_position")[due]
            force = batch.signal(f"{self._port}.contact_force")[due] * FORCE_SCALE
            arrows = rr.Arrows3D.columns(
                origins=position.reshape(-1, 3), vectors=force.reshape(-1, 3)
            )
            points = np.full(len(position), position.shape[1])
            stream.send_columns("world/contact_forces", times, arrows.partition(points))
        if self._has_com:
            com = batch.signal(f"{self._port}.com")[due]
            stream.send_columns("world/com", times, rr.Points3D.columns(positions=com))

    def _write_flights(self, ticks: NDArray[np.int64], loaded: NDArray[np.bool_]) -> None:
        import rerun as rr

        events = self._flights.add(ticks, loaded)
        if events:
            times = time_columns(self._header, np.array([tick for tick, _ in events]))
            texts = [text for _, text in events]
            columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(texts))
            self._stream.send_columns("events", times, columns)


class Flights:
    """When the robot left the ground and when it came back; a time in the air shorter than
    ``least`` ticks is a bounce and no event."""

    def __init__(self, least: int) -> None:
        self._least = least
        self._began: int | None = None
        self._told = False

    def add(self, ticks: NDArray[np.int64], loaded: NDArray[np.bool_]) -> list[tuple[int, str]]:
        """The events, as (tick, text), that show in further ticks.

        ``loaded`` (n, n_contacts) says which points carry load.
        """
        events: list[tuple[int, str]] = []
        on_ground: list[bool] = np.atleast_1d(loaded.any(axis=1)).tolist()
        for tick, standing in zip(ticks.tolist(), on_ground, strict=True):
            if standing:
                if self._told:
                    events.append((tick, "touchdown"))
                self._began, self._told = None, False
                continue
            if self._began is None:
                self._began = tick
            if not self._told and tick - self._began >= self._least - 1:
                events.append((self._began, "lift-off"))
                self._told = True
        return events


def shapes_of(robot: RobotDescription, link: Link) -> list[Shape]:
    """What to draw for a link: its collision shapes, or else bones to the joints it carries."""
    if link.shapes:
        return list(link.shapes)
    ends = [joint.origin for joint in robot.joints if joint.parent == link.name]
    return [Shape(start=(0.0, 0.0, 0.0), end=end, radius=0.01) for end in ends]


def capsules(shapes: Sequence[Shape]) -> Any:
    """Rerun's capsules, which reach from their origin along +z, turned to lie on ``shapes``."""
    import rerun as rr

    starts = np.array([shape.start for shape in shapes]).reshape(-1, 3)
    spans = np.array([shape.end for shape in shapes]).reshape(-1, 3) - starts
    lengths = np.linalg.norm(spans, axis=1)
    return rr.Capsules3D(
        lengths=lengths,
        radii=[shape.radius for shape in shapes],
        translations=starts,
        quaternions=np.array([quaternion_from_z(span) for span in spans]).reshape(-1, 4),
        colors=[SIMULATED] * len(shapes),
        fill_mode="solid",
    )


def quaternion_from_z(direction: Array) -> Array:
    """The shortest rotation x, y, z, w from +z to ``direction``, which need not be a unit vector."""
    length = float(np.linalg.norm(direction))
    if length < 1e-12:
        return np.array([0.0, 0.0, 0.0, 1.0])
    x, y, z = direction / length
    if z < -1.0 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])  # straight down: any half turn will do
    quaternion = np.array([-y, x, 0.0, 1.0 + z])
    return quaternion / float(np.linalg.norm(quaternion))
