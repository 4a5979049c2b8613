"""The robot in 3D: its links posed, the forces under its feet, its centre of mass.

Everything is taken from one output port that knows the base's pose, the joint angles and, where it
has them, contact points, contact forces and the centre of mass: the simulator's truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.description import Link, RobotDescription, Shape
from ..runtime.kinematics import link_poses
from ..runtime.stages import CheckedGraph

if TYPE_CHECKING:
    from .recording import RunLog

Array = NDArray[np.float64]

POSE_FIELDS = ("base_position", "base_orientation", "joint_position")
FORCE_SCALE = 0.002
"""Length of an arrow [m] for each newton: the weight of BRUCE is 10 cm."""
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


def write_robot(stream: Any, columns: Sequence[Any], run: RunLog, port: str, rows: slice) -> None:
    """Write the links' shapes once and their poses, forces and centre of mass for ``rows``.

    ``columns`` are the time columns of the same rows.
    """
    import rerun as rr

    robot = run.graph.robot
    assert robot is not None, "port_with_pose has found a robot"
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    base, orientation, joints = (run.signal(f"{port}.{field}")[rows] for field in POSE_FIELDS)
    poses = link_poses(robot, base, orientation, joints)
    for link in robot.links:
        entity = f"world/robot/{link.name}"
        stream.log(entity, capsules(shapes_of(robot, link)), static=True)
        position, rotation = poses.of(link.name)
        stream.send_columns(
            entity, columns, rr.Transform3D.columns(translation=position, mat3x3=rotation)
        )
    known = {name.rpartition(".")[2] for name in run.names(port)}
    if {"contact_position", "contact_force"} <= known:
        origins = run.signal(f"{port}.contact_position")[rows]
        vectors = run.signal(f"{port}.contact_force")[rows] * FORCE_SCALE
        stream.log("world/contact_forces", rr.Arrows3D.from_fields(colors=[FORCE]), static=True)
        stream.send_columns(
            "world/contact_forces",
            columns,
            rr.Arrows3D.columns(
                origins=origins.reshape(-1, 3), vectors=vectors.reshape(-1, 3)
            ).partition(np.full(len(origins), origins.shape[1])),
        )
    if "com" in known:
        stream.log(
            "world/com", rr.Points3D.from_fields(colors=[MASS_CENTRE], radii=[0.012]), static=True
        )
        stream.send_columns(
            "world/com", columns, rr.Points3D.columns(positions=run.signal(f"{port}.com")[rows])
        )


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
