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
from ..runtime.stages import CheckedGraph
from .logged_run import LoggedRun, time_columns

Array = NDArray[np.float64]

POSE_FIELDS = ("base_position", "base_orientation", "joint_position")
POSE_RATE = 100.0
"""Pictures a second [Hz]: more than an eye sees, a fifth of the bytes."""
FORCE_SCALE = 0.002
"""Length of an arrow [m] for each newton: the weight of BRUCE is 10 cm."""
SHORTEST_FLIGHT = 0.03
"""Without load for less [s] is a bounce, not a flight."""
SIMULATED, FORCE, MASS_CENTRE = 0x90A4AEFF, 0xE53935FF, 0xFDD835FF


def port_with_pose(graph: CheckedGraph) -> str | None:
    """The first output, as ``block.port``, whose signal says where every link is."""
    if graph.robot is None:
        return None
    for spec in graph.blocks:
        for name, output in spec.block_type.outputs.items():
            if all(field in output.signal.fields for field in POSE_FIELDS):
                return f"{spec.path}.{name}"
    return None


def write_robot(stream: Any, run: LoggedRun, robot: RobotDescription, port: str) -> None:
    """Write the links' shapes once, then their poses, forces and centre of mass over time."""
    import rerun as rr

    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    rows = slice(None, None, max(1, round(run.graph.base_rate / POSE_RATE)))
    columns = time_columns(run.graph, run.ticks[rows])
    write_links(stream, columns, robot, [run.signal(f"{port}.{f}")[rows] for f in POSE_FIELDS])
    known = {name.removeprefix(f"{port}.") for name, _ in run.fields()}
    if {"contact_position", "contact_force"} <= known:
        force = run.signal(f"{port}.contact_force")
        write_forces(stream, columns, run.signal(f"{port}.contact_position")[rows], force[rows])
        write_flights(stream, run, force)
    if "com" in known:
        ball = rr.Points3D.from_fields(colors=[MASS_CENTRE], radii=[0.012])
        stream.log("world/com", ball, static=True)
        com = run.signal(f"{port}.com")[rows]
        stream.send_columns("world/com", columns, rr.Points3D.columns(positions=com))


def write_links(
    stream: Any, columns: Sequence[Any], robot: RobotDescription, state: Sequence[Array]
) -> None:
    """Write every link's shape once and its pose over time; ``state`` as in ``POSE_FIELDS``."""
    import rerun as rr

    base, orientation, joints = state
    poses = link_poses(robot, base, orientation, joints)
    for link in robot.links:
        entity = f"world/robot/{link.name}"
        stream.log(entity, capsules(shapes_of(robot, link)), static=True)
        position, rotation = poses.of(link.name)
        stream.send_columns(
            entity, columns, rr.Transform3D.columns(translation=position, mat3x3=rotation)
        )


def write_forces(stream: Any, columns: Sequence[Any], position: Array, force: Array) -> None:
    """Write an arrow for every contact point (n, n_contacts, 3) over time."""
    import rerun as rr

    stream.log("world/contact_forces", rr.Arrows3D.from_fields(colors=[FORCE]), static=True)
    arrows = rr.Arrows3D.columns(
        origins=position.reshape(-1, 3), vectors=force.reshape(-1, 3) * FORCE_SCALE
    )
    points = np.full(len(position), position.shape[1])
    stream.send_columns("world/contact_forces", columns, arrows.partition(points))


def write_flights(stream: Any, run: LoggedRun, force: Array) -> None:
    """Write lift-off and touchdown as lines of text; ``force`` (n, n_contacts, 3) of all ticks."""
    import rerun as rr

    least = max(1, round(SHORTEST_FLIGHT * run.graph.base_rate))
    flights = flight_events((force != 0.0).any(axis=2), least)
    if flights:
        columns = time_columns(run.graph, run.ticks[[row for row, _ in flights]])
        texts = [text for _, text in flights]
        levels = ["INFO"] * len(texts)
        stream.send_columns("events", columns, rr.TextLog.columns(text=texts, level=levels))


def flight_events(loaded: NDArray[np.bool_], least: int) -> list[tuple[int, str]]:
    """When the robot left the ground and when it came back, as (row, text).

    ``loaded`` (n, n_contacts) says which points carry load; a time in the air shorter than
    ``least`` rows is a bounce and no event.
    """
    in_air = np.logical_not(loaded.any(axis=1)).reshape(-1)
    edges = np.flatnonzero(np.diff(in_air, prepend=False, append=False))
    events = []
    for start, end in edges.reshape(-1, 2).tolist():
        if end - start >= least:
            events.append((start, "lift-off"))
            if end < len(in_air):
                events.append((end, "touchdown"))
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
